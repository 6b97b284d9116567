/* Adapter: a virtual logic analyser that PulseView and sigrok-cli reach by the BeagleLogic TCP protocol (beagle_text.h).
 *
 * Every connection has settings and a capture of its own; libsigrok's scan is a connection, too. While a capture runs, the
 * connection carries nothing but samples: an answer to a line would be taken for them, so every line but `close` is ignored
 * and counted. In wall pace a client that reads too slowly loses whole buffers, which are counted and reported; otherwise
 * time waits for it. While there is no capture, nothing is computed. */
#ifndef PSABENCH_LINK_LOGIC_BEAGLE_TCP_H
#define PSABENCH_LINK_LOGIC_BEAGLE_TCP_H

#include "link/listener.h"
#include "link/logic/beagle_text.h"

#define BEAGLE_PORT        5555u /* of the BeagleLogic server */
#define BEAGLE_CLIENTS_MAX 8u

struct beagle_request {
    uint32_t hz;
    unsigned bytes; /* of a sample, 1 or 2 */
    uint32_t block; /* samples: what is lost is lost in multiples of it */
};

struct beagle_progress {
    int64_t first_ns;              /* simulated instant of the first sample */
    uint64_t kept, dropped, holes; /* samples, samples, runs of them */
    size_t waiting;                /* bytes */
};

/* Where samples come from: samplers of a trace, in the application's hands. */
struct beagle_source {
    void *ctx;
    void *(*start)(void *ctx, const struct beagle_request *r); /* NULL: no memory */
    size_t (*take)(void *capture, uint8_t *buf, size_t cap);   /* whole samples */
    void (*look)(const void *capture, struct beagle_progress *out);
    void (*stop)(void *capture); /* and frees it */
    size_t high;                 /* waiting bytes above which time should stand still; 0: never */
};

/* What one or all captures came to. */
struct beagle_totals {
    uint64_t captures, samples, lost, holes;
    uint64_t rejected; /* lines */
    uint32_t running;
    int64_t first_ns; /* simulated instant of the first sample of the latest capture */
};

struct beagle_server {      /* read-only outside beagle_tcp.c */
    struct listener listen; /* first */
    struct links *links;
    struct beagle_source source;
    struct beagle_peer *peers;
    uint32_t clients;
    uint16_t port;
    struct beagle_totals ended;
    uint8_t chunk[65536];
};

/* port 0: a free one. 0, or -errno: -EADDRINUSE. The struct must not move afterwards. */
int beagle_open(struct beagle_server *s, struct links *links, const struct beagle_source *source, uint16_t port);

/* Captures end; clients are the loop's: marked as gone and released by links_reap(). Before the source goes. */
void beagle_close(struct beagle_server *s);

struct beagle_totals beagle_totals(const struct beagle_server *s); /* ended captures and those that run */

/* Whether a capture runs: simulated time should move in slices that its buffers hold. */
bool beagle_is_sampling(const struct beagle_server *s);

#endif

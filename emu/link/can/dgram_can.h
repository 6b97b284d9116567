/* What the adapters of CAN over UDP share: output waits in a queue for the kernel, input is read as fast as the bus takes
 * it, every loss is counted. An adapter brings its sockets and the codec of its datagrams.
 *
 * The peers are one client of the simulated bus. UDP has no flow control: a program that reads too slowly loses frames in
 * its own socket, at every pace. */
#ifndef PSABENCH_LINK_CAN_DGRAM_CAN_H
#define PSABENCH_LINK_CAN_DGRAM_CAN_H

#include "link/can/can_hub.h"

#include <sys/socket.h>

#define DGRAM_CAN_QUEUE 4096u
#define DGRAM_CAN_MAX   1472u /* bytes of a datagram: what Ethernet carries unfragmented */

struct dgram_can;

struct dgram_can_ops {
    const char *adapter;
    bool error_frames; /* those of the bus are sent, too */
    /* One datagram of the first frames that wait, dgram_can_waiting(); returns their number, at least 1. */
    unsigned (*encode)(const struct dgram_can *d, uint8_t out[DGRAM_CAN_MAX], size_t *size);
    /* Looks at the datagram in d->in, of d->in_size bytes: the number of frames to be taken from it goes into d->in_left. Returns
     * NULL, or why it is refused. */
    const char *(*accept)(struct dgram_can *d, const struct sockaddr_storage *from);
    /* The next of these frames. False: it is none. */
    bool (*decode)(struct dgram_can *d, struct can_msg *m);
};

struct dgram_can_stamped {
    int64_t t_ns;
    struct can_msg m;
};

struct dgram_can {
    struct link link; /* first; receives */
    struct can_client can;
    struct can_hub *hub;
    const struct dgram_can_ops *ops;
    int out_fd;                 /* sends; -1: the receiving socket does */
    struct sockaddr_storage to; /* where to, unless out_fd is connected */
    socklen_t to_size;
    uint64_t datagrams;                              /* handed to the kernel */
    struct dgram_can_stamped queue[DGRAM_CAN_QUEUE]; /* waits for the kernel */
    unsigned head, len;
    uint8_t in[DGRAM_CAN_MAX + 1]; /* the datagram whose frames are taken; longer ones are cut there */
    size_t in_size, in_at;
    unsigned in_left;
    uint32_t rxq_ovfl; /* the kernel's counter of datagrams it lost before we read them */
    bool lost_reported, failed_reported, refused_reported, overrun_reported;
};

/* The i-th frame that waits, from 0; NULL: there are fewer. */
const struct dgram_can_stamped *dgram_can_waiting(const struct dgram_can *d, unsigned i);

/* n datagrams of the peer never came. */
void dgram_can_lost(struct dgram_can *d, uint32_t n);

/* A port from 1 to 65535 in decimal digits up to *end, which follows them; false: none, *port is untouched. */
bool dgram_can_port(const char *text, const char **end, uint16_t *port);

/* A socket that does not block, with a large buffer, and tells its losses; or -1 with errno. */
int dgram_can_socket(int family);

/* The sockets are open: the client joins the bus. channel: its name there. */
void dgram_can_join(struct dgram_can *d, struct can_hub *hub, const struct dgram_can_ops *ops, const char *channel);
void dgram_can_close(struct dgram_can *d);

#endif

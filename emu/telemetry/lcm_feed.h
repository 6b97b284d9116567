/* What the bench does, as LCM messages (proto/lcm): every frame, the readings and register accesses that frames carry, what
 * the instruments show, and the truth if it is asked for.
 *
 * An observer: it has a node on each bus that sends nothing, and events that look and change nothing. Readings and registers
 * come from the frames on the bus, as any other receiver has them. Nothing allocates. The same run publishes the same
 * messages. Channels: docs/tools/lcm.md. */
#ifndef PSABENCH_TELEMETRY_LCM_FEED_H
#define PSABENCH_TELEMETRY_LCM_FEED_H

#include "command/view.h"
#include "link/lcm/lcm_port.h"
#include "telemetry/psa2_reading.h"

#define LCM_INSTRUMENTS_NS (NS_PER_S / 10) /* between two messages of what the instruments show */

struct lcm_board;

/* An SDO request that has no answer yet. */
struct lcm_request {
    bool waits, write;
    uint16_t index;
    uint8_t sub;
    int64_t value;
};

struct lcm_unit {
    struct unit *unit;
    const char *name;
    const struct lcm_board *board; /* how its frames are read; NULL: its readings are not published */
    char readings[LCM_CHANNEL_MAX + 1], registers[LCM_CHANNEL_MAX + 1], truth[LCM_CHANNEL_MAX + 1]; /* channels */
    uint8_t part[2][8]; /* frames of a reading that is not complete */
    unsigned parts;
    struct psa2_reader psa2;
    struct lcm_request request;
};

#define LCM_NO_UNIT 0xFFFFu

struct lcm_bus {
    struct lcm_feed *feed;
    struct can_node node;
    char name[16], frames[LCM_CHANNEL_MAX + 1];
    uint16_t unit_of[128]; /* by node id, as far as they are known; else LCM_NO_UNIT */
};

struct lcm_feed {
    struct lcm_port port;    /* open before lcm_feed_start() */
    void (*tick)(void *ctx); /* after each message of the instruments; may be NULL */
    void *ctx;
    const struct control_bench *bench;
    int64_t epoch_ns;       /* added to the simulated time */
    int64_t truth_every_ns; /* 0: no truth */
    struct lcm_bus bus[CONTROL_BUSES_MAX];
    struct lcm_unit unit[CONTROL_UNITS_MAX];
    struct sched_ev instruments, truth;
};

/* From now on everything is published. The bench stays the caller's; f is not moved until lcm_feed_stop(). */
void lcm_feed_start(struct lcm_feed *f, const struct control_bench *bench, int64_t epoch_ns, int64_t truth_every_ns);

void lcm_feed_stop(struct lcm_feed *f); /* the port stays open */

/* For the files of the folder: a message of LCM_MESSAGE_MAX bytes at most; len <= 0: it could not be encoded. */
static inline void lcm_feed_send(struct lcm_feed *f, const char *channel, const void *data, int len, int64_t t_ns)
{
    if (len > 0) lcm_port_publish(&f->port, channel, data, (size_t)len, (t_ns + f->epoch_ns) / 1000);
}

#endif

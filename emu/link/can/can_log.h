/* All frames of a bus into a file, as candump -L writes them: cantools, python-can and canplayer read it.
 *
 *     (0000000001.234567) can0 185#15DA1F0100000000
 *
 * Seconds have ten digits, so that lines of frames of one kind are of one length. It is a passive observer, not a client:
 * it changes nothing on the bus, and time waits for it only while the kernel accepts the text (use a file, not a pipe
 * without a reader). */
#ifndef PSABENCH_LINK_CAN_CAN_LOG_H
#define PSABENCH_LINK_CAN_CAN_LOG_H

#include "base/can/can.h"

#define CAN_LOG_BUFFER 65536u

struct can_log {
    struct can_node node;
    const char *channel, *path;
    int64_t epoch_ns; /* added to the simulated time in time stamps */
    int fd;
    int error;       /* errno of the first write that failed; what follows is not written */
    uint64_t frames; /* seen */
    uint64_t stored; /* of them, in the file: whole lines */
    bool reported;   /* the owner's: that it failed was said */
    size_t len;
    char text[CAN_LOG_BUFFER];
};

/* An earlier file of that name is replaced. 0, or -errno: -EBUSY the process *owner writes it. The strings stay the caller's. */
int can_log_open(struct can_log *l, struct can_bus *bus, const char *channel, const char *path, int64_t epoch_ns,
                 long *owner);

/* ESTALE is its error when the file has been removed or replaced. */
void can_log_look(struct can_log *l);

/* What waits goes into the file, which ends with a whole line in any case. 0, or -errno of whatever failed since it was
 * opened. */
int can_log_flush(struct can_log *l);

void can_log_close(struct can_log *l);

#endif

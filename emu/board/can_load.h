/* How much of a bus is in use, and whether a stream fits it, with the sentence that says why not. */
#ifndef PSABENCH_BOARD_CAN_LOAD_H
#define PSABENCH_BOARD_CAN_LOAD_H

#include "base/can.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* `frames` frames that take need_ns at worst (canbits.h) and are due every have_ns; 0: whenever, not judged. False with a
 * sentence about `what` in why. */
bool can_load_fits(const struct can_bus_cfg *bus, const char *what, unsigned frames, int64_t need_ns, int64_t have_ns,
                   char *why, size_t cap);

/* Load in units of 0.1 % since this mark was last looked at. */
struct can_load_mark {
    int64_t t_ns, busy_ns;
};
int64_t can_load_since(struct can_load_mark *m, const struct can_bus *bus, int64_t t_ns);

#endif

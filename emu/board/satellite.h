/* Satellite navigation of a board that has a receiver. */
#ifndef PSABENCH_BOARD_SATELLITE_H
#define PSABENCH_BOARD_SATELLITE_H

#include <stdbool.h>
#include <stdint.h>

struct board;

/* What is wrong with a receiver: the sum of the faults that are active (fault/receiver.c). East, north. */
struct board_receiver_faults {
    bool outage, frozen_time;
    double checksum_probability; /* of a message */
    int32_t weeks;               /* by which the date is off */
    double rate_mps[2];          /* the position runs away, and the velocity says so */
    double base_m[2];            /* how far it has, when this is set */
    double jump_m[2];
};

/* Operations on a satellite receiver. */
struct board_receiver {
    void (*set_faults)(struct board *b, const struct board_receiver_faults *f, int64_t t_ns);
};

#endif

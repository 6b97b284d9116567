/* Gyros of a board that counts angle. */
#ifndef PSABENCH_BOARD_GYROS_H
#define PSABENCH_BOARD_GYROS_H

#include <stdbool.h>
#include <stdint.h>

struct board;

/* What is wrong with a gyro: the sum of the faults that are active (fault/gyro.c). All zero: nothing. */
struct board_gyro_fault {
    bool stuck;           /* its counter stands still */
    double limit_radps;   /* that its counter follows; 0: any rate */
    double bias_radps;    /* measured less true */
    double scale;         /* the angle is multiplied by 1 + scale */
    double lock_in_radps; /* adds to its own zone of lock-in */
};

/* Operations on the gyros x, y, z. */
struct board_gyros {
    void (*set_fault)(struct board *b, unsigned axis, const struct board_gyro_fault *f, int64_t t_ns);
};

#endif

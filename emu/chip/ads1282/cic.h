/* Sinc5 of the ADS1281 / ADS1282 at the modulator's rate: five integrators at CLK/4, decimation by N, five combs.
 *
 * Pure but for the state in the caller's struct; arithmetic modulo 2^64, as such filters are built: exact as long as the
 * output fits. Sources 1.8. */
#ifndef PSABENCH_CHIP_ADS1282_CIC_H
#define PSABENCH_CHIP_ADS1282_CIC_H

#include <stdbool.h>
#include <stdint.h>

struct ads1282_cic {
    unsigned ratio, n; /* N; samples taken since the last output */
    uint64_t integrator[5], comb[5];
};

void ads1282_cic_init(struct ads1282_cic *c, unsigned ratio); /* 8, 16, 32, 64, 128; clears the past */

/* One sample. True each N: *y is the output, of gain N^5; |x| N^5 < 2^63. */
bool ads1282_cic_take(struct ads1282_cic *c, int64_t x, int64_t *y);

#endif

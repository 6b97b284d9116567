/* Volts to the modulator's input: scale, noise of the converter, saturation. Pure; the same words by vectors and one by one. Private
 * to ads1282/chain.c, ads1282/skip.c and their tests. */
#ifndef PSABENCH_CHIP_ADS1282_INPUT_H
#define PSABENCH_CHIP_ADS1282_INPUT_H

#include "chip/ads1282/filter.h"

#include <stdint.h>

struct ads1282_scale {
    double lsb_per_v; /* full scale 2^34 */
    double noise_lsb; /* times ads1282_sum_draw() */
};

#define ADS1282_INPUT_MAX_LSB (ADS1282_SATURATION * (double)(INT64_C(1) << ADS1282_BLOCK_LOG2))
#define ADS1282_DRAW_PAIRS    UINT64_C(0x0000FFFF0000FFFF)

/* Zero mean, unit rms after division by sqrt((2^32 - 1) / 3). Four uniforms are enough: the chain averages more than 50 blocks,
 * which leaves the output an excess kurtosis below 0.006, at a seventh of the cost of a Gaussian draw. */
static inline double ads1282_sum_draw(uint64_t u)
{
    const uint64_t pairs = (u & ADS1282_DRAW_PAIRS) + (u >> 16 & ADS1282_DRAW_PAIRS);
    return (double)(int32_t)((pairs & 0xFFFFFFFF) + (pairs >> 32)) - 131070.0;
}

/* A number of full scale 2^34 to the modulator, which saturates. Rounds to nearest without a call into libm. */
static inline int64_t ads1282_saturate_lsb(double x)
{
    if (!(x < ADS1282_INPUT_MAX_LSB)) x = ADS1282_INPUT_MAX_LSB; /* not a number saturates too */
    if (x < -ADS1282_INPUT_MAX_LSB) x = -ADS1282_INPUT_MAX_LSB;
    return (int64_t)(x + 0x1p36 + 0.5) - (INT64_C(1) << 36);
}

/* What both inputs may have over ground. */
struct ads1282_range {
    double min_v, max_v;
};

/* n samples whose inputs have this middle: an input beyond its range stays at the limit (E0). Returns how many have one. */
unsigned ads1282_limit_row(struct ads1282_range range, double common_mode_v, double *vin_v, unsigned n);

/* n samples: volts and draws in, n numbers of full scale 2^34 out. u: 64 random bits a sample, NULL: without noise. */
void ads1282_input_row(struct ads1282_scale scale, const double *vin_v, const uint64_t *u, unsigned n, int64_t *lsb);

#endif

/* Bit-true fourth-order modulator of the ADS1281 / ADS1282: two second-order loops in cascade, two bits a clock.
 *
 * Pure integers but for the state in the caller's struct: equal on every machine. The loops are ours (E3): they are the
 * ones for which the published decode formula (sources 1.7) gives the input back. With bits as +-1,
 *     y[n] = 3 M0[n-2] - 6 M0[n-3] + 4 M0[n-4] + 9 (M1[n] - 2 M1[n-1] + M1[n-2])
 * is x[n-4] plus 9 (1 - z^-1)^4 times the error of the second quantiser, exactly. Full scale is 4/5 of the bits' own range:
 * 90 % of the bits are ones there (E2, sources 1.7). Steps of full scale at 106 % leave all states bounded. */
#ifndef PSABENCH_CHIP_ADS1282_MOD_H
#define PSABENCH_CHIP_ADS1282_MOD_H

#include "chip/ads1282/filter.h"

#include <stdbool.h>
#include <stdint.h>

#define ADS1282_MOD_DELAY 4                  /* clocks from x to y */
#define ADS1282_MOD_ONE   (INT64_C(5) << 32) /* the input that +1 bits alone would stand for: 5/4 full scales of 2^34 */
#define ADS1282_MOD_Y_MAX (3 + 6 + 4 + 9 * 4) /* of |y| */

struct ads1282_mod {
    int64_t first[2], second[2]; /* integrators of the loops */
    unsigned m0, m1;             /* bits of the last five clocks, bit 0 the newest */
};

/* Forgets the past. */
void ads1282_mod_clear(struct ads1282_mod *m);

/* One clock: input x of full scale 2^34, |x| <= 1.06 of it; the bits then are m->m0 & 1 and m->m1 & 1. */
void ads1282_mod_step(struct ads1282_mod *m, int64_t x);

/* n clocks at once, n <= ADS1282_MOD_RUN, and their bits through the decode formula into the integrators of c, which
 * ads1282_mod_start() has readied for those after the present clock and which do not pass the end of its block: what
 * ads1282_mod_step(), ads1282_mod_decode() and the integrators of ads1282_cic_take() make of them one by one. */
#define ADS1282_MOD_RUN 32u
void ads1282_mod_start(const struct ads1282_mod *m, struct ads1282_cic *c);
void ads1282_mod_run(struct ads1282_mod *m, struct ads1282_cic *c, const int64_t *x, unsigned n);

/* The same with bits that come from elsewhere, in place of those of the loops. A byte a clock: bit 0 is the level of M0, bit 1
 * that of M1; or, one_bit, bit 0 alone, which is the input itself, +-1 of the bits' range, four clocks late as y[n]. One
 * bit needs no ads1282_mod_start(). ads1282_mod_take() is one clock, into m alone. */
void ads1282_mod_take(struct ads1282_mod *m, uint8_t bits);
void ads1282_mod_play(struct ads1282_mod *m, struct ads1282_cic *c, const uint8_t *bits, unsigned n, bool one_bit);

/* The decode formula over the last five clocks: units in which full scale is 4/5. */
int32_t ads1282_mod_decode(const struct ads1282_mod *m);

#endif

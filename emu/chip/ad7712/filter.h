/* Signal path of the AD7712, pure: rates, sinc3, noise, code and calibration arithmetic.
 *
 * Fractions of full scale: x = gain * v / VREF. The filter is a sinc3 over N = code modulator periods of 512 tau, one output
 * each N periods. It is computed from a few looks at the input an output period, at the middle of equal cells, with weights
 * whose response is that of the sinc3 in the band and whose zeros lie at the multiples of the output rate, but for those that
 * are multiples of the looks' own rate too. Sources 3.2, 3.3, 3.5. */
#ifndef PSABENCH_CHIP_AD7712_FILTER_H
#define PSABENCH_CHIP_AD7712_FILTER_H

#include "chip/ad7712/cfg.h"

#include <stdbool.h>
#include <stdint.h>

enum {
    AD7712_SETTLE = 3, /* output periods from a start to the first settled word */
    AD7712_GAINS = 8
};

/* Filter code that the chip uses for FS11..0. */
unsigned ad7712_code_of(unsigned fs);

/* Output period in tau. */
static inline int64_t ad7712_period_tau(unsigned code)
{
    return (int64_t)code * AD7712_MOD_TAU;
}

/* Looks per output period; max: limit, 0 for none. */
unsigned ad7712_cells(unsigned code, unsigned max);

/* rms, input-referred, of AIN1: between the rows of the table a power of the rate, beyond them the nearest row's. */
double ad7712_noise_v(unsigned code, unsigned gain_log2);

/* Three output periods under way: each look counts in the newest of them, the middle and the oldest. */
struct ad7712_sinc3 {
    unsigned cells, code; /* looks per output period; filter code */
    unsigned i;           /* looks in the present one */
    double weight[3][AD7712_CELLS_MAX];
    double sum[3];
    double middle, oldest, oldest_next; /* what the next outputs have of the periods before */
    double out;                         /* the latest output */
};

void ad7712_sinc3_start(struct ad7712_sinc3 *f, unsigned code, unsigned cells);

/* Takes a look; true when it was the last of an output period, whose result is then in f->out. */
bool ad7712_sinc3_push(struct ad7712_sinc3 *f, double x);

/* n looks in a row, with the same result. */
void ad7712_sinc3_row(struct ad7712_sinc3 *f, const double *x, unsigned n);

/* Word of 24 bits for x; *clipped is set, never cleared. */
uint32_t ad7712_code(double x, uint32_t zero, uint32_t full, bool unipolar, bool *clipped);

/* What a calibration stores: the x of zero, and what makes full scale of the x of full scale. *clamped is set, never cleared. */
uint32_t ad7712_cal_zero(double x, bool *clamped);
uint32_t ad7712_cal_full(double x, uint32_t zero, bool *clamped);

#endif

#include "chip/ad7712/filter.h"

#include "base/bits.h"
#include "base/detmath.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#define CELLS_HZ   4000.0 /* looks a second at 10 MHz that leave no mains harmonic of note to the first alias */
#define NOMINAL_HZ (1e7 / AD7712_MOD_TAU)

/* Sources 3.5, gain 1 to 128; the last of a row represents those that are not printed. */
// clang-format off
static const struct noise_row {
    double notch_hz; /* at 10 MHz */
    double uv[AD7712_GAINS];
} noise[] = {
    {10,   {1.0,  .78,  .48, .33, .25, .25, .25, .25}},
    {25,   {1.8,  1.1,  .63, .5,  .44, .41, .38, .38}},
    {30,   {2.5,  1.31, .84, .57, .46, .43, .4,  .4}},
    {50,   {4.33, 2.06, 1.2, .64, .54, .46, .46, .46}},
    {60,   {5.28, 2.36, 1.33, .87, .63, .62, .6, .56}},
    {100,  {13,   6.4,  3.7, 1.8, 1.1, .9,  .65, .65}},
    {250,  {130,  75,   25,  12,  7.5, 4,   2.7, 1.7}},
    {500,  {600,  260,  140, 70,  35,  25,  15,  8}},
    {1000, {3100, 1600, 700, 290, 180, 120, 70,  40}},
};
// clang-format on

unsigned ad7712_code_of(unsigned fs)
{
    return fs < AD7712_FS_MIN ? AD7712_FS_MIN : fs > AD7712_FS_MAX ? AD7712_FS_MAX : fs;
}

unsigned ad7712_cells(unsigned code, unsigned max)
{
    unsigned cells = 4;
    while (cells < AD7712_CELLS_MAX && cells * NOMINAL_HZ / code < CELLS_HZ) cells *= 2;
    while (max && cells > max) cells /= 2;
    return cells;
}

double ad7712_noise_v(unsigned code, unsigned gain_log2)
{
    const double hz = NOMINAL_HZ / code;
    const unsigned rows = sizeof noise / sizeof *noise;
    unsigned i = 0;
    while (i < rows && noise[i].notch_hz <= hz) i++;
    if (i == 0 || i == rows) return noise[i ? i - 1 : 0].uv[gain_log2] * 1e-6;
    const struct noise_row *lo = &noise[i - 1], *hi = &noise[i];
    const double part = det_log(hz / lo->notch_hz) / det_log(hi->notch_hz / lo->notch_hz);
    return lo->uv[gain_log2] * 1e-6 * det_exp(part * det_log(hi->uv[gain_log2] / lo->uv[gain_log2]));
}

/* Three boxcars of M looks, one after the other, have the zeros. Between them and the sinc3 of N modulator periods is the
 * droop of a look's own cell, (M sin(x/M) / (N sin(x/N)))^3 with x = pi f / fout; three more weights c, 1 - 2c, c with
 * c = (1 - M^2/N^2) / 8 make it to second order. With M = N nothing is left to make. */
static void compute_weights(struct ad7712_sinc3 *f)
{
    const int m = (int)f->cells;
    const double ratio = (double)f->cells / f->code;
    const double c = (1.0 - ratio * ratio) / 8.0;
    double boxes[3 * AD7712_CELLS_MAX + 2] = {0.0}; /* of 3M - 2 looks, one in from both ends */
    for (int k = 0; k < 3 * m - 2; k++) {
        const int up = (k + 1) * (k + 2) / 2;
        const int down = k >= m ? 3 * (k - m + 1) * (k - m + 2) / 2 : 0;
        const int last = k >= 2 * m ? 3 * (k - 2 * m + 1) * (k - 2 * m + 2) / 2 : 0;
        boxes[k + 2] = (double)(up - down + last) / ((double)m * m * m);
    }
    for (int k = 0; k < 3 * m; k++) /* oldest first */
        f->weight[2 - k / m][k % m] = c * (boxes[k] + boxes[k + 2]) + (1.0 - 2.0 * c) * boxes[k + 1];
}

void ad7712_sinc3_start(struct ad7712_sinc3 *f, unsigned code, unsigned cells)
{
    assert(cells > 0 && cells <= AD7712_CELLS_MAX);
    if (f->code != code || f->cells != cells) {
        f->code = code;
        f->cells = cells;
        compute_weights(f);
    }
    f->i = 0;
    f->middle = f->oldest = f->oldest_next = f->out = 0.0;
    memset(f->sum, 0, sizeof f->sum);
}

static void shift_sums(struct ad7712_sinc3 *f)
{
    f->out = f->sum[0] + f->middle + f->oldest;
    f->middle = f->sum[1];
    f->oldest = f->oldest_next;
    f->oldest_next = f->sum[2];
    f->i = 0;
    f->sum[0] = f->sum[1] = f->sum[2] = 0.0;
}

bool ad7712_sinc3_push(struct ad7712_sinc3 *f, double x)
{
    for (unsigned k = 0; k < 3; k++) f->sum[k] += f->weight[k][f->i] * x;
    if (++f->i < f->cells) return false;
    shift_sums(f);
    return true;
}

void ad7712_sinc3_row(struct ad7712_sinc3 *f, const double *x, unsigned n)
{
    while (n > 0) {
        const unsigned left = f->cells - f->i, take = n < left ? n : left;
        const double *const w0 = f->weight[0] + f->i, *const w1 = f->weight[1] + f->i, *const w2 = f->weight[2] + f->i;
        double sum0 = f->sum[0], sum1 = f->sum[1], sum2 = f->sum[2];
        for (unsigned k = 0; k < take; k++) {
            sum0 += w0[k] * x[k];
            sum1 += w1[k] * x[k];
            sum2 += w2[k] * x[k];
        }
        f->sum[0] = sum0;
        f->sum[1] = sum1;
        f->sum[2] = sum2;
        f->i += take;
        if (f->i == f->cells) shift_sums(f);
        x += take;
        n -= take;
    }
}

#define COEF_LSB 4194304.0 /* 2^22 of a zero coefficient are full scale; so are 2^22 of a full one a factor of 1 */

uint32_t ad7712_code(double x, uint32_t zero, uint32_t full, bool unipolar, bool *clipped)
{
    const double zeroed = x - ((double)zero - AD7712_ZERO_IDEAL) / COEF_LSB;
    const double scaled = zeroed * ((double)full / COEF_LSB);
    const double code = unipolar ? 16777216.0 * scaled : 8388608.0 * (1.0 + scaled);
    return (uint32_t)bits_limit(nearbyint(code), 0.0, 16777215.0, clipped);
}

uint32_t ad7712_cal_zero(double x, bool *clamped)
{
    return (uint32_t)bits_limit(nearbyint(AD7712_ZERO_IDEAL + x * COEF_LSB), 0.0, 16777215.0, clamped);
}

/* A span of zero or less gives the upper end. */
uint32_t ad7712_cal_full(double x, uint32_t zero, bool *clamped)
{
    const double span = x - ((double)zero - AD7712_ZERO_IDEAL) / COEF_LSB;
    const double full = span > 0.0 ? nearbyint(COEF_LSB / span) : 16777216.0;
    return (uint32_t)bits_limit(full, 0.0, 16777215.0, clamped);
}

#include "chip/ads1282/filter.h"

#include "base/bits.h"

#include <assert.h>
#include <math.h>
#include <string.h>

/* Bits dropped after stages 1..4: the published scale, and 1 and 3 bits of word width after stages 3 and 4. */
static const unsigned fir_shift[ADS1282_FIR_STAGES] = {9, 23, 28, 30};

/* (m N + 4 choose 5) / N: the sum of the first m N samples of the impulse response of five integrators, over N. */
static int64_t ramp5(int64_t m, int64_t n)
{
    return m * (m * n + 1) * (m * n + 2) * (m * n + 3) * (m * n + 4) / 120;
}

/* Five combs, and a sixth difference between the ends of a block. */
static void compute_taps(unsigned sinc_ratio, int32_t tap[ADS1282_SINC_TAPS])
{
    static const int comb6[ADS1282_SINC_TAPS] = {1, -6, 15, -20, 15};
    for (int j = 0; j < ADS1282_SINC_TAPS; j++) {
        int64_t w = 0;
        for (int i = 0; i <= j; i++) w += comb6[i] * ramp5(j + 1 - i, sinc_ratio);
        tap[j] = (int32_t)w;
    }
}

/* Convolves g, of len entries, in place with taps spaced by step entries; returns the new length. */
static unsigned convolve_taps(double *g, unsigned len, const int32_t *tap, unsigned taps, unsigned step, double scale)
{
    for (unsigned n = len; n-- > 0;) {
        const double v = g[n] * scale;
        g[n] = 0.0;
        for (unsigned i = 0; i < taps; i++) g[n + i * step] += v * tap[i];
    }
    return len + (taps - 1) * step;
}

static double noise_gain(const struct ads1282_filter *f)
{
    double g[2048] = {1.0};
    const double n2 = (double)f->sinc_ratio * f->sinc_ratio;
    unsigned len = convolve_taps(g, 1, f->sinc_tap, ADS1282_SINC_TAPS, 1, 1.0 / (n2 * n2));
    unsigned step = 1;
    for (int s = 0; s < ADS1282_FIR_STAGES; s++) {
        const struct ads1282_fir *fir = &ads1282_fir[f->phase][s];
        len = convolve_taps(g, len, fir->tap, fir->taps, step, ldexp(1.0, -(int)fir->scale_log2));
        step *= fir->decim;
    }
    assert(len <= sizeof g / sizeof g[0] && step == ADS1282_BLOCKS);
    double power = 0.0;
    for (unsigned n = 0; n < len; n++) power += g[n] * g[n];
    return sqrt(power);
}

void ads1282_filter_init(struct ads1282_filter *f, unsigned sinc_ratio, enum ads1282_phase phase)
{
    assert(sinc_ratio >= 8 && sinc_ratio <= 128 && (sinc_ratio & (sinc_ratio - 1)) == 0);
    *f = (struct ads1282_filter){.sinc_ratio = sinc_ratio, .phase = phase};
    compute_taps(sinc_ratio, f->sinc_tap);
    f->noise_gain = noise_gain(f);
}

void ads1282_filter_clear(struct ads1282_filter *f)
{
    memset(f->sinc, 0, sizeof f->sinc);
    memset(f->fir1, 0, sizeof f->fir1);
    memset(f->fir2, 0, sizeof f->fir2);
    memset(f->fir3, 0, sizeof f->fir3);
    memset(f->fir4, 0, sizeof f->fir4);
}

double ads1282_filter_noise_gain(const struct ads1282_filter *f)
{
    return f->noise_gain;
}

/* The stages run over one data period. A line holds the taps - 1 newest samples of the past and then the new ones; x points
 * at the newest sample of an output. Sums of integers, in whatever order is cheap. */

static void shift_line(int64_t *line, unsigned fresh, unsigned taps)
{
    memmove(line, line + fresh, (taps - 1) * sizeof *line);
}

static void sinc_stage(struct ads1282_filter *f, const int64_t block[ADS1282_BLOCKS], int64_t out[ADS1282_BLOCKS])
{
    const int64_t t0 = f->sinc_tap[0], t1 = f->sinc_tap[1], t2 = f->sinc_tap[2], t3 = f->sinc_tap[3],
                  t4 = f->sinc_tap[4];
    const unsigned shift = 4 * bits_log2(f->sinc_ratio);
    const int64_t *x = f->sinc + ADS1282_SINC_TAPS - 1;
    memcpy(f->sinc + ADS1282_SINC_TAPS - 1, block, ADS1282_BLOCKS * sizeof *block);
    for (unsigned n = 0; n < 32; n++, x++)
        out[n] = bits_round_shift(t0 * x[0] + t1 * x[-1] + t2 * x[-2] + t3 * x[-3] + t4 * x[-4], shift);
    shift_line(f->sinc, 32, ADS1282_SINC_TAPS);
}

/* Half-band: symmetric, every second tap zero but the middle one. */
static void stage_1(const struct ads1282_fir *fir, int64_t *line, int64_t *out)
{
    const int64_t t0 = fir->tap[0], t2 = fir->tap[2], t4 = fir->tap[4], t5 = fir->tap[5];
    const int64_t *x = line + 11;
    for (unsigned n = 0; n < 16; n++, x += 2) {
        const int64_t sum = t0 * (x[0] + x[-10]) + t2 * (x[-2] + x[-8]) + t4 * (x[-4] + x[-6]) + t5 * x[-5];
        out[n] = bits_round_shift(sum, fir_shift[0]);
    }
    shift_line(line, 32, 11);
}

static void stage_2(const struct ads1282_fir *fir, int64_t *line, int64_t *out)
{
    const int64_t t0 = fir->tap[0], t2 = fir->tap[2], t4 = fir->tap[4], t6 = fir->tap[6], t7 = fir->tap[7];
    const int64_t *x = line + 15;
    for (unsigned n = 0; n < 8; n++, x += 2) {
        const int64_t sum =
            t0 * (x[0] + x[-14]) + t2 * (x[-2] + x[-12]) + t4 * (x[-4] + x[-10]) + t6 * (x[-6] + x[-8]) + t7 * x[-7];
        out[n] = bits_round_shift(sum, fir_shift[1]);
    }
    shift_line(line, 16, 15);
}

static int64_t dot_product(const int32_t *tap, unsigned taps, const int64_t *x)
{
    int64_t sum = 0;
    for (; taps >= 4; taps -= 4, tap += 4, x -= 4)
        sum += tap[0] * x[0] + tap[1] * x[-1] + tap[2] * x[-2] + tap[3] * x[-3];
    for (; taps > 0; taps--) sum += *tap++ * *x--;
    return sum;
}

static void decimate_stage(const struct ads1282_fir *fir, unsigned shift, int64_t *line, unsigned fresh, int64_t *out)
{
    for (unsigned end = fir->decim; end <= fresh; end += fir->decim)
        *out++ = bits_round_shift(dot_product(fir->tap, fir->taps, &line[fir->taps + end - 2]), shift);
    shift_line(line, fresh, fir->taps);
}

/* The data period's sinc outputs stand behind the past in f->fir1. */
static int64_t fir_stages(struct ads1282_filter *f)
{
    const struct ads1282_fir *fir = ads1282_fir[f->phase];
    int64_t out = 0;
    stage_1(&fir[0], f->fir1, f->fir2 + fir[1].taps - 1);
    stage_2(&fir[1], f->fir2, f->fir3 + fir[2].taps - 1);
    decimate_stage(&fir[2], fir_shift[2], f->fir3, 8, f->fir4 + fir[3].taps - 1);
    decimate_stage(&fir[3], fir_shift[3], f->fir4, 2, &out);
    return out;
}

int64_t ads1282_filter_fir(struct ads1282_filter *f, const int64_t sinc[ADS1282_BLOCKS])
{
    memcpy(f->fir1 + ads1282_fir[f->phase][0].taps - 1, sinc, ADS1282_BLOCKS * sizeof *sinc);
    return fir_stages(f);
}

int64_t ads1282_filter_period(struct ads1282_filter *f, const int64_t block[ADS1282_BLOCKS])
{
    sinc_stage(f, block, f->fir1 + ads1282_fir[f->phase][0].taps - 1);
    return fir_stages(f);
}

int64_t ads1282_correct(int64_t y_lsb, int32_t ofc, uint32_t fsc)
{
    return bits_round_shift((y_lsb - (int64_t)ofc * 128) * (int64_t)fsc, 22);
}

uint32_t ads1282_word(int64_t y_lsb, bool *clipped)
{
    const int64_t y = bits_clip(y_lsb, 31);
    *clipped = y != y_lsb;
    const uint32_t sign = y < 0;
    return ((uint32_t)y << 1) | (*clipped ? !sign : sign);
}

/* ---- Sinc5 at the modulator's rate ---- */

void ads1282_cic_init(struct ads1282_cic *c, unsigned ratio)
{
    *c = (struct ads1282_cic){.ratio = ratio};
}

bool ads1282_cic_take(struct ads1282_cic *c, int64_t x, int64_t *y)
{
    uint64_t sum = (uint64_t)x;
    for (int s = 0; s < 5; s++) sum = c->integrator[s] += sum;
    if (++c->n < c->ratio) return false;
    c->n = 0;
    for (int s = 0; s < 5; s++) {
        const uint64_t was = c->comb[s];
        c->comb[s] = sum;
        sum -= was;
    }
    memcpy(y, &sum, sizeof sum); /* two's complement, whatever the compiler makes of a cast */
    return true;
}

/* ---- High-pass ---- */

#define FRACTION 20 /* bits of the state below the LSB */
#define SPLIT    28 /* y d has up to 87 bits: taken in two parts */

void ads1282_hpf_clear(struct ads1282_hpf *h)
{
    *h = (struct ads1282_hpf){0, 0};
}

/* y d / 2^33, rounded to nearest, for |y| < 2^55 and 0 <= d <= 2^32. */
static int64_t fraction_of(int64_t y, int64_t d)
{
    const int64_t high = bits_round_shift(y - (INT64_C(1) << (SPLIT - 1)), SPLIT); /* floor */
    const int64_t low = y - high * (INT64_C(1) << SPLIT);
    const int64_t carry = (low * d + (INT64_C(1) << 32)) >> SPLIT; /* a half for the rounding */
    return bits_round_shift(high * d + carry - (1 << (33 - SPLIT - 1)), 33 - SPLIT);
}

int64_t ads1282_hpf_step(struct ads1282_hpf *h, int64_t x, uint16_t hpf)
{
    const int64_t g = 131072 - hpf;                     /* (2 - a)/2 in 2^-17 */
    const int64_t left = 65536 - hpf;                   /* 1 - a in 2^-16 */
    const int64_t d = (INT64_C(1) << 32) - left * left; /* 1 - b in 2^-33 */
    h->y += (x - h->x) * g * (1 << (FRACTION - 17)) - fraction_of(h->y, d);
    h->x = x;
    return bits_round_shift(h->y, FRACTION);
}

/* ---- Calibration ---- */

#define LOG2_READINGS 4
#define OFC_LSB       128 /* one count of OFC, in LSB of 2^-30 full scale */

bool ads1282_cal_take(struct ads1282_cal *c, int64_t y_lsb)
{
    c->sum += y_lsb;
    return --c->left == 0;
}

int32_t ads1282_cal_ofc(const struct ads1282_cal *c)
{
    return (int32_t)bits_clip(bits_round_shift(c->sum, LOG2_READINGS + 7), 24);
}

/* 400000h full scale / mean = 2^22 2^30 16 / sum. */
uint32_t ads1282_cal_fsc(const struct ads1282_cal *c, int32_t ofc)
{
    const int64_t sum = c->sum - (int64_t)ofc * OFC_LSB * ADS1282_CAL_READINGS;
    if (sum <= 0) return 0xFFFFFF;
    const int64_t fsc = ((INT64_C(1) << 56) + sum / 2) / sum;
    return fsc > 0xFFFFFF ? 0xFFFFFF : (uint32_t)fsc;
}

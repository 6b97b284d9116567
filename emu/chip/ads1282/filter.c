#include "chip/ads1282/filter.h"

#include "base/bits.h"
#include "chip/ads1282/decimate.h"

#include <assert.h>
#include <math.h>
#include <string.h>

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

/* The stage's taps as a window of samples meets them: oldest first. What the window leaves out is zero. */
static void turn_taps(const struct ads1282_fir *fir, int32_t *tap, unsigned window)
{
    for (unsigned i = window; i < fir->taps; i++) assert(fir->tap[i] == 0);
    for (unsigned i = 0; i < window; i++) tap[window - 1 - i] = i < fir->taps ? fir->tap[i] : 0;
}

void ads1282_filter_init(struct ads1282_filter *f, unsigned sinc_ratio, enum ads1282_phase phase)
{
    assert(sinc_ratio >= 8 && sinc_ratio <= 128 && (sinc_ratio & (sinc_ratio - 1)) == 0);
    *f = (struct ads1282_filter){.sinc_ratio = sinc_ratio, .phase = phase};
    compute_taps(sinc_ratio, f->sinc_tap);
    turn_taps(&ads1282_fir[phase][2], f->tap3, ADS1282_WINDOW_3);
    turn_taps(&ads1282_fir[phase][3], f->tap4, ADS1282_WINDOW_4);
    f->noise_gain = noise_gain(f);
    f->decimator = ads1282_decimator();
}

void ads1282_filter_clear(struct ads1282_filter *f)
{
    memset(f->sinc, 0, sizeof f->sinc);
    memset(f->odd1, 0, sizeof f->odd1);
    memset(f->even1, 0, sizeof f->even1);
    memset(f->odd2, 0, sizeof f->odd2);
    memset(f->even2, 0, sizeof f->even2);
    memset(f->fir3, 0, sizeof f->fir3);
    memset(f->fir4, 0, sizeof f->fir4);
    memset(f->high3, 0, sizeof f->high3);
    memset(f->high4, 0, sizeof f->high4);
    f->wandered = 0;
}

double ads1282_filter_noise_gain(const struct ads1282_filter *f)
{
    return f->noise_gain;
}

int64_t ads1282_filter_fir(struct ads1282_filter *f, const int64_t sinc[ADS1282_BLOCKS])
{
    return f->decimator->fir(f, sinc);
}

int64_t ads1282_filter_period(struct ads1282_filter *f, const int64_t block[ADS1282_BLOCKS])
{
    return f->decimator->period(f, block);
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
    c->n++;
    return ads1282_cic_output(c, y);
}

bool ads1282_cic_output(struct ads1282_cic *c, int64_t *y)
{
    if (c->n < c->ratio) return false;
    uint64_t sum = c->integrator[4];
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

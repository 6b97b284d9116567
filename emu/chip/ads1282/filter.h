/* Signal path of the ADS1281 / ADS1282 behind the modulator: sinc5, four FIR stages, high-pass, OFC/FSC,
 * output word, calibration.
 *
 * Bit-true in integers; pure but for the delay lines in the caller's struct; equal on every machine. The modulator is
 * ideal and its input is held over one sinc block (N modulator clocks), so that a block enters the fifth-order sinc as
 * five integer weights: exactly what the sinc at the modulator rate gives for the held input (proved by test).
 *
 * Word widths between the stages are not published; ours (E0) lose less than a quarter of the output's last bit and stay
 * inside int64 for any input up to ADS1282_SATURATION and, by the sums of the absolute weights, for any bits of a modulator.
 * Full scale in LSB: input block 2^34, after sinc, stages 1 and 2 2^34, after stage 3 2^33, output 2^30; each rounded to
 * nearest. Sources 1.7, 1.8. */
#ifndef PSABENCH_CHIP_ADS1282_FILTER_H
#define PSABENCH_CHIP_ADS1282_FILTER_H

#include "chip/ads1282/fir.h"

#include <stdbool.h>
#include <stdint.h>

#define ADS1282_BLOCKS       32u                /* sinc blocks in a data period: the stages decimate 2, 2, 4, 2 */
#define ADS1282_BLOCK_LOG2   34u                /* input full scale: 2^34 */
#define ADS1282_FS_LSB       (INT64_C(1) << 30) /* full scale of the 31-bit result */
#define ADS1282_SATURATION   1.06               /* of full scale; the modulator clips there (103..106 %, E1/M70) */
#define ADS1282_OVERSHOOT    3.1                /* output to input at most: above the sum of the absolute weights */
#define ADS1282_SINC_TAPS    5
#define ADS1282_WINDOW_3     52 /* samples that an output of stage 3 depends on, of stage 4: whole groups of four */
#define ADS1282_WINDOW_4     112
#define ADS1282_WANDER       8u
#define ADS1282_LINE_3       (ADS1282_WINDOW_3 + 4 + 8 * (ADS1282_WANDER - 1))
#define ADS1282_LINE_4       (ADS1282_WINDOW_4 + 2 * (ADS1282_WANDER - 1))
#define ADS1282_CAL_READINGS 16 /* M80 */

enum ads1282_phase { ADS1282_LINEAR, ADS1282_MINIMUM };

struct ads1282_decimator; /* how the stages are computed: decimate.h */

/* A delay line holds samples of the past, then those of the present data period. Stages 1 and 2, half-band filters, have
 * two: the samples at odd places, which all outer taps weigh, and those at even places for the middle one. */
struct ads1282_filter {
    unsigned sinc_ratio; /* N: 8, 16, 32, 64, 128 */
    enum ads1282_phase phase;
    /* The five weights of a held block, divided by N (they all are multiples of it); newest first; their sum is N^4. */
    int32_t sinc_tap[ADS1282_SINC_TAPS];
    double noise_gain;
    const struct ads1282_decimator *decimator;
    int32_t tap3[ADS1282_WINDOW_3 + 4], tap4[ADS1282_WINDOW_4]; /* of stages 3 and 4: oldest first, zeros at the ends */
    int64_t sinc[4 + 32], odd1[5 + 16], even1[2 + 16], odd2[7 + 8], even2[3 + 8];
    /* Windows of the last two stages; they wander up and begin again after ADS1282_WANDER periods. And x / 2^32 of the same
     * samples, rounded to nearest. */
    unsigned wandered;
    int64_t fir3[ADS1282_LINE_3], fir4[ADS1282_LINE_4];
    int32_t high3[ADS1282_LINE_3 + 4], high4[ADS1282_LINE_4];
};

/* Chooses the decimation and clears the past. */
void ads1282_filter_init(struct ads1282_filter *f, unsigned sinc_ratio, enum ads1282_phase phase);

/* Forgets the past, as a synchronisation does. */
void ads1282_filter_clear(struct ads1282_filter *f);

/* One data period: 32 blocks in, oldest first, one result out, in LSB of ADS1282_FS_LSB, not clipped. The result depends
 * on the last 1971 (linear) or 1963 (minimum phase) blocks, those given here included. */
int64_t ads1282_filter_period(struct ads1282_filter *f, const int64_t block[ADS1282_BLOCKS]);

/* Its second half in its place, and not mixed with it: the FIR stages alone, from 32 sinc outputs of full scale 2^34 got
 * elsewhere (the bit-true modulator). */
int64_t ads1282_filter_fir(struct ads1282_filter *f, const int64_t sinc[ADS1282_BLOCKS]);

/* Output rms for white input blocks of unit rms, both in units of full scale: sqrt of the sum of squares of the composite
 * impulse response of the exact chain. */
double ads1282_filter_noise_gain(const struct ads1282_filter *f);

/* Offset and gain correction, data sheet eq. 7: (y - OFC/2 LSB) FSC / 400000h, OFC in its own LSB of 2^-23 full scale,
 * rounded to nearest, not clipped. |y| < 2^33. */
int64_t ads1282_correct(int64_t y_lsb, int32_t ofc, uint32_t fsc);

/* Output word of the FIR modes: 31 bits left-justified, bit 0 repeats the sign unless clipped. */
uint32_t ads1282_word(int64_t y_lsb, bool *clipped);

/* Sinc5 at the modulator's rate: five integrators at CLK/4, decimation by N, five combs.
 *
 * Pure but for the state in the caller's struct; arithmetic modulo 2^64, as such filters are built: exact as long as the
 * output fits. Sources 1.8. */
struct ads1282_cic {
    unsigned ratio, n; /* N; samples taken since the last output */
    uint64_t integrator[5], comb[5];
};

void ads1282_cic_init(struct ads1282_cic *c, unsigned ratio); /* 8, 16, 32, 64, 128; clears the past */

/* One sample. True each N: *y is the output, of gain N^5; |x| N^5 < 2^63. */
bool ads1282_cic_take(struct ads1282_cic *c, int64_t x, int64_t *y);

/* Its second half, for who feeds the integrators otherwise and counts n. */
bool ads1282_cic_output(struct ads1282_cic *c, int64_t *y);

/* One-pole high-pass (FILTR = 11), the last filter of the chain. Sources 1.7.
 *
 * With a = HPF[1:0] / 65536: H(z) = (2 - a)/2 (1 - z^-1)/(1 - b z^-1), b = (1 + (1 - a)^2)/2; for a corner fHP the data
 * sheet gives a = 1 - sqrt(1 - 2c), c = (cos w + sin w - 1)/cos w, w = 2 pi fHP/fDATA. Both factors are whole numbers of
 * 2^-17 and 2^-33: the arithmetic here is exact but for one rounding a word to 2^-20 LSB (E0: the chip's own width is not
 * known). Pure but for the state. */
struct ads1282_hpf {
    int64_t x; /* last input */
    int64_t y; /* last output, in 2^-20 */
};

/* Forgets the past. */
void ads1282_hpf_clear(struct ads1282_hpf *h);

/* One word, |x| < 2^33; hpf is the register pair. Returns the output rounded to nearest. */
int64_t ads1282_hpf_step(struct ads1282_hpf *h, int64_t x, uint16_t hpf);

/* OFSCAL and GANCAL: the mean of sixteen readings becomes OFC or FSC. Sources 1.7. Pure. */
struct ads1282_cal {
    enum { ADS1282_CAL_NONE, ADS1282_CAL_OFFSET, ADS1282_CAL_GAIN } kind;
    unsigned left; /* readings still to come */
    int64_t sum;   /* of those taken, in LSB of 2^-30 full scale */
};

/* Takes a reading; true when it was the last. */
bool ads1282_cal_take(struct ads1282_cal *c, int64_t y_lsb);

/* OFC that makes the mean zero: 24 bits, saturating. */
int32_t ads1282_cal_ofc(const struct ads1282_cal *c);

/* FSC that makes the mean, less ofc, full scale: saturates at FFFFFFh, also where it would not be positive (E0). */
uint32_t ads1282_cal_fsc(const struct ads1282_cal *c, int32_t ofc);

#endif

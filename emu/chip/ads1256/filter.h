/* Signal path of the ADS1255/ADS1256, pure: rates, averaging, code and calibration arithmetic.
 *
 * A fixed sinc5 gives one word every 256 tau (tau = 1/fCLKIN); a data word is the mean of Navg of them. The input is taken
 * once per cell. Where a conversion is short (Navg <= 30) a cell is one sinc5 word and the sinc5 is the five-tap spline
 * below; where it is long, a cell is several words, the sinc5 is flat, and only the mean is left. All quantities are
 * fractions of full scale: x = PGA * Vin / (2 * VREF), raw = alpha * x. Sources 2.2, 2.7, 2.8. */
#ifndef PSABENCH_CHIP_ADS1256_FILTER_H
#define PSABENCH_CHIP_ADS1256_FILTER_H

#include <limits.h>
#include <stdbool.h>
#include <stdint.h>

enum {
    ADS1256_WORD_TAU = 256,   /* one sinc5 word */
    ADS1256_START_TAU = 1382, /* t18 less one data period: 0.18 ms at 7.68 MHz */
    ADS1256_PULSE_TAU = 16,   /* t17: DRDY high before an update */
    ADS1256_RATES = 16,
    ADS1256_GAINS = 7,    /* PGA 1, 2, 4 .. 64 */
    ADS1256_CAL_GAINS = 5 /* columns of the duration table: PGA 1, 2, 4, 8, 16..64 */
};

#define ADS1256_CODE_K 2250244.0 /* alpha * ideal FSC / 2^23, the same for every rate within the rounding of FSC */

struct ads1256_rate {
    uint8_t code;       /* DRATE */
    uint16_t navg;      /* words in a mean */
    uint8_t cell_words; /* words to one look at the input; 1: the sinc5 is computed */
    uint32_t alpha, fsc_ideal;
    double beta;                             /* as printed: FSC * beta = 2^23 */
    uint32_t selfgcal_us[ADS1256_CAL_GAINS]; /* at 7.68 MHz */
    uint32_t selfcal_us[ADS1256_CAL_GAINS];
    double noise_uv[ADS1256_GAINS]; /* rms, input-referred, buffer off, VREF 2.5 V */
};

enum ads1256_cal { ADS1256_SELFCAL, ADS1256_SELFOCAL, ADS1256_SELFGCAL, ADS1256_SYSOCAL, ADS1256_SYSGCAL };

/* In falling order of rate. */
extern const struct ads1256_rate ads1256_rates[ADS1256_RATES];

/* The row of a DRATE code, NULL for the 240 codes that the datasheet does not define. */
const struct ads1256_rate *ads1256_rate_of(uint8_t drate);

/* Log2 of the gain for ADCON's PGA code: 0..6, code 7 acts as 6. */
unsigned ads1256_gain_log2(uint8_t pga_code);

/* Durations in tau: data period, t18, and from the end of a calibration command to its DRDY. */
int64_t ads1256_period_tau(const struct ads1256_rate *r);
int64_t ads1256_settle_tau(const struct ads1256_rate *r);
int64_t ads1256_cal_tau(const struct ads1256_rate *r, enum ads1256_cal kind, unsigned gain_log2);

double ads1256_noise_v(const struct ads1256_rate *r, unsigned gain_log2);

/* Mean of a conversion in progress. */
struct ads1256_mean {
    unsigned cells;   /* in one conversion */
    int64_t half_tau; /* half a cell; 0: no whole number of tau */
    bool sinc5;       /* cells pass through the sinc5 first */
    double tap[5];    /* newest first */
    unsigned filled;  /* taps that hold cells of this run, 0..5 */
    unsigned words;   /* in the sum, 0 .. cells-1 */
    double sum;
    double out; /* the latest complete mean */
};

#define ADS1256_EVERY_WORD UINT_MAX /* as cells_max: a look a sinc5 word, which is computed, at any rate */

/* Starts afresh at rate r. cells_max limits the looks at the input where the sinc5 is not computed; 0: no limit. */
void ads1256_mean_start(struct ads1256_mean *m, const struct ads1256_rate *r, unsigned cells_max);

/* Goes over to rate r between two conversions, with the sinc5 as it is. Returns the number of the run's next cell. */
int64_t ads1256_mean_change(struct ads1256_mean *m, const struct ads1256_rate *r, unsigned cells_max);

/* Takes the cell x; a complete mean goes to m->out. */
void ads1256_mean_push(struct ads1256_mean *m, double x);

/* Instant of cell i (0, 1, ...) in tau after the start: the middle of the cell. The last one that a conversion needs comes
 * before its DRDY, so that the delay at DC is that of the filter, (Navg + 4) * 128 tau. */
int64_t ads1256_cell_tau(const struct ads1256_mean *m, const struct ads1256_rate *r, int64_t i);

/* clip24((raw - OFC) * FSC / K), rounded to nearest; *clipped is set, never cleared. */
int32_t ads1256_code(double raw, int32_t ofc, uint32_t fsc, bool *clipped);

/* What a calibration stores: OFC the raw of zero, FSC what makes full scale of the raw of full scale less OFC. Both stop at
 * the ends of their 24 bits; *clamped is set, never cleared. */
int32_t ads1256_cal_ofc(double raw_zero, bool *clamped);
uint32_t ads1256_cal_fsc(const struct ads1256_rate *r, double raw_span, bool *clamped);

#endif

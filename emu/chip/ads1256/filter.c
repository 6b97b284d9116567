#include "chip/ads1256/filter.h"

#include "base/bits.h"

#include <math.h>
#include <stddef.h>

#define ALL(us)                                                                                                        \
    {                                                                                                                  \
        us, us, us, us, us                                                                                             \
    }

/* Rows: sources 2.2 (Navg, alpha, beta, FSC), 2.7 (calibration), 2.8 (noise, G1 .. G64). */
// clang-format off
const struct ads1256_rate ads1256_rates[ADS1256_RATES] = {
    {0xF0,     1,  1, 0x400000, 0x44AC08, 1.8639, {417, 417, 451, 517, 651}, {596, 596, 692, 696, 892},
     {10.73, 6.71, 4.45, 3.28, 2.42, 1.79, 1.74}},
    {0xE0,     2,  1, 0x400000, 0x44AC08, 1.8639, {484, 484, 484, 551, 617}, {696, 696, 696, 762, 896},
     {9.07, 5.92, 3.96, 2.98, 2.13, 1.52, 1.52}},
    {0xD0,     4,  1, 0x400000, 0x44AC08, 1.8639, {617, 617, 617, 617, 751}, {896, 896, 896, 896, 1029},
     {7.25, 4.59, 3.15, 2.44, 1.69, 1.23, 1.19}},
    {0xC0,     8,  1, 0x400000, 0x44AC08, 1.8639, ALL(884),    ALL(1300),    {5.39, 3.46, 2.38, 1.87, 1.22, .91, .91}},
    {0xB0,    15,  1, 0x3C0000, 0x494008, 1.7474, ALL(1400),   ALL(2000),    {4.17, 2.59, 1.83, 1.49, .94, .69, .65}},
    {0xA1,    30,  1, 0x3C0000, 0x494008, 1.7474, ALL(2400),   ALL(3600),    {2.93, 1.89, 1.33, 1.07, .69, .51, .49}},
    {0x92,    60,  2, 0x3C0000, 0x494008, 1.7474, ALL(4500),   ALL(6600),    {1.95, 1.25, .63, .65, .50, .39, .37}},
    {0x82,   300, 30, 0x4B0000, 0x3A99A0, 2.1843, ALL(21000),  ALL(31200),   {.875, .589, .409, .305, .229, .170, .169}},
    {0x72,   500, 25, 0x3E8000, 0x4651F3, 1.8202, ALL(34100),  ALL(50900),   {.692, .438, .321, .233, .184, .146, .131}},
    {0x63,   600, 30, 0x4B0000, 0x3A99A0, 2.1843, ALL(41700),  ALL(61800),   {.629, .393, .292, .216, .168, .136, .122}},
    {0x53,  1000, 25, 0x3E8000, 0x4651F3, 1.8202, ALL(67800),  ALL(101300),  {.533, .335, .245, .176, .138, .104, .106}},
    {0x43,  1200, 30, 0x4B0000, 0x3A99A0, 2.1843, ALL(83000),  ALL(123200),  {.494, .305, .224, .149, .134, .102, .093}},
    {0x33,  2000, 25, 0x3E8000, 0x4651F3, 1.8202, ALL(135300), ALL(202100),  {.401, .264, .169, .126, .107, .085, .073}},
    {0x23,  3000, 30, 0x5DC000, 0x2EE14C, 2.7304, ALL(207000), ALL(307200),  {.339, .214, .138, .106, .082, .061, .061}},
    {0x13,  6000, 30, 0x5DC000, 0x2EE14C, 2.7304, ALL(413700), ALL(613800),  {.301, .175, .102, .076, .061, .045, .044}},
    {0x03, 12000, 30, 0x5DC000, 0x2EE14C, 2.7304, ALL(827000), ALL(1227200), {.247, .156, .080, .056, .043, .037, .033}},
};
// clang-format on

const struct ads1256_rate *ads1256_rate_of(uint8_t drate)
{
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        if (ads1256_rates[i].code == drate) return &ads1256_rates[i];
    }
    return NULL;
}

unsigned ads1256_gain_log2(uint8_t pga_code)
{
    return pga_code < ADS1256_GAINS ? pga_code : ADS1256_GAINS - 1;
}

int64_t ads1256_period_tau(const struct ads1256_rate *r)
{
    return (int64_t)r->navg * ADS1256_WORD_TAU;
}

int64_t ads1256_settle_tau(const struct ads1256_rate *r)
{
    return ADS1256_START_TAU + ads1256_period_tau(r);
}

static int64_t tau_of_us(uint32_t us)
{
    return ((int64_t)us * 768 + 50) / 100; /* at 7.68 MHz */
}

/* SELFOCAL and SYSOCAL are 0.32 ms (2458 tau) and two data periods in every printed row; SYSGCAL is SELFGCAL at PGA 1. */
int64_t ads1256_cal_tau(const struct ads1256_rate *r, enum ads1256_cal kind, unsigned gain_log2)
{
    const unsigned last = ADS1256_CAL_GAINS - 1;
    const unsigned column = kind == ADS1256_SYSGCAL ? 0 : gain_log2 < last ? gain_log2 : last;
    if (kind == ADS1256_SELFOCAL || kind == ADS1256_SYSOCAL) return 2458 + 2 * ads1256_period_tau(r);
    return tau_of_us(kind == ADS1256_SELFCAL ? r->selfcal_us[column] : r->selfgcal_us[column]);
}

double ads1256_noise_v(const struct ads1256_rate *r, unsigned gain_log2)
{
    return r->noise_uv[gain_log2] * 1e-6;
}

void ads1256_mean_start(struct ads1256_mean *m, const struct ads1256_rate *r, unsigned cells_max)
{
    const unsigned cell_words = cells_max == ADS1256_EVERY_WORD ? 1 : r->cell_words;
    const bool sinc5 = cell_words == 1;
    const unsigned cells = r->navg / cell_words;
    *m = (struct ads1256_mean){
        .cells = !sinc5 && cells_max && cells > cells_max ? cells_max : cells,
        .sinc5 = sinc5,
    };
    const int64_t period = ads1256_period_tau(r);
    m->half_tau = period % (2 * (int64_t)m->cells) ? 0 : period / (2 * (int64_t)m->cells);
}

/* Four cells of the sinc5 have gone by when the mean of a run begins; a mean without it has only its latest look. */
int64_t ads1256_mean_change(struct ads1256_mean *m, const struct ads1256_rate *r, unsigned cells_max)
{
    const struct ads1256_mean was = *m;
    ads1256_mean_start(m, r, cells_max);
    for (unsigned i = 0; i < 5; i++) m->tap[i] = was.tap[was.sinc5 ? i : 0];
    m->filled = 4;
    return m->sinc5 ? 4 : 0;
}

/* Five boxcars of one word each, seen at the middle of five cells: the quartic B-spline at half-integers. Its response
 * differs from the sinc5 by the aliases only, below 0.2 % up to the -3 dB point of the fastest rate. */
static double quartic_spline(const double tap[5])
{
    return (230.0 * tap[2] + 76.0 * (tap[1] + tap[3]) + (tap[0] + tap[4])) / 384.0;
}

void ads1256_mean_push(struct ads1256_mean *m, double x)
{
    if (m->sinc5) {
        for (unsigned i = 4; i > 0; i--) m->tap[i] = m->tap[i - 1];
        m->tap[0] = x;
        if (m->filled < 5 && ++m->filled < 5) return;
        x = quartic_spline(m->tap);
    } else {
        m->tap[0] = x;
    }
    m->sum += x;
    if (++m->words < m->cells) return;
    m->out = m->sum / m->cells;
    m->sum = 0.0;
    m->words = 0;
}

int64_t ads1256_cell_tau(const struct ads1256_mean *m, const struct ads1256_rate *r, int64_t i)
{
    /* A sinc5 run begins four cells earlier than a plain mean of the same centre begins, less half of that. */
    const int64_t lead = ADS1256_START_TAU - (m->sinc5 ? 4 : 2) * ADS1256_WORD_TAU;
    if (m->half_tau) return lead + (2 * i + 1) * m->half_tau; /* the same without division */
    const int64_t period = ads1256_period_tau(r);
    const int64_t n = i / m->cells;
    const int64_t in_period = i % m->cells;
    return lead + n * period + (2 * in_period + 1) * period / (2 * (int64_t)m->cells);
}

int32_t ads1256_code(double raw, int32_t ofc, uint32_t fsc, bool *clipped)
{
    return (int32_t)bits_limit(nearbyint((raw - ofc) * fsc / ADS1256_CODE_K), -8388608.0, 8388607.0, clipped);
}

int32_t ads1256_cal_ofc(double raw_zero, bool *clamped)
{
    return (int32_t)bits_limit(nearbyint(raw_zero), -8388608.0, 8388607.0, clamped);
}

/* 0/0 cannot be: alpha and the ideal FSC are no zeros, and a span of zero gives the upper end. */
uint32_t ads1256_cal_fsc(const struct ads1256_rate *r, double raw_span, bool *clamped)
{
    return (uint32_t)bits_limit(nearbyint((double)r->alpha * r->fsc_ideal / raw_span), 0.0, 16777215.0, clamped);
}

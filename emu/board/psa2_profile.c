#include "board/psa2_profile.h"

#include "base/clk.h"
#include "chip/ads1282.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define OFF(member) offsetof(struct psa2_profile, member)

// clang-format off
const struct psa2_field psa2_fields[] = {
    {"name",               PSA2_FIELD_STRING, OFF(name), 1, 31, "Name of the profile."},
    {"fclk_hz",            PSA2_FIELD_UINT, OFF(fclk_hz), 1e6, 4.096e6, "Crystal GOCh, clock of the accelerometer converters."},
    {"temp_clkin_hz",      PSA2_FIELD_UINT, OFF(temp_clkin_hz), 1e5, 1e7, "Clock of the temperature converter."},
    {"sclk_hz",            PSA2_FIELD_UINT, OFF(sclk_hz), 64e3, 2.048e6, "SClk of both serial ports."},
    {"line_hz",            PSA2_FIELD_UINT, OFF(line_hz), 1e5, 1e9, "The output CLK is line_hz / line_div."},
    {"line_div",           PSA2_FIELD_UINT, OFF(line_div), 1, 65536, "Divider of the output CLK."},
    {"word_bits",          PSA2_FIELD_UINT, OFF(word_bits), 16, 32, "Bits of an output word: 16, 24 or 32."},
    {"lead_in_clk",        PSA2_FIELD_UINT, OFF(lead_in_clk), 0, 255, "CLK periods from the fall of INT to the first bit."},
    {"word",               PSA2_FIELD_WORDS, OFF(word), 0, 3, "Order of the words X, Y, Z, T, lowest address first."},
    {"code_bits",          PSA2_FIELD_UINT, OFF(code_bits), 16, 32, "Significant bits of a code in its word: 16, 24 or 32."},
    {"read_bits",          PSA2_FIELD_UINT, OFF(read_bits), 24, 32, "SClk pulses of one accelerometer read: 24 or 32."},
    {"gate_sclk",          PSA2_FIELD_BOOL, OFF(gate_sclk), 0, 1, "SClk reaches only the group addressed."},
    {"temp_channels",      PSA2_FIELD_UINT, OFF(temp_channels), 0, 8, "Temperature inputs scanned in turn; 0: none."},
    {"adc_is_1281",        PSA2_FIELD_BOOL, OFF(adc_is_1281), 0, 1, "ADS1281 (no gain stage) instead of ADS1282."},
    {"adc_vref_v",         PSA2_FIELD_REAL, OFF(adc_vref_v), 0.5, 5.5, "Reference of the accelerometer converters."},
    {"adc_pga",            PSA2_FIELD_UINT, OFF(adc_pga), 1, 64, "Gain written to CONFIG1 after the article's set-up; 1: not written."},
    {"temp_vref_v",        PSA2_FIELD_REAL, OFF(temp_vref_v), 0.5, 5.5, "Reference of the temperature converter."},
    {"temp_sensor_a_per_k", PSA2_FIELD_REAL, OFF(temp_sensor_a_per_k), 0, 1e-3, "Current of a temperature sensor per kelvin of absolute temperature."},
    {"temp_load_ohm",      PSA2_FIELD_REAL, OFF(temp_load_ohm), 0, 1e6, "Load resistor RTD of a temperature sensor."},
    {"setup",              PSA2_FIELD_SETUP, OFF(setup), 1, PSA2_SETUP_MAX, "Transfers after Res, each on its data-ready event."},
};
// clang-format on
const unsigned psa2_field_count = sizeof psa2_fields / sizeof *psa2_fields;

struct psa2_profile psa2_profile_default(void)
{
    return (struct psa2_profile){
        .name = "article",
        .fclk_hz = 4096000,
        .temp_clkin_hz = 7680000,
        .sclk_hz = 1024000,
        .line_hz = 2000000,
        .line_div = 1,
        .word_bits = 32,
        .lead_in_clk = 8,
        .word = {PSA2_WORD_X, PSA2_WORD_Y, PSA2_WORD_Z, PSA2_WORD_T},
        .code_bits = 24,
        .read_bits = 24,
        .gate_sclk = true,
        .temp_channels = 4,
        .adc_vref_v = 5.0,
        .adc_pga = 2,
        .temp_vref_v = 2.5,
        .temp_sensor_a_per_k = 1e-6,
        .temp_load_ohm = 10e3,
        .setup = {{PSA2_ON_DRD_A, PSA2_WRITE_A, {0x41, 0x00, 0x56}, 3},
                  {PSA2_ON_DRD_T, PSA2_WRITE_T, {0x50, 0x00, 0x02}, 3},
                  {PSA2_ON_DRD_T, PSA2_WRITE_T, {0x50, 0x00, 0x04}, 3},
                  {PSA2_ON_DRD_T, PSA2_WRITE_T, {0x53, 0x00, 0x82}, 3},
                  {PSA2_ON_DRD_T, PSA2_SYNC_T, {0}, 0},
                  {PSA2_ON_DRD_A, PSA2_SYNC_A, {0}, 0}},
        .setup_count = 6,
    };
}

unsigned psa2_frame_clks(const struct psa2_profile *p)
{
    return p->lead_in_clk + PSA2_WORDS * p->word_bits + (PSA2_WORDS - 1) * PSA2_GAP_CLK;
}

static int64_t line_ns(const struct psa2_profile *p, unsigned clks)
{
    return clk_span_ns(p->line_hz, (int64_t)clks * p->line_div);
}

int64_t psa2_int_low_ns(const struct psa2_profile *p)
{
    return line_ns(p, psa2_frame_clks(p));
}

/* CONFIG0 after the set-up: the value it writes there last, else that of reset. */
static uint8_t config0_of(const struct psa2_profile *p)
{
    uint8_t config0 = 0x52;
    for (unsigned i = 0; i < p->setup_count; i++) {
        const struct psa2_setup_step *s = &p->setup[i];
        if (s->action == PSA2_WRITE_A && s->count >= 3 && s->bytes[0] == 0x41) config0 = s->bytes[2];
    }
    return config0;
}

/* DR is in bits 5..3 of CONFIG0, FILTR in bits 1..0 (sources 1.2). */
int64_t psa2_profile_period_ns(const struct psa2_profile *p)
{
    const uint8_t config0 = config0_of(p);
    const unsigned dr = config0 >> 3 & 7u;
    const unsigned fmod_periods = dr > 4 ? 256 : 4096u >> dr;
    const unsigned decimation = (config0 & 3) == 1 ? 32 : 1; /* sinc alone gives 32 times the words */
    return clk_span_ns(p->fclk_hz, 4 * (int64_t)fmod_periods / decimation);
}

/* Writes the sentence and is false, so that a check reads `return no(...)`. */
static bool no(char *why, size_t cap, const char *format, ...) __attribute__((format(printf, 3, 4)));
static bool no(char *why, size_t cap, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    if (cap > 0) (void)vsnprintf(why, cap, format, args);
    va_end(args);
    return false;
}

static double field_number(const struct psa2_profile *p, const struct psa2_field *f)
{
    const void *at = (const char *)p + f->offset;
    unsigned u;
    double d;
    if (f->type == PSA2_FIELD_REAL) {
        memcpy(&d, at, sizeof d);
        return d;
    }
    memcpy(&u, at, sizeof u);
    return u;
}

static bool check_ranges(const struct psa2_profile *p, char *why, size_t cap)
{
    if (!p->name[0]) return no(why, cap, "name is empty: give the profile a name of 1 to 31 characters");
    for (unsigned i = 0; i < psa2_field_count; i++) {
        const struct psa2_field *f = &psa2_fields[i];
        if (f->type != PSA2_FIELD_UINT && f->type != PSA2_FIELD_REAL) continue;
        const double v = field_number(p, f);
        if (!(v >= f->min && v <= f->max))
            return no(why, cap, "%s = %.10g is outside %.10g .. %.10g", f->key, v, f->min, f->max);
    }
    return true;
}

static bool is_width(unsigned bits)
{
    return bits == 16 || bits == 24 || bits == 32;
}

static bool check_words(const struct psa2_profile *p, char *why, size_t cap)
{
    if (!is_width(p->word_bits)) return no(why, cap, "word_bits = %u: use 16, 24 or 32", p->word_bits);
    if (!is_width(p->code_bits)) return no(why, cap, "code_bits = %u: use 16, 24 or 32", p->code_bits);
    if (p->read_bits != 24 && p->read_bits != 32) return no(why, cap, "read_bits = %u: use 24 or 32", p->read_bits);
    if (p->code_bits > p->word_bits)
        return no(why, cap, "code_bits = %u do not fit into word_bits = %u: use code_bits <= %u or longer words",
                  p->code_bits, p->word_bits, p->word_bits);
    if (p->code_bits > p->read_bits)
        return no(why, cap, "code_bits = %u but only read_bits = %u are read: use read_bits >= %u", p->code_bits,
                  p->read_bits, p->code_bits);
    unsigned seen = 0;
    for (unsigned i = 0; i < PSA2_WORDS; i++)
        if ((unsigned)p->word[i] < PSA2_WORDS) seen |= 1u << p->word[i];
    return seen == 0xF || no(why, cap, "word: each of X, Y, Z, T must be sent once");
}

static bool check_setup(const struct psa2_profile *p, char *why, size_t cap)
{
    if (p->setup_count == 0 || p->setup_count > PSA2_SETUP_MAX)
        return no(why, cap, "setup has %u steps: use 1 to %u", p->setup_count, PSA2_SETUP_MAX);
    for (unsigned i = 0; i < p->setup_count; i++) {
        const bool write = p->setup[i].action == PSA2_WRITE_A || p->setup[i].action == PSA2_WRITE_T;
        if (write != (p->setup[i].count > 0) || p->setup[i].count > sizeof p->setup[i].bytes)
            return no(why, cap, "setup step %u has %u bytes: a write has 1 to 8, a pulse none", i, p->setup[i].count);
    }
    return true;
}

static bool check_mode(const struct psa2_profile *p, char *why, size_t cap)
{
    const uint8_t config0 = config0_of(p);
    return ads1282_models(config0) ||
           no(why, cap, "setup: KPSA cannot read CONFIG0 = %02Xh: use pulse sync (bit 7 = 0), DR 000 to 100, FILTR 10",
              config0);
}

/* SClk limits: ADS128x period 2..16 tCLK (M75), ADS1256 period >= 4 tau (M90): sources 1.4, 2.4. */
static bool check_sclk(const struct psa2_profile *p, char *why, size_t cap)
{
    const uint32_t max_a = p->fclk_hz / 2;
    const uint32_t max_t = p->temp_clkin_hz / 4;
    if (p->sclk_hz > max_a)
        return no(why, cap, "sclk_hz = %u > fclk_hz / 2 = %u: use a slower SClk", p->sclk_hz, max_a);
    if (p->sclk_hz > max_t)
        return no(why, cap, "sclk_hz = %u > temp_clkin_hz / 4 = %u: use a slower SClk", p->sclk_hz, max_t);
    if (p->sclk_hz < p->fclk_hz / 16)
        return no(why, cap, "sclk_hz = %u < fclk_hz / 16 = %u: use a faster SClk", p->sclk_hz, p->fclk_hz / 16);
    return true;
}

static bool check_gain(const struct psa2_profile *p, char *why, size_t cap)
{
    if (p->adc_pga & (p->adc_pga - 1)) return no(why, cap, "adc_pga = %u: use 1, 2, 4, 8, 16, 32 or 64", p->adc_pga);
    if (p->adc_is_1281 && p->adc_pga != 1)
        return no(why, cap, "adc_pga = %u: the ADS1281 has no gain stage, use 1 or adc_is_1281: false", p->adc_pga);
    return true;
}

static double line_mhz(const struct psa2_profile *p)
{
    return 1e-6 * (double)p->line_hz / (double)p->line_div;
}

static bool check_int_low(const struct psa2_profile *p, char *why, size_t cap)
{
    const int64_t low_ns = psa2_int_low_ns(p);
    if (low_ns >= PSA2_INT_LOW_MIN_NS) return true;
    const unsigned data = psa2_frame_clks(p) - p->lead_in_clk;
    const int64_t one = (int64_t)p->line_div * 1000000000;
    const int64_t need = (PSA2_INT_LOW_MIN_NS * (int64_t)p->line_hz + one - 1) / one;
    const int64_t all = (int64_t)psa2_frame_clks(p) * 1000000000;
    const int64_t div = (PSA2_INT_LOW_MIN_NS * (int64_t)p->line_hz + all - 1) / all;
    return no(
        why, cap,
        "INT low = (%u + 4*%u + 3*%u) CLK / %.3f MHz = %.3f us < 74 us: use lead_in_clk >= %lld or line_div >= %lld",
        p->lead_in_clk, p->word_bits, PSA2_GAP_CLK, line_mhz(p), 1e-3 * (double)low_ns, (long long)(need - data),
        (long long)div);
}

static bool check_times(const struct psa2_profile *p, char *why, size_t cap)
{
    const int64_t word_ns = line_ns(p, p->word_bits);
    if (word_ns > PSA2_WORD_NS_MAX)
        return no(why, cap, "a word lasts %u CLK / %.3f MHz = %.3f us > %.0f us: use a faster CLK", p->word_bits,
                  line_mhz(p), 1e-3 * (double)word_ns, 1e-3 * PSA2_WORD_NS_MAX);
    /* From DRD_A: up to 2 SClk periods to the first edge, the bits, up to 1 CLK period to the grid of the line. */
    const int64_t read_ns = clk_span_ns(p->sclk_hz, p->read_bits + 2) + line_ns(p, 1);
    const int64_t low_ns = psa2_int_low_ns(p);
    const int64_t period_ns = psa2_profile_period_ns(p);
    return read_ns + low_ns <= period_ns ||
           no(why, cap,
              "reading %u bits at %.3f MHz (%.3f us) and INT low (%.3f us) make %.3f us > data period %.3f us: use "
              "a faster sclk_hz or CLK, or a lower data rate in setup",
              p->read_bits, 1e-6 * (double)p->sclk_hz, 1e-3 * (double)read_ns, 1e-3 * (double)low_ns,
              1e-3 * (double)(read_ns + low_ns), 1e-3 * (double)period_ns);
}

bool psa2_profile_check(const struct psa2_profile *p, char *why, size_t cap)
{
    return check_ranges(p, why, cap) && check_words(p, why, cap) && check_setup(p, why, cap) &&
           check_mode(p, why, cap) && check_sclk(p, why, cap) && check_gain(p, why, cap) &&
           check_int_low(p, why, cap) && check_times(p, why, cap);
}

#include "board/psa2/profile.h"

#include "base/clk.h"
#include "base/why.h"
#include "chip/ads1282/ads1282.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- fields: output words and steps of the set-up as text ---- */

static const char words[PSA2_WORDS + 1] = {
    [PSA2_WORD_X] = 'X', [PSA2_WORD_Y] = 'Y', [PSA2_WORD_Z] = 'Z', [PSA2_WORD_T] = 'T'};
static const char *const events[] = {[PSA2_ON_DRD_A] = "DRD_A", [PSA2_ON_DRD_T] = "DRD_T"};
static const char *const actions[] = {
    [PSA2_WRITE_A] = "write_A", [PSA2_WRITE_T] = "write_T", [PSA2_SYNC_A] = "sync_A", [PSA2_SYNC_T] = "sync_T"};

static bool parse_word(void *profile, unsigned i, const char *text)
{
    struct psa2_profile *p = profile;
    const char *at = text[0] && !text[1] ? strchr(words, text[0]) : NULL;
    if (at) p->word[i] = (enum psa2_word)(at - words);
    return at != NULL;
}

static bool word_text(const void *profile, unsigned i, char *out, size_t cap)
{
    const struct psa2_profile *p = profile;
    if (i >= PSA2_WORDS) return false;
    (void)snprintf(out, cap, "%c", words[p->word[i]]);
    return true;
}

static const char *skip_word(const char *text, const char *word)
{
    const size_t len = strlen(word);
    if (strncmp(text, word, len) != 0 || (text[len] && text[len] != ' ')) return NULL;
    for (text += len; *text == ' ';) text++;
    return text;
}

static bool parse_bytes(const char *text, struct psa2_setup_step *s)
{
    while (*text) {
        char *end;
        if (s->count == sizeof s->bytes || !isxdigit((unsigned char)*text)) return false;
        const unsigned long v = strtoul(text, &end, 16);
        if (v > 0xFF || end - text > 2 || (*end && *end != ' ')) return false;
        s->bytes[s->count++] = (uint8_t)v;
        for (text = end; *text == ' ';) text++;
    }
    return true;
}

/* "DRD_A write_A 41 00 56": event, action, bytes in hexadecimal. */
static bool parse_step(void *profile, unsigned i, const char *text)
{
    struct psa2_profile *p = profile;
    struct psa2_setup_step s = {.count = 0};
    const char *rest = NULL;
    for (unsigned k = 0; k < 2 && !rest; k++)
        if ((rest = skip_word(text, events[k]))) s.on = (enum psa2_setup_event)k;
    if (!rest) return false;
    text = rest;
    rest = NULL;
    for (unsigned k = 0; k < 4 && !rest; k++)
        if ((rest = skip_word(text, actions[k]))) s.action = (enum psa2_setup_action)k;
    if (!rest || !parse_bytes(rest, &s)) return false;
    if ((s.count > 0) != (s.action == PSA2_WRITE_A || s.action == PSA2_WRITE_T)) return false;
    p->setup[i] = s;
    p->setup_count = i + 1;
    return true;
}

static bool step_text(const void *profile, unsigned i, char *out, size_t cap)
{
    const struct psa2_profile *p = profile;
    const struct psa2_setup_step *s = &p->setup[i];
    if (i >= p->setup_count) return false;
    (void)snprintf(out, cap, "%s %s", events[s->on], actions[s->action]);
    for (unsigned k = 0; k < s->count; k++) {
        const size_t at = strlen(out);
        (void)snprintf(out + at, cap - at, " %02X", s->bytes[k]);
    }
    return true;
}

#define NAME(...) FIELD_NAME(struct psa2_profile, __VA_ARGS__)
#define ROW(...)  FIELD_ROW(struct psa2_profile, __VA_ARGS__)

#define THREE(member, lo, hi, words)                                                                                   \
    {                                                                                                                  \
        .key = #member, .type = FIELD_EACH, .offset = offsetof(struct psa2_profile, member), .min = (lo), .max = (hi), \
        .what = (words), .count = 3                                                                                    \
    }

// clang-format off
static const struct field rows[] = {
    NAME("article", "Name of the profile."),
    ROW(fclk_hz, U32, 4096000, 1e6, 4.1e6, "Crystal GOCh, clock of the accelerometer converters: 4.096 MHz at most by their data sheet, and the tolerance of a crystal above it."),
    ROW(temp_clkin_hz, U32, 7680000, 1e5, 1e7, "Clock of the temperature converter."),
    ROW(sclk_hz, U32, 1024000, 64e3, 2.048e6, "SClk of both serial ports."),
    ROW(line_hz, U32, 2000000, 1e5, 1e9, "The output CLK is line_hz / line_div."),
    ROW(line_div, U32, 1, 1, 65536, "Divider of the output CLK."),
    ROW(word_bits, U32, 32, 16, 32, "Bits of an output word: 16, 24 or 32."),
    ROW(lead_in_clk, U32, 8, 0, 255, "CLK periods from the fall of INT to the first bit."),
    {.key = "word", .type = FIELD_LIST, .offset = offsetof(struct psa2_profile, word), .min = 0, .max = 3, .what = "Order of the words X, Y, Z, T, lowest address first.",
     .count = PSA2_WORDS, .like = "one of X, Y, Z, T", .parse = parse_word, .text = word_text,
     .standard_of = (const char *const[]){"X", "Y", "Z", "T", NULL}},
    ROW(code_bits, U32, 24, 16, 32, "Significant bits of a code in its word: 16, 24 or 32."),
    THREE(line_delay_ns, 0, 500, "Delay of the pairs Int, Data, CLK from the driver's input to the receiver's output, for rises."),
    THREE(line_skew_ns, -100, 100, "By which falls of Int, Data, CLK come later there than rises; half a period of CLK at most."),
    ROW(read_bits, U32, 24, 24, 32, "SClk pulses of one accelerometer read: 24 or 32."),
    ROW(gate_sclk, BOOL, true, 0, 1, "SClk reaches only the group addressed."),
    ROW(temp_channels, U32, 4, 0, 8, "Temperature inputs scanned in turn; 0: none."),
    ROW(adc_is_1281, BOOL, false, 0, 1, "ADS1281 (no gain stage) instead of ADS1282."),
    ROW(adc_vref_v, REAL, 5.0, 0.5, 5.5, "Reference of the accelerometer converters."),
    THREE(common_mode_v, -2.5, 2.5, "Middle of the inputs of converter X, Y, Z over ground; 0: their range is not looked at."),
    ROW(adc_avss_v, REAL, -2.5, -2.625, 0, "Negative analog supply of the accelerometer converters."),
    ROW(adc_avdd_v, REAL, 2.5, 2.375, 5.25, "Their positive one, at most 5.25 V above it."),
    ROW(uref_ppm_per_pct, REAL, 0, -10000, 10000, "By how many ppm UREF of the accelerometer converters rises for each percent that the unit's supply is above its nominal voltage."),
    ROW(uref_dropout_ratio, REAL, 0, 0, 1, "Below this part of the nominal supply UREF falls in proportion to it; 0: never."),
    ROW(adc_pga, U32, 2, 1, 64, "Gain written to CONFIG1 after the article's set-up; 1: not written."),
    ROW(temp_vref_v, REAL, 2.5, 0.5, 5.5, "Reference of the temperature converter."),
    ROW(temp_sensor_a_per_k, REAL, 1e-6, 0, 1e-3, "Current of a temperature sensor per kelvin of absolute temperature."),
    ROW(temp_load_ohm, REAL, 10e3, 0, 1e6, "Load resistor RTD of a temperature sensor."),
    {.key = "setup", .type = FIELD_LIST, .offset = offsetof(struct psa2_profile, setup), .min = 1, .max = PSA2_SETUP_MAX, .what = "Transfers after Res, each on its data-ready event.",
     .like = "a step such as \"DRD_A write_A 41 00 56\" or \"DRD_T sync_T\"", .parse = parse_step, .text = step_text,
     .standard_of = (const char *const[]){"DRD_A write_A 41 00 56", "DRD_T write_T 50 00 02", "DRD_T write_T 50 00 04",
                                          "DRD_T write_T 53 00 82", "DRD_T sync_T", "DRD_A sync_A", NULL}},
};
const struct fields psa2_fields = FIELDS_OF(struct psa2_profile, rows);
// clang-format on

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
int64_t psa2_profile_period_ns(const void *profile)
{
    const struct psa2_profile *p = profile;
    const uint8_t config0 = config0_of(p);
    const unsigned dr = config0 >> 3 & 7u;
    const unsigned fmod_periods = dr > 4 ? 256 : 4096u >> dr;
    const unsigned decimation = (config0 & 3) == 1 ? 32 : 1; /* sinc alone gives 32 times the words */
    return clk_span_ns(p->fclk_hz, 4 * (int64_t)fmod_periods / decimation);
}

static bool is_width(unsigned bits)
{
    return bits == 16 || bits == 24 || bits == 32;
}

static bool check_words(const struct psa2_profile *p, char *why, size_t cap)
{
    if (!is_width(p->word_bits)) return why_fail(why, cap, "word_bits: expected 16, 24 or 32, got %u", p->word_bits);
    if (!is_width(p->code_bits)) return why_fail(why, cap, "code_bits: expected 16, 24 or 32, got %u", p->code_bits);
    if (p->read_bits != 24 && p->read_bits != 32)
        return why_fail(why, cap, "read_bits: expected 24 or 32, got %u", p->read_bits);
    if (p->code_bits > p->word_bits)
        return why_fail(why, cap, "code_bits: expected up to word_bits = %u, got %u", p->word_bits, p->code_bits);
    if (p->code_bits > p->read_bits)
        return why_fail(why, cap, "code_bits: expected up to read_bits = %u, got %u", p->read_bits, p->code_bits);
    unsigned seen = 0;
    for (unsigned i = 0; i < PSA2_WORDS; i++)
        if ((unsigned)p->word[i] < PSA2_WORDS) seen |= 1u << p->word[i];
    return seen == 0xF || why_fail(why, cap, "word: expected each of X, Y, Z, T once");
}

static bool check_setup(const struct psa2_profile *p, char *why, size_t cap)
{
    if (p->setup_count == 0 || p->setup_count > PSA2_SETUP_MAX)
        return why_fail(why, cap, "setup: expected 1 to %u steps, got %u", PSA2_SETUP_MAX, p->setup_count);
    for (unsigned i = 0; i < p->setup_count; i++) {
        const bool write = p->setup[i].action == PSA2_WRITE_A || p->setup[i].action == PSA2_WRITE_T;
        if (write != (p->setup[i].count > 0) || p->setup[i].count > sizeof p->setup[i].bytes)
            return why_fail(why, cap, "setup: step %u: expected 1 to 8 bytes of a write and none of a pulse, got %u", i,
                            p->setup[i].count);
    }
    return true;
}

static bool check_mode(const struct psa2_profile *p, char *why, size_t cap)
{
    const uint8_t config0 = config0_of(p);
    return ads1282_models(config0) || why_fail(why, cap,
                                               "setup: CONFIG0: expected pulse sync (bit 7 = 0), DR 000 to 100 and "
                                               "FILTR 10, which KPSA reads, got %02Xh",
                                               config0);
}

/* SClk limits: ADS128x period 2..16 tCLK (M75), ADS1256 period >= 4 tau (M90): sources 1.4, 2.4. */
static bool check_sclk(const struct psa2_profile *p, char *why, size_t cap)
{
    const uint32_t max_a = p->fclk_hz / 2;
    const uint32_t max_t = p->temp_clkin_hz / 4;
    if (p->sclk_hz > max_a)
        return why_fail(why, cap, "sclk_hz: expected up to fclk_hz / 2 = %u, got %u", max_a, p->sclk_hz);
    if (p->sclk_hz > max_t)
        return why_fail(why, cap, "sclk_hz: expected up to temp_clkin_hz / 4 = %u, got %u", max_t, p->sclk_hz);
    if (p->sclk_hz < p->fclk_hz / 16)
        return why_fail(why, cap, "sclk_hz: expected fclk_hz / 16 = %u or more, got %u", p->fclk_hz / 16, p->sclk_hz);
    return true;
}

static bool check_gain(const struct psa2_profile *p, char *why, size_t cap)
{
    if (p->adc_pga & (p->adc_pga - 1))
        return why_fail(why, cap, "adc_pga: expected 1, 2, 4, 8, 16, 32 or 64, got %u", p->adc_pga);
    if (p->adc_is_1281 && p->adc_pga != 1)
        return why_fail(why, cap, "adc_pga: expected 1 (the ADS1281 has no gain stage), or adc_is_1281: false, got %u",
                        p->adc_pga);
    return true;
}

static bool check_supplies(const struct psa2_profile *p, char *why, size_t cap)
{
    return p->adc_avdd_v - p->adc_avss_v <= PSA2_ANALOG_MAX_V ||
           why_fail(why, cap, "adc_avdd_v: expected up to %g V above adc_avss_v = %g, got %g", PSA2_ANALOG_MAX_V,
                    p->adc_avss_v, p->adc_avdd_v);
}

static double line_mhz(const struct psa2_profile *p)
{
    return 1e-6 * (double)p->line_hz / (double)p->line_div;
}

static bool check_int_low(const struct psa2_profile *p, char *why, size_t cap)
{
    const int64_t low_ns = psa2_int_low_ns(p);
    if ((low_ns + 1) * 1000000 >= PSA2_INT_LOW_MIN_NS * (1000000 - (int64_t)PSA2_CLOCK_PPM))
        return true; /* rounded down */
    const unsigned data = psa2_frame_clks(p) - p->lead_in_clk;
    const int64_t one = (int64_t)p->line_div * 1000000000;
    const int64_t need = (PSA2_INT_LOW_MIN_NS * (int64_t)p->line_hz + one - 1) / one;
    const int64_t all = (int64_t)psa2_frame_clks(p) * 1000000000;
    const int64_t div = (PSA2_INT_LOW_MIN_NS * (int64_t)p->line_hz + all - 1) / all;
    return why_fail(why, cap,
                    "INT low: expected 74 us or more (lead_in_clk >= %lld or line_div >= %lld), got (%u + 4*%u + 3*%u) "
                    "CLK / %.3f MHz "
                    "= %.3f us",
                    (long long)(need - data), (long long)div, p->lead_in_clk, p->word_bits, PSA2_GAP_CLK, line_mhz(p),
                    1e-3 * (double)low_ns);
}

static bool check_times(const struct psa2_profile *p, char *why, size_t cap)
{
    const int64_t word_ns = line_ns(p, p->word_bits);
    if (word_ns > PSA2_WORD_NS_MAX)
        return why_fail(why, cap, "word: expected up to %.0f us (a faster CLK), got %u CLK / %.3f MHz = %.3f us",
                        1e-3 * PSA2_WORD_NS_MAX, p->word_bits, line_mhz(p), 1e-3 * (double)word_ns);
    /* From DRD_A: up to 2 SClk periods to the first edge, the bits, up to 1 CLK period to the grid of the line. */
    const int64_t read_ns = clk_span_ns(p->sclk_hz, p->read_bits + 2) + line_ns(p, 1);
    const int64_t low_ns = psa2_int_low_ns(p);
    const int64_t period_ns = psa2_profile_period_ns(p);
    return read_ns + low_ns <= period_ns ||
           why_fail(why, cap,
                    "frame: expected up to the data period, %.3f us (a faster sclk_hz or CLK, or a lower data rate in "
                    "setup), got "
                    "%u bits at %.3f MHz (%.3f us) and INT low (%.3f us), %.3f us in all",
                    1e-3 * (double)period_ns, p->read_bits, 1e-6 * (double)p->sclk_hz, 1e-3 * (double)read_ns,
                    1e-3 * (double)low_ns, 1e-3 * (double)(read_ns + low_ns));
}

/* No delay is negative, no pulse of CLK is lost. */
static bool check_delays(const struct psa2_profile *p, char *why, size_t cap)
{
    const double half_ns = 0.5e3 / line_mhz(p);
    for (unsigned i = 0; i < PSA2_DELAYS; i++) {
        const double fall_ns = p->line_delay_ns[i] + p->line_skew_ns[i];
        if (fall_ns < 0.0)
            return why_fail(why, cap, "line_skew_ns: expected -line_delay_ns = %g or more, got %g",
                            0.0 - p->line_delay_ns[i], p->line_skew_ns[i]);
        if (p->line_skew_ns[i] >= half_ns || p->line_skew_ns[i] <= -half_ns)
            return why_fail(why, cap, "line_skew_ns: expected less than half a period of CLK = %g ns, got %g", half_ns,
                            p->line_skew_ns[i]);
    }
    return true;
}

bool psa2_profile_check(const void *profile, char *why, size_t cap)
{
    const struct psa2_profile *p = profile;
    return fields_check(&psa2_fields, p, why, cap) && check_words(p, why, cap) && check_setup(p, why, cap) &&
           check_mode(p, why, cap) && check_sclk(p, why, cap) && check_gain(p, why, cap) &&
           check_supplies(p, why, cap) && check_int_low(p, why, cap) && check_times(p, why, cap) &&
           check_delays(p, why, cap);
}

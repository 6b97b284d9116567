#include "board/psd1/profile.h"

#include "base/clk.h"

#include <stdio.h>

#define NAME(...) FIELD_NAME(struct psd1_profile, __VA_ARGS__)
#define ROW(...)  FIELD_ROW(struct psd1_profile, __VA_ARGS__)
#define PICK(...) FIELD_PICK(struct psd1_profile, __VA_ARGS__)

static const char *const parts[] = {"ad7712", "ad7710", "ad7711", NULL};
static const char *const polarities[] = {"high", "low", NULL};
static const char *const releases[] = {"fl2", "rfz", NULL};
static const char *const drs[] = {"x", "all", "any", NULL};
static const char *const int0s[] = {"auto", "host", NULL};

// clang-format off
static const struct field rows[] = {
    NAME("psd1", "Name of the profile."),
    PICK(part, PSD1_AD7712, parts, "Converters of the channels."),
    ROW(adc_clkin_hz, U32, 10000000, 8e6, 10e6, "Their clock; below 8 MHz TFS would rise too early after the last SCLK."),
    ROW(adc_vref_v, REAL, 2.5, 0.5, 5, "Reference of the converters."),
    ROW(adc_input, U32, 2, 1, 2, "Input of the converters: 1 is AIN1, 2 is AIN2."),
    ROW(adc_gain, U32, 1, 1, 128, "Gain of the converters: a power of two."),
    ROW(adc_fs, U32, 19, 19, 2000, "Their filter's code: a word every 512 code / adc_clkin_hz seconds."),
    PICK(dr, 0, drs, "Line DR: DRDY of converter X, low while all are low, or low while any is."),
    PICK(int0, 0, int0s, "INT0 and FL1: auto, active from the set-up on; host, by register FLAGS alone."),
    PICK(fl2, 0, polarities, "Active level of FL2."),
    PICK(a0_release, 0, releases, "A0 falls with the last FL2, or where RFZ rises."),
    ROW(rfs_access_ns, U32, 300, 1, 400, "From RFx to the first bit on SDAT; the part needs 4 of its clocks at most."),
    ROW(bit_access_ns, U32, 100, 10, 220, "From a fall of SCLK to the next bit on SDAT; the part needs 2 clocks and 20 ns at most."),
    ROW(drdy_rise_ns, U32, 100, 1, 110, "From the last fall of SCLK to DRDY high; the part needs a clock and 10 ns at most."),
    ROW(strobe_ns, U32, 800, 1, 1e8, "Default length of a strobe."),
    ROW(strobe_min_ns, U32, 200, 1, 1e6, "A shorter strobe is rejected."),
    ROW(host_strobe_ns, U32, 1000, 0, 1e8, "The built-in host reads a word this long after FL2; 0: there is no such host."),
    ROW(late_ns, U32, 20000, 0, 1e9, "A strobe that begins longer than this after FL2 is late."),
    ROW(reset_ns, U32, 100000, 1000, 1e8, "Time from power or reset to the first control word."),
    ROW(gyro_grid_ns, U32, 500000, 1000, 1e7, "Steps in which the laser gyros integrate."),
    ROW(gyro_arcsec_per_count, REAL, 1.0, 0.01, 1000, "Angle per count."),
    ROW(gyro_bias_sd_degph, REAL, 0.02, 0, 1000, "Standard deviation of a gyro's bias among specimens."),
    ROW(gyro_scale_sd_ppm, REAL, 5.0, 0, 1e4, "Standard deviation of the gyro's scale."),
    ROW(gyro_arw_deg_rth, REAL, 0.002, 0, 10, "Angular random walk of a gyro."),
    ROW(rate_dps_per_code, REAL, 0.02, 1e-6, 10, "Rate sensors: deg/s per code."),
    ROW(rate_offset_sd_dps, REAL, 0.02, 0, 10, "Standard deviation of the rate sensors' bias among specimens."),
    ROW(rate_scale_sd_ppm, REAL, 1000.0, 0, 1e5, "Standard deviation of the rate sensors' scale."),
    ROW(temp_k_per_code, REAL, 0.0625, 0.05, 10, "Thermometers: K per code."),
    ROW(temp_offset_sd_k, REAL, 0.2, 0, 10, "Standard deviation of the thermometers' offset among specimens."),
    ROW(service_v_per_code, REAL, 0.002, 1e-3, 1, "Service signals: V per code."),
    ROW(supply_v, REAL, 5.0, 0, 10, "Nominal supply of the board as the service signal shows it; with a supply in the scenario, at its volt_v."),
    ROW(supply_sd_v, REAL, 0.02, 0, 1, "Standard deviation of the supply signal's error among specimens."),
    ROW(vref_sd_ppm, REAL, 200.0, 0, 1e4, "Standard deviation of the reference's error among specimens."),
    ROW(vref_tc_sd_ppm_per_k, REAL, 3.0, 0, 1000, "Standard deviation of the reference's temperature coefficient."),
    ROW(adc_offset_sd_v, REAL, 1e-3, 0, 0.1, "Standard deviation of a converter's zero before calibration, at its input."),
    ROW(adc_gain_sd_ppm, REAL, 1000.0, 0, 1e5, "Standard deviation of the converter's gain."),
};
const struct fields psd1_fields = FIELDS_OF(struct psd1_profile, rows);
// clang-format on

static unsigned gain_log2(const struct psd1_profile *p)
{
    unsigned n = 0;
    while (n < 7 && 1u << n < p->adc_gain) n++;
    return n;
}

uint32_t psd1_profile_control(const struct psd1_profile *p, enum ad7712_md md)
{
    return AD7712_CONTROL(md, gain_log2(p), p->adc_input - 1, 0, 0, p->adc_fs);
}

int64_t psd1_profile_period_ns(const void *profile)
{
    const struct psd1_profile *p = profile;
    return clk_span_ns(p->adc_clkin_hz, ad7712_period_tau(p->adc_fs));
}

double psd1_profile_full_scale_v(const struct psd1_profile *p)
{
    const double divided = p->part == PSD1_AD7712 && p->adc_input == 2 ? 4.0 : 1.0;
    return divided * p->adc_vref_v / p->adc_gain;
}

bool psd1_profile_check(const void *profile, char *why, size_t cap)
{
    const struct psd1_profile *p = profile;
    if (!fields_check(&psd1_fields, profile, why, cap)) return false;
    const char *const no = 1u << gain_log2(p) != p->adc_gain ? "adc_gain: expected 1, 2, 4 ... 128"
                           : p->strobe_ns < p->strobe_min_ns ? "strobe_ns: expected strobe_min_ns or more"
                                                             : NULL;
    if (no && cap > 0) (void)snprintf(why, cap, "%s", no);
    return !no;
}

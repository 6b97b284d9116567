/* What is soldered, programmed or assumed on a PSD-1 board: one plain struct per board profile, from proto/profiles. What the
 * article leaves open is here, each with its evidence in docs/boards/psd1.md. Pure. */
#ifndef PSABENCH_BOARD_PSD1_PROFILE_H
#define PSABENCH_BOARD_PSD1_PROFILE_H

#include "board/field.h"
#include "chip/ad7712/ad7712.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define PSD1_PERIOD_NS 800 /* of 1M25: E1 */

enum psd1_part { PSD1_AD7712, PSD1_AD7710, PSD1_AD7711 };
enum psd1_polarity { PSD1_ACTIVE_HIGH, PSD1_ACTIVE_LOW };
enum psd1_a0_release { PSD1_A0_FL2, PSD1_A0_RFZ }; /* falls with the last FL2, or where RFZ rises */
enum psd1_dr { PSD1_DR_X, PSD1_DR_ALL, PSD1_DR_ANY };
enum psd1_int0 { PSD1_INT0_AUTO, PSD1_INT0_HOST };

struct psd1_profile {
    char name[32];
    /* converters */
    int part; /* enum psd1_part */
    uint32_t adc_clkin_hz;
    double adc_vref_v;
    unsigned adc_input; /* 1 or 2: AIN1, AIN2 */
    unsigned adc_gain;  /* 1 .. 128 */
    unsigned adc_fs;    /* code of the first notch: 19 .. 2000 */
    /* cycle */
    int dr, int0, fl2, a0_release; /* enums above */
    unsigned rfs_access_ns, bit_access_ns, drdy_rise_ns;
    unsigned strobe_ns, strobe_min_ns, host_strobe_ns, late_ns;
    unsigned reset_ns; /* from Res or power to the first control word */
    /* laser gyros, their rate sensors */
    unsigned gyro_grid_ns;
    double gyro_arcsec_per_count, gyro_bias_sd_degph, gyro_scale_sd_ppm, gyro_arw_deg_rth;
    double rate_dps_per_code, rate_offset_sd_dps, rate_scale_sd_ppm;
    /* thermometers, service signals */
    double temp_k_per_code, temp_offset_sd_k;
    double service_v_per_code, supply_v, supply_sd_v;
    /* reference of the converters, on this board */
    double vref_sd_ppm, vref_tc_sd_ppm_per_k;
    double adc_offset_sd_v, adc_gain_sd_ppm; /* before calibration */
};

extern const struct fields psd1_fields;

/* Control word of a mode: UC1 is that of self-calibration, UC2 the normal one (sources 3.2). */
uint32_t psd1_profile_control(const struct psd1_profile *p, enum ad7712_md md);

int64_t psd1_profile_period_ns(const void *profile); /* of the converters' words */

/* Full scale of the input, V: the words are offset binary of +- this. */
double psd1_profile_full_scale_v(const struct psd1_profile *p);

/* True if a board can run it; else a sentence in why that begins with the field. */
bool psd1_profile_check(const void *profile, char *why, size_t cap);

#endif

#include "board/pmka/profile.h"

#include "base/why.h"

#define AT(field) .offset = offsetof(struct pmka_profile, field)
#define NS(field, low, high, text)                                                                                     \
    {                                                                                                                  \
        .key = #field, .type = BOARD_FIELD_UINT, AT(field), .min = (low), .max = (high), .what = (text)                \
    }
#define COUNT(field, low, high, text) NS(field, low, high, text)
#define REAL(field, low, high, text)                                                                                   \
    {                                                                                                                  \
        .key = #field, .type = BOARD_FIELD_REAL, AT(field), .min = (low), .max = (high), .what = (text)                \
    }

static const char *const rotations[] = {"program", "autonomous", NULL};

// clang-format off
const struct board_field pmka_fields[PMKA_FIELDS] = {
    {.key = "name", .type = BOARD_FIELD_STRING, AT(name), .min = 1, .max = 31, .what = "name of the profile"},
    NS(ts_ns, 1000000, 20000000, "sample period Ts, even; a reset lasts half of it (article 3: 4.8 ms, E1)"),
    NS(mux_step_ns, 10000, 500000, "between the sampling instants of X, Y, Z and K, one converter serves all (E0)"),
    NS(hold_ns, 100, 100000, "time from the sampling instant to the start of conversion (E0)"),
    NS(convert_ns, 1000, 100000, "time from the sampling instant to the code (E0)"),
    NS(key_gap_ns, 1000, 100000, "keys move this long before and after K is sampled (E0)"),
    NS(start_ns, 1000, 1000000000, "from Res or power-up to the first sampling instant (E0)"),
    NS(strobe_ns, 10, 1000000, "default strobe of the parallel bus (E0)"),
    NS(strobe_min_ns, 10, 1000000, "shortest strobe that is answered (E0)"),
    REAL(uref_v, 1, 20, "UREF (article 3: 10 V, E1)"),
    REAL(r_in_ohm, 1e3, 1e6, "RIN (E3: twice Rr, so that (3) and (6) hold)"),
    REAL(rr_ohm, 1e3, 1e6, "Rr (article 3: 10 kohm, E1)"),
    REAL(cap_f, 1e-9, 1e-5, "CINT (article 3: 0.47 uF, E1)"),
    REAL(uc_v, 0.1, 20, "Uc of the comparators, both signs (E0: above Ur / 2 and below adc_range_v - Ur with +-20 % of CINT)"),
    REAL(limit_v, 1, 30, "output limit of the integrators' amplifiers (E0)"),
    REAL(adc_range_v, 1, 20, "of the converter, both signs, 2^15 codes each (article 3: 16 bits, E1; 10 V: E3, the printed quantum)"),
    REAL(reset_asymmetry_ppm, -2000, 2000, "Rr(-) over Rr(+), beside their tolerances (E0; that it is there: E1)"),
    REAL(cap_tol_sd, 0, 0.05, "CINT, relative (E0)"),
    REAL(cap_tc_ppm_per_k, -1000, 1000, "CINT (E0)"),
    REAL(cap_ageing_per_h, -0.5, 0.5, "CINT, relative to new, from power-on of the bench (E0; 0.2 in the test of drift)"),
    REAL(r_tol_sd_ppm, 0, 500, "each RIN and Rr (E0)"),
    REAL(r_tc_sd_ppm_per_k, 0, 10, "each RIN and Rr (E0)"),
    REAL(uref_tol_sd_ppm, 0, 500, "UREF (E0)"),
    REAL(uref_tc_sd_ppm_per_k, 0, 10, "UREF (E0)"),
    REAL(zero_sd_v, 0, 100e-6, "zero of an integrator, as if at its input (E0)"),
    REAL(zero_tc_sd_v_per_k, 0, 1e-6, "its temperature coefficient (E0)"),
    REAL(uc_sd_v, 0, 0.1, "each comparator (E0)"),
    REAL(adc_noise_lsb, 0, 10, "converter, rms; times the unit's adc_noise_scale (E0)"),
    REAL(adc_offset_sd_lsb, 0, 100, "converter (E0); cancels in increments"),
    REAL(adc_gain_sd_ppm, 0, 10000, "converter (E0); cancels against Nr"),
    REAL(temp_noise_k, 0, 10, "thermometer, rms; times the unit's temp_noise_scale (E0)"),
    REAL(temp_offset_sd_k, 0, 1, "thermometer (E0)"),
    REAL(rom_ct_sd_ppm, 0, 100, "error of CT as the factory measured it (E0), beside the ROM's resolution of 0.24 ppm"),
    {.key = "rotation", .type = BOARD_FIELD_CHOICE, AT(rotation), .choices = rotations,
     .what = "control of the calibration after Res: the computer's program (E1) or the board itself (E0)"},
    COUNT(beat_periods, 8, 60000, "length of a beat tau, in Ts (E0)"),
    COUNT(zero_periods, 1, 60000, "Ts of a beat with the input at ground, for the zero (E0)"),
};
// clang-format on

void pmka_profile_default(void *profile)
{
    *(struct pmka_profile *)profile = (struct pmka_profile){
        .name = "pmka",
        .ts_ns = 4800000,
        .mux_step_ns = 100000,
        .hold_ns = 2000,
        .convert_ns = 50000,
        .key_gap_ns = 20000,
        .start_ns = 10000000,
        .strobe_ns = 800,
        .strobe_min_ns = 200,
        .uref_v = 10.0,
        .r_in_ohm = 20e3,
        .rr_ohm = 10e3,
        .cap_f = 0.47e-6,
        .uc_v = 3.5,
        .limit_v = 12.0,
        .adc_range_v = 10.0,
        .reset_asymmetry_ppm = 200.0,
        .cap_tol_sd = 0.01,
        .cap_tc_ppm_per_k = -120.0,
        .cap_ageing_per_h = 0.0,
        .r_tol_sd_ppm = 100.0,
        .r_tc_sd_ppm_per_k = 1.0,
        .uref_tol_sd_ppm = 100.0,
        .uref_tc_sd_ppm_per_k = 1.0,
        .zero_sd_v = 50e-6,
        .zero_tc_sd_v_per_k = 0.5e-6,
        .uc_sd_v = 0.01,
        .adc_noise_lsb = 0.3,
        .adc_offset_sd_lsb = 2.0,
        .adc_gain_sd_ppm = 200.0,
        .temp_noise_k = 0.02,
        .temp_offset_sd_k = 0.05,
        .rom_ct_sd_ppm = 0.2,
        .rotation = PMKA_AUTONOMOUS,
        .beat_periods = 200,
        .zero_periods = 120,
    };
}

static bool check_time(const struct pmka_profile *p, char *why, size_t cap)
{
    if (p->ts_ns % 2)
        return why_fail(why, cap, "ts_ns: expected an even number (a reset lasts half of it), got %u", p->ts_ns);
    if (p->hold_ns >= p->convert_ns)
        return why_fail(why, cap, "hold_ns: expected less than convert_ns = %u, got %u", p->convert_ns, p->hold_ns);
    if (p->convert_ns > p->mux_step_ns)
        return why_fail(why, cap,
                        "convert_ns: expected up to mux_step_ns = %u, when the next integrator is sampled, got %u",
                        p->mux_step_ns, p->convert_ns);
    if (p->key_gap_ns >= p->convert_ns)
        return why_fail(
            why, cap, "key_gap_ns: expected less than convert_ns = %u (keys rest when the reading is complete), got %u",
            p->convert_ns, p->key_gap_ns);
    if (4.0 * p->mux_step_ns > 0.5 * p->ts_ns)
        return why_fail(why, cap, "mux_step_ns: expected up to a quarter of a reset of %.0f ns, got %u", 0.5 * p->ts_ns,
                        p->mux_step_ns);
    return p->strobe_ns >= p->strobe_min_ns ||
           why_fail(why, cap, "strobe_ns: expected strobe_min_ns = %u or more, got %u", p->strobe_min_ns, p->strobe_ns);
}

/* A reset that leads beyond the comparator of the other sign would cause one of that sign, endlessly. */
static bool check_reset(const struct pmka_profile *p, char *why, size_t cap)
{
    const double ur_v = p->uref_v * (0.5e-9 * p->ts_ns) / (p->rr_ohm * p->cap_f);
    const double ct = p->r_in_ohm / (2.0 * p->rr_ohm);
    if (p->uc_v * 2.0 <= ur_v)
        return why_fail(why, cap, "uc_v: expected more than half of a reset, Ur = %.3f V, got %.3f", ur_v, p->uc_v);
    if (p->uc_v + ur_v >= p->adc_range_v)
        return why_fail(why, cap,
                        "uc_v: expected a value that with Ur = %.3f V is within the converter's range, got %.3f", ur_v,
                        p->uc_v);
    return (ct > 0.997 && ct < 1.003) ||
           why_fail(why, cap, "r_in_ohm: expected RIN / (2 Rr) of 0.997 to 1.003 (CT in the ROM), got %.5f", ct);
}

static bool check_beat(const struct pmka_profile *p, char *why, size_t cap)
{
    return p->zero_periods + PMKA_BEAT_SPARE <= p->beat_periods ||
           why_fail(why, cap,
                    "zero_periods: expected up to beat_periods - 6 = %.0f (the resets are calibrated after it), got %u",
                    (double)p->beat_periods - PMKA_BEAT_SPARE, p->zero_periods);
}

bool pmka_profile_check(const void *profile, char *why, size_t cap)
{
    const struct pmka_profile *p = profile;
    return board_field_check(pmka_fields, PMKA_FIELDS, p, why, cap) && check_time(p, why, cap) &&
           check_reset(p, why, cap) && check_beat(p, why, cap);
}

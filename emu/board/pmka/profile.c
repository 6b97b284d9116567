#include "board/pmka/profile.h"

#include "base/why.h"

#define NAME(...) FIELD_NAME(struct pmka_profile, __VA_ARGS__)
#define ROW(...)  FIELD_ROW(struct pmka_profile, __VA_ARGS__)
#define PICK(...) FIELD_PICK(struct pmka_profile, __VA_ARGS__)

static const char *const rotations[] = {"program", "autonomous", NULL};

// clang-format off
static const struct field rows[] = {
    NAME("pmka", "name of the profile"),
    ROW(ts_ns, U32, 4800000, 1000000, 20000000, "sample period Ts, even; a reset lasts half of it (article 3: 4.8 ms, E1)"),
    ROW(mux_step_ns, U32, 100000, 10000, 500000, "between the sampling instants of X, Y, Z and K, one converter serves all (E0)"),
    ROW(hold_ns, U32, 2000, 100, 100000, "time from the sampling instant to the start of conversion (E0)"),
    ROW(convert_ns, U32, 50000, 1000, 100000, "time from the sampling instant to the code (E0)"),
    ROW(key_gap_ns, U32, 20000, 1000, 100000, "keys move this long before and after K is sampled (E0)"),
    ROW(start_ns, U32, 10000000, 1000, 1000000000, "from Res or power-up to the first sampling instant (E0)"),
    ROW(strobe_ns, U32, 800, 10, 1000000, "default strobe of the parallel bus (E0)"),
    ROW(strobe_min_ns, U32, 200, 10, 1000000, "shortest strobe that is answered (E0)"),
    ROW(uref_v, REAL, 10.0, 1, 20, "UREF (article 3: 10 V, E1)"),
    ROW(r_in_ohm, REAL, 20e3, 1e3, 1e6, "RIN (E3: twice Rr, so that (3) and (6) hold)"),
    ROW(rr_ohm, REAL, 10e3, 1e3, 1e6, "Rr (article 3: 10 kohm, E1)"),
    ROW(cap_f, REAL, 0.47e-6, 1e-9, 1e-5, "CINT (article 3: 0.47 uF, E1)"),
    ROW(uc_v, REAL, 3.5, 0.1, 20, "Uc of the comparators, both signs (E0: above Ur / 2 and below adc_range_v - Ur with +-20 % of CINT)"),
    ROW(limit_v, REAL, 12.0, 1, 30, "output limit of the integrators' amplifiers (E0)"),
    ROW(adc_range_v, REAL, 10.0, 1, 20, "of the converter, both signs, 2^15 codes each (article 3: 16 bits, E1; 10 V: E3, the printed quantum)"),
    ROW(reset_asymmetry_ppm, REAL, 200.0, -2000, 2000, "Rr(-) over Rr(+), beside their tolerances (E0; that it is there: E1)"),
    ROW(cap_tol_sd, REAL, 0.01, 0, 0.05, "CINT, relative (E0)"),
    ROW(cap_tc_ppm_per_k, REAL, -120.0, -1000, 1000, "CINT (E0)"),
    ROW(cap_ageing_per_h, REAL, 0.0, -0.5, 0.5, "CINT, relative to new, from power-on of the bench (E0; 0.2 in the test of drift)"),
    ROW(r_tol_sd_ppm, REAL, 100.0, 0, 500, "each RIN and Rr (E0)"),
    ROW(r_tc_sd_ppm_per_k, REAL, 1.0, 0, 10, "each RIN and Rr (E0)"),
    ROW(uref_tol_sd_ppm, REAL, 100.0, 0, 500, "UREF (E0)"),
    ROW(uref_tc_sd_ppm_per_k, REAL, 1.0, 0, 10, "UREF (E0)"),
    ROW(zero_sd_v, REAL, 50e-6, 0, 100e-6, "zero of an integrator, as if at its input (E0)"),
    ROW(zero_tc_sd_v_per_k, REAL, 0.5e-6, 0, 1e-6, "its temperature coefficient (E0)"),
    ROW(uc_sd_v, REAL, 0.01, 0, 0.1, "each comparator (E0)"),
    ROW(adc_noise_lsb, REAL, 0.3, 0, 10, "converter, rms; times the unit's adc_noise_scale (E0)"),
    ROW(adc_offset_sd_lsb, REAL, 2.0, 0, 100, "converter (E0); cancels in increments"),
    ROW(adc_gain_sd_ppm, REAL, 200.0, 0, 10000, "converter (E0); cancels against Nr"),
    ROW(temp_noise_k, REAL, 0.02, 0, 10, "thermometer, rms; times the unit's temp_noise_scale (E0)"),
    ROW(temp_offset_sd_k, REAL, 0.05, 0, 1, "thermometer (E0)"),
    ROW(rom_ct_sd_ppm, REAL, 0.2, 0, 100, "error of CT as the factory measured it (E0), beside the ROM's resolution of 0.24 ppm"),
    PICK(rotation, PMKA_AUTONOMOUS, rotations,
         "control of the calibration after Res: the computer's program (E1) or the board itself (E0)"),
    ROW(beat_periods, U32, 200, 8, 60000, "length of a beat tau, in Ts (E0)"),
    ROW(zero_periods, U32, 120, 1, 60000, "Ts of a beat with the input at ground, for the zero (E0)"),
};
const struct fields pmka_fields = FIELDS_OF(struct pmka_profile, rows);
// clang-format on

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
    return fields_check(&pmka_fields, p, why, cap) && check_time(p, why, cap) && check_reset(p, why, cap) &&
           check_beat(p, why, cap);
}

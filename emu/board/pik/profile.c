#include "board/pik/profile.h"

#include "base/why.h"

#define NAME(...) FIELD_NAME(struct pik_profile, __VA_ARGS__)
#define ROW(...)  FIELD_ROW(struct pik_profile, __VA_ARGS__)

// clang-format off
static const struct field rows[] = {
    NAME("pik", "Name of the profile."),
    ROW(uref_v, REAL, 10.0, 0.1, 100, "UREF, either sign: what the reset applies. E0 (10 V is PMKA's)."),
    ROW(rr_ohm, REAL, 10e3, 10, 1e8, "Rr, from UREF to the integrator. E0."),
    ROW(rin_ohm, REAL, 20e3, 10, 1e8, "RIN, from the input to the integrator. E0."),
    ROW(clock_hz, U32, 3480, 100, 1000000, "1/TCLK: a reset lasts one period. E0, K = Rr/(RIN UREF TCLK) is the article's."),
    ROW(grid, U32, 16, 1, 64, "Instants in TCLK at which a reset may begin: the control unit's faster clock. E0."),
    ROW(recovery_ticks, U32, 15, 0, 1024, "Rest of a reference after its reset, in TCLK/grid: 15 of 16 allow 3 % more than F at 10 V. E0."),
    ROW(switch_on_ns, REAL, 0, 0, 1e6, "Delay of switching the reference on. E0."),
    ROW(switch_off_ns, REAL, 0, 0, 1e6, "Delay of switching it off; only the difference enters the charge. E0."),
    ROW(input_off_ns, REAL, 0, 0, 1e6, "Time for which a reset disconnects the input; the article's does not. E0."),
    ROW(c_int_nf, REAL, 56.0, 0.01, 1e5, "Capacitor of the integrator; no count depends on it. E0."),
    ROW(uc_v, REAL, 3.75, 0.01, 100, "Uc, either sign: where a reset begins. E0."),
    ROW(rail_v, REAL, 12.0, 0.1, 200, "Limit of the integrator's output, either sign. E0."),
    ROW(ra_ohm, REAL, 735.0, 1, 1e6, "Ra, load of a sensor with current output, if the scenario gives none: 0.94 and 0.98 V/g of 1.28 mA/g. E0."),
    ROW(look_ticks, U32, 10, 1, 100000, "TCLK/grid between two samples of the model's input. E0."),
    ROW(latch_us, U32, 10000, 0, 1000000, "Period at which the counters are latched and sent; 0: only by strobe. E0."),
    ROW(strobe_ns, U32, 1000, 20, 1000000, "Default strobe length of a bus cycle. E0."),
    ROW(strobe_min_ns, U32, 200, 0, 1000000, "Shortest strobe that reads or writes. E0."),
    ROW(latch_ns, U32, 10000, 1, 1000000, "Length of the pulse on LATCH. E0."),
    ROW(k_error_pct, REAL, 0.15, 0, 10, "Error of the coefficient that a specimen keeps from -10 to 60 degC; 0: no limit. E1, range E0."),
    ROW(uref_tol_ppm, REAL, 300.0, 0, 1e5, "Standard deviation of UREF. E0."),
    ROW(uref_tc_ppm_per_k, REAL, 6.0, 0, 1e4, "Standard deviation of its temperature coefficient. E0."),
    ROW(ratio_tol_ppm, REAL, 250.0, 0, 1e5, "Standard deviation of Rr/RIN. E0."),
    ROW(ratio_tc_ppm_per_k, REAL, 5.0, 0, 1e4, "Standard deviation of its temperature coefficient. E0."),
    ROW(asymmetry_ppm, REAL, 60.0, 0, 1e5, "Standard deviation of half the difference of the two signs. E0."),
    ROW(clock_tol_ppm, REAL, 20.0, 0, 1000, "Standard deviation of the crystal. E0."),
    ROW(c_tol_pct, REAL, 3.0, 0, 20, "Standard deviation of the capacitor. E0."),
    ROW(c_tc_ppm_per_k, REAL, 100.0, 0, 1e4, "Temperature coefficient of the capacitor. E0."),
    ROW(zero_v, REAL, 200e-6, 0, 1, "Standard deviation of the zero drift, at the input. E0."),
    ROW(zero_tc_v_per_k, REAL, 5e-6, 0, 0.01, "Standard deviation of its temperature coefficient. E0."),
    ROW(noise_v_rthz, REAL, 5e-6, 0, 1, "White noise of the integrator, at the input, one-sided. E0."),
    ROW(saturated_ms, REAL, 100.0, 0, 1e5, "Time without saturation after which its flag and EMCY end. E0."),
};
const struct fields pik_fields = FIELDS_OF(struct pik_profile, rows);
// clang-format on

double pik_profile_k_hz_per_v(const struct pik_profile *p)
{
    return p->rr_ohm / (p->rin_ohm * p->uref_v) * p->clock_hz;
}

double pik_profile_quantum_vs(const struct pik_profile *p)
{
    return 1.0 / pik_profile_k_hz_per_v(p);
}

double pik_profile_limit_hz(const struct pik_profile *p)
{
    return (double)p->clock_hz * p->grid / (p->grid + p->recovery_ticks);
}

double pik_profile_step_v(const struct pik_profile *p)
{
    return p->uref_v / (p->rr_ohm * p->c_int_nf * 1e-9 * p->clock_hz);
}

int64_t pik_profile_period_ns(const void *profile)
{
    const struct pik_profile *p = profile;
    return (int64_t)p->latch_us * 1000;
}

/* Below half a pulse a reset ends beyond the other threshold and causes the opposite one, endlessly. */
static bool check_integrator(const struct pik_profile *p, char *why, size_t cap)
{
    const double step_v = pik_profile_step_v(p);
    if (p->uc_v < 0.505 * step_v)
        return why_fail(
            why, cap,
            "uc_v: expected %.3f V or more (a reset moves the integrator by %.3f V and would cause the opposite one), "
            "got %g",
            0.505 * step_v, step_v, p->uc_v);
    if (p->rail_v < p->uc_v + 1.05 * step_v)
        return why_fail(
            why, cap,
            "rail_v: expected more than Uc = %g V and a step of %.3f V (else saturation is not detected), got %g",
            p->uc_v, step_v, p->rail_v);
    if (p->rail_v > 16.0 * step_v)
        return why_fail(why, cap, "rail_v: expected 16 steps of %.3f V at most, got %g", step_v, p->rail_v);
    return true;
}

static bool check_time(const struct pik_profile *p, char *why, size_t cap)
{
    const double tclk_ns = 1e9 / p->clock_hz;
    if ((double)p->clock_hz * p->grid > 990e3)
        return why_fail(why, cap, "grid: expected 990000 instants a second at most, got %u in each of %u periods",
                        p->grid, p->clock_hz);
    if (p->clock_hz * p->grid > PIK_LOOKS_HZ_MAX * (double)p->look_ticks)
        return why_fail(why, cap, "look_ticks: expected %u samples of the input a second at most, got more with %u",
                        PIK_LOOKS_HZ_MAX, p->look_ticks);
    if ((p->look_ticks - 1) * tclk_ns / p->grid > PIK_LATE_NS_MAX)
        return why_fail(why, cap, "look_ticks: expected pulses %.0f us late at most, got %.0f us with %u",
                        PIK_LATE_NS_MAX * 1e-3, (p->look_ticks - 1) * tclk_ns / p->grid * 1e-3, p->look_ticks);
    if (p->switch_on_ns >= tclk_ns)
        return why_fail(why, cap, "switch_on_ns: expected less than the reset, %.0f ns, got %g", tclk_ns,
                        p->switch_on_ns);
    if (p->switch_off_ns >= tclk_ns)
        return why_fail(why, cap, "switch_off_ns: expected less than the reset, %.0f ns, got %g", tclk_ns,
                        p->switch_off_ns);
    if (p->input_off_ns > tclk_ns)
        return why_fail(why, cap, "input_off_ns: expected up to the reset, %.0f ns, got %g", tclk_ns, p->input_off_ns);
    return true;
}

/* An increment has 16 bits, and a period longer than what it takes in them would wrap unseen. */
static bool check_reading(const struct pik_profile *p, char *why, size_t cap)
{
    if (p->latch_us > 0 && p->latch_us < 200)
        return why_fail(why, cap, "latch_us: expected 0 or at least 200, got %u", p->latch_us);
    if (p->latch_us * 1e-6 * pik_profile_limit_hz(p) > 32767.0)
        return why_fail(why, cap,
                        "latch_us: expected a period whose pulses fit into 16 bits, got up to %.0f pulses in %u us",
                        p->latch_us * 1e-6 * pik_profile_limit_hz(p), p->latch_us);
    if (p->latch_us > 0 && p->latch_ns >= p->latch_us * 1000.0)
        return why_fail(why, cap, "latch_ns: expected less than the period, got %u", p->latch_ns);
    if (p->strobe_ns < p->strobe_min_ns)
        return why_fail(why, cap, "strobe_ns: expected strobe_min_ns = %u or more, got %u", p->strobe_min_ns,
                        p->strobe_ns);
    return true;
}

bool pik_profile_check(const void *profile, char *why, size_t cap)
{
    const struct pik_profile *p = profile;
    const double k = pik_profile_k_hz_per_v(p);
    if (!fields_check(&pik_fields, p, why, cap)) return false;
    if (k > 20e3 || k < 1.0)
        return why_fail(why, cap, "rr_ohm: expected K = Rr/(RIN UREF TCLK) of 1 to 20000 Hz/V, got %g Hz/V with %g", k,
                        p->rr_ohm);
    return check_integrator(p, why, cap) && check_time(p, why, cap) && check_reading(p, why, cap);
}

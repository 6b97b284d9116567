/* What a specimen of the profile is off by, and what becomes of it at a temperature. */
#include "board/pik/internal.h"

#include <math.h>

#define NOMINAL_DEGC 25.0
#define CUT_SIGMA    3.0 /* no part is off by more */

static double draw_value(uint64_t seed, uint32_t serial, const char *source, double sd)
{
    struct rng r = rng_stream(seed, serial, source);
    const double z = rng_gauss(&r);
    return sd * (z > CUT_SIGMA ? CUT_SIGMA : z < -CUT_SIGMA ? -CUT_SIGMA : z);
}

static void draw_axes(uint64_t seed, uint32_t serial, const char *const source[PIK_AXES], double sd,
                      double out[PIK_AXES])
{
    for (unsigned i = 0; i < PIK_AXES; i++) out[i] = draw_value(seed, serial, source[i], sd);
}

#define AXES(name)                                                                                                     \
    (const char *const[PIK_AXES])                                                                                      \
    {                                                                                                                  \
        "pik." name ".x", "pik." name ".y", "pik." name ".z"                                                           \
    }

/* Error of the coefficient at worst, ppm. */
static double worst_ppm(const struct pik_specimen *s)
{
    double worst = 0.0;
    for (unsigned i = 0; i < PIK_AXES; i++) {
        const double ppm = fabs(s->ratio_ppm[i] - s->uref_ppm + s->clock_ppm) + fabs(s->asymmetry_ppm[i]) +
                           PIK_SPAN_K * fabs(s->ratio_tc[i] - s->uref_tc);
        if (ppm > worst) worst = ppm;
    }
    return worst;
}

/* A unit that would not keep the article's error does not leave the factory: its parts are selected, here brought nearer. */
static void select_parts(struct pik_specimen *s, double limit_ppm)
{
    const double bound_ppm = limit_ppm * (1.0 - 2e-6 * limit_ppm); /* errors multiply, their sum is the first order */
    const double worst = worst_ppm(s);
    if (limit_ppm <= 0.0 || worst <= bound_ppm) return;
    const double keep = bound_ppm / worst;
    s->uref_ppm *= keep;
    s->uref_tc *= keep;
    s->clock_ppm *= keep;
    for (unsigned i = 0; i < PIK_AXES; i++) {
        s->ratio_ppm[i] *= keep;
        s->ratio_tc[i] *= keep;
        s->asymmetry_ppm[i] *= keep;
    }
}

struct pik_specimen pik_specimen_draw(const struct pik_profile *p, uint64_t seed, uint32_t serial)
{
    struct pik_specimen s = {.uref_ppm = draw_value(seed, serial, "pik.uref", p->uref_tol_ppm),
                             .uref_tc = draw_value(seed, serial, "pik.uref_tc", p->uref_tc_ppm_per_k),
                             .clock_ppm = draw_value(seed, serial, "pik.clock", p->clock_tol_ppm)};
    draw_axes(seed, serial, AXES("ratio"), p->ratio_tol_ppm, s.ratio_ppm);
    draw_axes(seed, serial, AXES("ratio_tc"), p->ratio_tc_ppm_per_k, s.ratio_tc);
    draw_axes(seed, serial, AXES("asymmetry"), p->asymmetry_ppm, s.asymmetry_ppm);
    draw_axes(seed, serial, AXES("c"), p->c_tol_pct, s.c_pct);
    draw_axes(seed, serial, AXES("zero"), p->zero_v, s.zero_v);
    draw_axes(seed, serial, AXES("zero_tc"), p->zero_tc_v_per_k, s.zero_tc);
    select_parts(&s, p->k_error_pct * 1e4);
    return s;
}

int64_t pik_tick_hz(const struct pik *b)
{
    const double ppm = b->specimen.clock_ppm + b->clock_fault_ppm;
    return (int64_t)((double)b->profile.clock_hz * b->profile.grid * 1000.0 * (1.0 + 1e-6 * ppm) + 0.5);
}

/* Charge of a reset in nominal pulses: UREF for as long as it is switched on, through Rr, referred to RIN. */
static double reset_weight(const struct pik *b, unsigned axis, int sign, double degc)
{
    const struct pik_profile *p = &b->profile;
    const struct pik_specimen *s = &b->specimen;
    const double dt_k = degc - NOMINAL_DEGC;
    const double uref = 1.0 + 1e-6 * (s->uref_ppm + s->uref_tc * dt_k - sign * s->asymmetry_ppm[axis]);
    const double ratio = 1.0 + 1e-6 * (s->ratio_ppm[axis] + s->ratio_tc[axis] * dt_k);
    const double tclk_s = p->grid * 1000.0 / (double)pik_tick_hz(b);
    return uref / ratio * (tclk_s + (p->switch_off_ns - p->switch_on_ns) * 1e-9) * p->clock_hz;
}

double pik_true_k_hz_per_v(const struct pik *b, unsigned axis, int sign, double degc)
{
    return pik_profile_k_hz_per_v(&b->profile) / reset_weight(b, axis, sign, degc);
}

static int64_t to_charge(double pulses)
{
    return (int64_t)(pulses * (double)PIK_PULSE + 0.5); /* positive */
}

void pik_warm(struct pik *b, double degc)
{
    const struct pik_profile *p = &b->profile;
    const double dt_k = degc - NOMINAL_DEGC;
    const double k_hz_per_v = pik_profile_k_hz_per_v(p), step_v = pik_profile_step_v(p);
    b->degc = degc;
    b->k_hz_per_v = k_hz_per_v;
    b->noise_v = p->noise_v_rthz * b->base.cfg.adc_noise_scale *
                 sqrt(0.5e-3 * (double)pik_tick_hz(b) / p->look_ticks); /* white, over a look */
    for (unsigned i = 0; i < PIK_AXES; i++) {
        struct pik_channel *c = &b->channel[i];
        const double c_int = (1.0 + 1e-2 * b->specimen.c_pct[i]) * (1.0 + 1e-6 * p->c_tc_ppm_per_k * dt_k);
        c->drive = (struct pik_drive){.plus = to_charge(reset_weight(b, i, 1, degc)),
                                      .minus = to_charge(reset_weight(b, i, -1, degc)),
                                      .threshold = to_charge(p->uc_v / step_v * c_int),
                                      .rail = to_charge(p->rail_v / step_v * c_int),
                                      .pulse_ticks = p->grid,
                                      .recovery_ticks = p->recovery_ticks};
        c->per_volt = k_hz_per_v * 1000.0 / (double)pik_tick_hz(b) * (double)PIK_PULSE;
        c->lost_per_volt = k_hz_per_v * p->input_off_ns * 1e-9 * (double)PIK_PULSE;
        c->zero_v = b->specimen.zero_v[i] + b->specimen.zero_tc[i] * dt_k;
    }
}

#include "board/afe.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>

#define NOMINAL_DEGC  25.0  /* tolerances are those at this temperature */
#define SAME_DT_NS    1     /* steps of a clock that is no whole number of ns differ by this */
#define FIRST_PULL_NS 31250 /* interval assumed before the first call: one block of the converter at 1000 SPS */
#define TWO_PI        6.283185307179586

struct afe_cfg afe_nominal(enum afe_input input)
{
    return (struct afe_cfg){
        .input = input, .load_ohm = 1000.0, .divider_ratio = 8.0, .clip_v = 10.5, .filter_hz = 10e3};
}

static double with_ppm(double nominal, double tol_ppm, double tc_ppm_per_k, double dt_k)
{
    return nominal * (1.0 + 1e-6 * (tol_ppm + tc_ppm_per_k * dt_k));
}

static struct afe_scale scale_at(const struct afe_cfg *c, double degc)
{
    const double dt_k = degc - NOMINAL_DEGC;
    const bool current = c->input == AFE_CURRENT;
    return (struct afe_scale){.degc = degc,
                              .load =
                                  current ? with_ppm(c->load_ohm, c->load_tol_ppm, c->load_tc_ppm_per_k, dt_k) : 1.0,
                              .drift_v = c->buffer_offset_tc_v_per_k * dt_k,
                              .divider = with_ppm(c->divider_ratio, c->divider_tol_ppm, c->divider_tc_ppm_per_k, dt_k)};
}

void afe_init(struct afe *a, const struct afe_cfg *cfg, struct rng noise)
{
    *a = (struct afe){.cfg = *cfg, .scale = scale_at(cfg, NOMINAL_DEGC), .noise = noise, .t_ns = -1, .dt_ns = -10};
}

static double clip_v(double v, double limit_v)
{
    return v > limit_v ? limit_v : v < -limit_v ? -limit_v : v;
}

/* Signal -> load, if it is a current -> buffer. */
static double load_v(const struct afe_cfg *c, const struct afe_scale *s, double signal)
{
    return clip_v(signal * s->load + c->buffer_offset_v + s->drift_v, c->clip_v);
}

/* Constants of a step of dt: they change only when the converter changes its pace. */
static void set_step(struct afe *a, int64_t dt_ns)
{
    const double dt_s = (double)dt_ns / (double)NS_PER_S;
    const double x = TWO_PI * a->cfg.filter_hz * dt_s;
    a->dt_ns = dt_ns;
    a->keep = a->cfg.filter_hz <= 0.0 || x > 700.0 ? 0.0 : det_exp(-x);
    a->noise_v = a->cfg.noise_v_rthz > 0.0 ? a->cfg.noise_v_rthz * sqrt(1.0 / (2.0 * dt_s)) : 0.0;
}

static bool same_step(const struct afe *a, int64_t dt_ns)
{
    return dt_ns >= a->dt_ns - SAME_DT_NS && dt_ns <= a->dt_ns + SAME_DT_NS;
}

/* One pole, exact for an input that is held over the step: s <- x + (s - x) exp(-2 pi f dt). */
static double filtered_v(struct afe *a, double v, int64_t t_ns)
{
    a->state_v = v + (a->state_v - v) * a->keep;
    a->t_ns = t_ns;
    return a->state_v;
}

/* The first sample, a new step or temperature, noise. ripple_v comes through the buffer. */
static double step_v(struct afe *a, double signal, double ripple_v, double temp_degc, int64_t t_ns)
{
    const bool first = a->t_ns < 0;
    const int64_t dt_ns = first ? FIRST_PULL_NS : t_ns - a->t_ns;
    if (dt_ns <= 0) return a->state_v;
    if (!same_step(a, dt_ns)) set_step(a, dt_ns);
    if (temp_degc != a->scale.degc) a->scale = scale_at(&a->cfg, temp_degc);
    double v = load_v(&a->cfg, &a->scale, signal) + ripple_v;
    if (a->noise_v > 0.0) v += a->noise_v * rng_gauss(&a->noise);
    v /= a->scale.divider;
    if (first) a->state_v = v; /* at power-on the filter has long been settled */
    if (!first) return filtered_v(a, v, t_ns);
    a->t_ns = t_ns;
    return a->state_v;
}

/* ---- faults */

void afe_fault_add(struct afe *a, struct afe_fault *f)
{
    struct afe_fault **at = &a->faults;
    assert(f->kind < AFE_FAULTS);
    while (*at) at = &(*at)->next;
    f->next = NULL;
    *at = f;
}

void afe_fault_remove(struct afe *a, struct afe_fault *f)
{
    struct afe_fault **at = &a->faults;
    while (*at && *at != f) at = &(*at)->next;
    if (*at) *at = f->next;
}

/* What the faults make of the chain at one instant. */
struct faulty {
    double signal;
    double ripple_v;
    double reference; /* relative to what it should be */
};

static void apply_fault(const struct afe *a, const struct afe_fault *f, double for_s, struct faulty *out)
{
    const double limit = 2.0 * a->cfg.clip_v / a->scale.load, turns = f->frequency_hz * for_s;
    if (f->kind == AFE_LOAD_OPEN) out->signal = out->signal < 0.0 ? -limit : limit;
    else if (f->kind == AFE_LOAD_SHORT) out->signal = 0.0;
    else if (f->kind == AFE_REFERENCE) out->reference *= 1.0 + f->value + f->rate_per_s * for_s;
    else out->ripple_v += f->value * det_sin(TWO_PI * (turns - floor(turns)));
}

static struct faulty apply_faults(const struct afe *a, double signal, int64_t t_ns)
{
    struct faulty out = {.signal = signal, .reference = 1.0};
    for (const struct afe_fault *f = a->faults; f; f = f->next) {
        if (t_ns >= f->from_ns) apply_fault(a, f, (double)(t_ns - f->from_ns) / (double)NS_PER_S, &out);
    }
    return out;
}

static double any_out_v(struct afe *a, double signal, double temp_degc, int64_t t_ns)
{
    if (!a->faults) return step_v(a, signal, 0.0, temp_degc, t_ns);
    const struct faulty f = apply_faults(a, signal, t_ns);
    return step_v(a, f.signal, f.ripple_v, temp_degc, t_ns) / f.reference;
}

/* A step and a temperature like the last, no noise, no fault: the constants hold. */
static bool is_quiet_step(const struct afe *a, double temp_degc, int64_t t_ns)
{
    const int64_t dt_ns = t_ns - a->t_ns;
    return dt_ns > 0 && same_step(a, dt_ns) && temp_degc == a->scale.degc && !(a->noise_v > 0.0) && !a->faults;
}

double afe_out_v(struct afe *a, double signal, double temp_degc, int64_t t_ns)
{
    if (!is_quiet_step(a, temp_degc, t_ns)) return any_out_v(a, signal, temp_degc, t_ns);
    return filtered_v(a, load_v(&a->cfg, &a->scale, signal) / a->scale.divider, t_ns);
}

/* Usual steps from the first on; returns how many. A copy of the chain, which no store into the row can change. */
static unsigned usual_row(struct afe *a, double *row, const int64_t *t_ns, unsigned n)
{
    struct afe own = *a;
    unsigned i = 0;
    do {
        row[i] = filtered_v(&own, load_v(&own.cfg, &own.scale, row[i]) / own.scale.divider, t_ns[i]);
        i++;
    } while (i < n && t_ns[i] > own.t_ns && same_step(&own, t_ns[i] - own.t_ns));
    a->state_v = own.state_v;
    a->t_ns = own.t_ns;
    return i;
}

void afe_out_row_v(struct afe *a, double *signal_to_v, double temp_degc, const int64_t *t_ns, unsigned n)
{
    for (unsigned i = 0; i < n;) {
        if (is_quiet_step(a, temp_degc, t_ns[i])) {
            i += usual_row(a, signal_to_v + i, t_ns + i, n - i);
        } else {
            signal_to_v[i] = any_out_v(a, signal_to_v[i], temp_degc, t_ns[i]);
            i++;
        }
    }
}

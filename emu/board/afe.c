#include "board/afe.h"

#include "base/detmath.h"
#include "base/lanes.h"
#include "base/sched.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>

#define NOMINAL_DEGC 25.0 /* tolerances are those at this temperature */
#define SAME_DT_NS   1    /* steps of a clock that is no whole number of ns differ by this */
#define TWO_PI       6.283185307179586

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

void afe_init(struct afe *a, const struct afe_cfg *cfg, struct draws noise)
{
    *a = (struct afe){.cfg = *cfg, .scale = scale_at(cfg, NOMINAL_DEGC), .noise = noise, .t_ns = -1, .dt_ns = -10};
}

static double clip_v(double v, double limit_v)
{
    return v > limit_v ? limit_v : v < -limit_v ? -limit_v : v;
}

/* What is less is gone: two pasts of the filter do not stay apart in the last bit, even of an input at rest. */
#define GONE_V 1e-15

static void set_step(struct afe *a, int64_t dt_ns)
{
    const double x = TWO_PI * a->cfg.filter_hz * ((double)dt_ns / (double)NS_PER_S);
    a->dt_ns = dt_ns;
    a->keep = a->cfg.filter_hz <= 0.0 || x > 700.0 ? 0.0 : det_exp(-x);
}

static bool same_step(int64_t known_ns, int64_t dt_ns)
{
    return dt_ns >= known_ns - SAME_DT_NS && dt_ns <= known_ns + SAME_DT_NS;
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

/* ---- a row */

/* Signal to volts behind the buffer. */
static inline double loaded_v(const struct afe *a, double signal)
{
    return clip_v(signal * a->scale.load + a->cfg.buffer_offset_v + a->scale.drift_v, a->cfg.clip_v);
}

static double for_s(const struct afe_fault *f, int64_t t_ns)
{
    return (double)(t_ns - f->from_ns) / (double)NS_PER_S;
}

static double angle_of(const struct afe_fault *f, int64_t t_ns)
{
    const double turns = f->frequency_hz * for_s(f, t_ns);
    return TWO_PI * (turns - floor(turns));
}

static bool is_fast(const struct afe_fault *f)
{
    return f->kind == AFE_RIPPLE && f->frequency_hz > AFE_SLOW_HZ;
}

/* Volts behind the buffer with the faults that are before the pole. */
static double faulty_v(const struct afe *a, double signal, int64_t t_ns)
{
    const double limit = 2.0 * a->cfg.clip_v / a->scale.load;
    double ripple_v = 0.0;
    for (const struct afe_fault *f = a->faults; f; f = f->next) {
        if (t_ns < f->from_ns) continue;
        if (f->kind == AFE_LOAD_OPEN) signal = signal < 0.0 ? -limit : limit;
        else if (f->kind == AFE_LOAD_SHORT) signal = 0.0;
        else if (f->kind == AFE_RIPPLE && !is_fast(f)) ripple_v += f->value * det_sin(angle_of(f, t_ns));
    }
    return loaded_v(a, signal) + ripple_v;
}

/* A ripple behind the pole, settled, at the load's scale: the imaginary part of V e^jx / (1 + j ratio). */
static double passed_v(const struct afe *a, const struct afe_fault *f, int64_t t_ns)
{
    const double ratio = a->cfg.filter_hz > 0.0 ? f->frequency_hz / a->cfg.filter_hz : 0.0;
    const struct det_pair x = det_sin_cos(angle_of(f, t_ns));
    return f->value * (x.sin - ratio * x.cos) / (1.0 + ratio * ratio);
}

/* And with those that are behind it. */
static double faulty_out_v(const struct afe *a, double v, int64_t t_ns)
{
    double reference = 1.0;
    for (const struct afe_fault *f = a->faults; f; f = f->next) {
        if (t_ns < f->from_ns) continue;
        if (f->kind == AFE_REFERENCE) reference *= 1.0 + f->value + f->rate_per_s * for_s(f, t_ns);
        else if (is_fast(f)) v += passed_v(a, f, t_ns) / a->scale.divider;
    }
    return v / reference;
}

LANES_BODY void load_row(const struct afe *a, double *row, unsigned n)
{
    const double load = a->scale.load, offset_v = a->cfg.buffer_offset_v, drift_v = a->scale.drift_v;
    const double limit_v = a->cfg.clip_v;
    const lanes_f64 max_v = LANES_ALL(limit_v), min_v = LANES_ALL(-limit_v);
    unsigned i = 0;
    for (; i + LANES <= n; i += LANES) {
        lanes_f64 v;
        LANES_LOAD(v, row + i);
        v = v * load + offset_v + drift_v;
        v = LANES_PICK(v > max_v, max_v, v);
        v = LANES_PICK(v < min_v, min_v, v);
        LANES_STORE(row + i, v);
    }
    for (; i < n; i++) row[i] = loaded_v(a, row[i]);
}

/* The same with the faults that are before it. */
static void faulty_row(const struct afe *a, double *row, const struct looks *at)
{
    for (unsigned i = 0; i < at->n; i++) row[i] = faulty_v(a, row[i], at->t_ns[i]);
}

static void add_noise(const struct afe *a, double *row, const struct looks *at)
{
    const double rms_v = looks_white_rms(a->cfg.noise_v_rthz, at->every_ns);
    for (unsigned i = 0; i < at->n; i++) row[i] += rms_v * draws_gauss(&a->noise, at->t_ns[i]);
}

/* Whether all steps to and between n instants are those for which `keep` holds. A row of looks mostly is. */
LANES_BODY bool same_steps(int64_t known_ns, int64_t last_ns, const int64_t *t_ns, unsigned n)
{
    const int64_t least_ns = known_ns - SAME_DT_NS, most_ns = known_ns + SAME_DT_NS;
    const lanes_i64 least = LANES_ALL(least_ns), most = LANES_ALL(most_ns);
    lanes_i64 other = {0};
    if (least_ns <= 0 || !same_step(known_ns, t_ns[0] - last_ns)) return false;
    unsigned i = 1;
    for (; i + LANES <= n; i += LANES) {
        lanes_i64 at, before;
        LANES_LOAD(at, t_ns + i);
        LANES_LOAD(before, t_ns + i - 1);
        other |= (at - before < least) | (at - before > most);
    }
    for (; i < n; i++) other[0] |= !same_step(known_ns, t_ns[i] - t_ns[i - 1]);
    return !(other[0] | other[1] | other[2] | other[3]);
}

LANES_BODY void divide_row(double *row, double by, unsigned n)
{
    unsigned i = 0;
    for (; i + LANES <= n; i += LANES) {
        lanes_f64 v;
        LANES_LOAD(v, row + i);
        v /= by;
        LANES_STORE(row + i, v);
    }
    for (; i < n; i++) row[i] /= by;
}

static inline double pass_pole(double state_v, double v, double keep)
{
    const double off_v = (state_v - v) * keep;
    return fabs(off_v) < GONE_V ? v : v + off_v;
}

/* One pole, exact for an input that is held over the step: s <- x + (s - x) exp(-2 pi f dt). At power-on it has long been
 * settled. row: behind the divider. */
static void filter_any(struct afe *a, double *row, const struct looks *at)
{
    double state_v = a->t_ns < 0 ? row[0] : a->state_v;
    int64_t last_ns = a->t_ns < 0 ? at->t_ns[0] : a->t_ns;
    for (unsigned i = 0; i < at->n; i++) {
        const int64_t dt_ns = at->t_ns[i] - last_ns;
        if (dt_ns > 0) {
            if (!same_step(a->dt_ns, dt_ns)) set_step(a, dt_ns);
            state_v = pass_pole(state_v, row[i], a->keep);
            last_ns = at->t_ns[i];
        }
        row[i] = state_v;
    }
    a->state_v = state_v;
    a->t_ns = last_ns;
}

static void filter_even(struct afe *a, double *row, const struct looks *at)
{
    const double keep = a->keep;
    double state_v = a->state_v;
#pragma GCC unroll 4
    for (unsigned i = 0; i < at->n; i++) row[i] = state_v = pass_pole(state_v, row[i], keep);
    a->state_v = state_v;
    a->t_ns = at->t_ns[at->n - 1];
}

LANES_BODY void filter_row(struct afe *a, double *row, const struct looks *at)
{
    divide_row(row, a->scale.divider, at->n);
    if (at->n >= LANES && a->t_ns >= 0 && same_steps(a->dt_ns, a->t_ns, at->t_ns, at->n)) filter_even(a, row, at);
    else filter_any(a, row, at);
}

LANES_BODY void pass_row(struct afe *a, double *row, const struct looks *at)
{
    if (a->faults) faulty_row(a, row, at);
    else load_row(a, row, at->n);
    if (a->cfg.noise_v_rthz > 0.0) add_noise(a, row, at);
    filter_row(a, row, at);
}

LANES_AVX2 static void pass_row_avx2(struct afe *a, double *row, const struct looks *at)
{
    pass_row(a, row, at);
}

void afe_out_row_v(struct afe *a, double *signal_to_v, double temp_degc, const struct looks *at)
{
    if (temp_degc != a->scale.degc) a->scale = scale_at(&a->cfg, temp_degc);
    if (at->n >= LANES && lanes_avx2()) pass_row_avx2(a, signal_to_v, at);
    else pass_row(a, signal_to_v, at);
    for (unsigned i = 0; a->faults && i < at->n; i++) signal_to_v[i] = faulty_out_v(a, signal_to_v[i], at->t_ns[i]);
}

/* ---- rows left out */

/* Of a difference in the last bit a step that keeps less leaves, by the rounding, nothing at least every other time: after the
 * 2000 samples of a filter's memory two pasts differ once in 2^2000 times. */
#define KEEP_MAX 0.5

struct looks_range afe_range_v(const struct afe *a, struct looks_range signal, int64_t every_ns)
{
    const double noise_v = DRAWS_GAUSS_MAX * looks_white_rms(a->cfg.noise_v_rthz, every_ns);
    double low_v = INFINITY, high_v = -INFINITY;
    for (int degc = BOARD_COLDEST_DEGC; degc <= BOARD_WARMEST_DEGC; degc += BOARD_WARMEST_DEGC - BOARD_COLDEST_DEGC) {
        const struct afe_scale s = scale_at(&a->cfg, degc);
        const double mid_v = signal.mid * s.load + a->cfg.buffer_offset_v + s.drift_v;
        const double off_v = signal.off * fabs(s.load) + noise_v;
        low_v = fmin(low_v, (mid_v - off_v) / s.divider);
        high_v = fmax(high_v, (mid_v + off_v) / s.divider);
    }
    return (struct looks_range){0.5 * (low_v + high_v), 0.5 * (high_v - low_v)};
}

bool afe_forgets(const struct afe *a, int64_t every_ns)
{
    struct afe step = {.cfg = a->cfg};
    set_step(&step, every_ns);
    return !a->faults && step.keep <= KEEP_MAX;
}

void afe_skip(struct afe *a, int64_t t_ns)
{
    a->t_ns = t_ns;
}

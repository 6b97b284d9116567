/* One PIK unit with inputs whose integral is known, its readings collected, and if wanted a listener on its lines. */
#ifndef PSABENCH_TESTS_PIK_RIG_H
#define PSABENCH_TESTS_PIK_RIG_H

#include "looks.h"
#include "rig.h"

#include "base/detmath.h"
#include "board/pik/pik.h"

#include <string.h>

#define RIG_READINGS 4096u
#define RIG_EDGES    200000u
#define RIG_TWO_PI   6.283185307179586

struct rig_edge {
    int64_t t_ns;
    uint8_t sig;
    bool level;
};

#define RIG_SINES 3u

struct rig_sine {
    double v, hz, turns; /* phase at 0 */
};

struct rig_input { /* a constant, and sines */
    double v;
    unsigned sines;
    struct rig_sine sine[RIG_SINES];
};

struct rig {
    struct sched s;
    struct pik b;
    struct rig_input input[PIK_AXES];
    int64_t asked_ns[PIK_AXES]; /* last */
    double degc;
    struct pik_reading reading[RIG_READINGS];
    unsigned readings;
    unsigned saturations, ends;
    unsigned event[PIK_EVENTS];
    int64_t event_ns[PIK_EVENTS]; /* last */
    struct trace_sink sink;
    struct rig_edge edge[RIG_EDGES];
    unsigned edges;
    struct board_cycle cycle;
    bool answered;
    enum board_cycle_result result;
    int64_t answered_ns;
};

static inline double rig_phase(const struct rig_sine *s, int64_t t_ns)
{
    const double turns = s->hz * (double)t_ns * 1e-9 + s->turns;
    return RIG_TWO_PI * (turns - (double)(int64_t)turns);
}

static inline double rig_input_v(const struct rig_input *in, int64_t t_ns)
{
    double v = in->v;
    for (unsigned k = 0; k < in->sines; k++) v += in->sine[k].v * det_sin(rig_phase(&in->sine[k], t_ns));
    return v;
}

/* From 0 to t. */
static inline double rig_integral_vs(const struct rig_input *in, int64_t t_ns)
{
    double vs = in->v * (double)t_ns * 1e-9;
    for (unsigned k = 0; k < in->sines; k++) {
        const struct rig_sine *s = &in->sine[k];
        vs += s->v * (det_cos(rig_phase(s, 0)) - det_cos(rig_phase(s, t_ns))) / (RIG_TWO_PI * s->hz);
    }
    return vs;
}

static inline double rig_accel(void *ctx, unsigned axis, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_true(t_ns <= r->s.now_ns && t_ns >= r->asked_ns[axis]);
    r->asked_ns[axis] = t_ns;
    return rig_input_v(&r->input[axis], t_ns);
}

LOOKS_ROW(rig_accel_row, rig_accel);

static inline double rig_degc(void *ctx, unsigned channel, int64_t t_ns)
{
    (void)t_ns;
    assert_int_equal(channel, 3);
    return ((struct rig *)ctx)->degc;
}

static inline void rig_event(void *ctx, unsigned e, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_int_equal(t_ns, r->s.now_ns);
    r->event[e]++;
    r->event_ns[e] = t_ns;
}

static inline void rig_reading(void *ctx, const struct pik_reading *reading, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_int_equal(t_ns, reading->t_ns);
    if (r->readings < RIG_READINGS) r->reading[r->readings++] = *reading;
}

static inline void rig_saturated(void *ctx, bool on, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    *(on ? &r->saturations : &r->ends) += 1;
}

static inline void rig_change(void *ctx, unsigned sig, bool level, int64_t t_ns)
{
    struct rig *r = ctx;
    if (r->edges < RIG_EDGES) r->edge[r->edges++] = (struct rig_edge){t_ns, (uint8_t)sig, level};
}

static inline void rig_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    trace_each(s, n, UINT64_MAX, rig_change, ctx);
}

/* Nothing is off and nothing is noisy. */
static inline struct pik_profile rig_ideal(const struct pik_profile *like)
{
    struct pik_profile p = *like;
    p.uref_tol_ppm = p.uref_tc_ppm_per_k = p.ratio_tol_ppm = p.ratio_tc_ppm_per_k = p.asymmetry_ppm = 0.0;
    p.clock_tol_ppm = p.c_tol_pct = p.c_tc_ppm_per_k = p.zero_v = p.zero_tc_v_per_k = p.noise_v_rthz = 0.0;
    return p;
}

static inline struct pik_profile rig_pik(void)
{
    struct pik_profile p;
    fields_default(&pik_fields, &p);
    return rig_ideal(&p);
}

static inline struct pik_profile rig_pik6(void)
{
    struct pik_profile p = rig_pik();
    p.clock_hz = 40000;
    p.c_int_nf = 4.7;
    p.uc_v = 3.9;
    p.look_ticks = 112;
    return p;
}

static inline void rig_init(struct rig *r, const struct pik_profile *p, uint32_t serial)
{
    const struct board_io io = {.ctx = r, .accel = rig_accel_row, .temp_degc = rig_degc, .event = rig_event};
    struct board_cfg cfg = {.adc_noise_scale = 1.0, .seed = 7, .serial = serial};
    char why[300];
    if (!pik_profile_check(p, why, sizeof why)) fail_msg("%s", why);
    for (unsigned i = 0; i < PIK_AXES; i++) {
        cfg.afe[i] = afe_nominal(AFE_VOLTAGE);
        cfg.afe[i].divider_ratio = 1.0;
        cfg.afe[i].filter_hz = 0.0;
    }
    memset(r, 0, sizeof *r);
    r->degc = 25.0;
    sched_init(&r->s);
    pik_init(&r->b, p, &cfg, &io, &r->s);
    r->b.host = (struct pik_host){.ctx = r, .reading = rig_reading, .saturated = rig_saturated};
    r->sink = (struct trace_sink){.mask = UINT64_MAX >> (64 - PIK_LINES), .steps = rig_steps, .ctx = r};
}

static inline void rig_up(struct rig *r, const struct pik_profile *p, uint32_t serial)
{
    rig_init(r, p, serial);
    pik_power_up(&r->b, 0);
}

static inline void rig_run_until(struct rig *r, int64_t t_ns)
{
    while (r->s.now_ns < t_ns) { /* as the main loop does: the trace lags behind */
        const int64_t step_ns = t_ns - r->s.now_ns;
        sched_run_until(&r->s, r->s.now_ns + (step_ns < 100000 ? step_ns : 100000));
        trace_advance(&r->b.base.trace, r->s.now_ns - TRACE_LAG_NS);
        assert_int_equal(r->b.base.trace.late, 0);
        assert_int_equal(r->b.base.trace.dropped, 0);
    }
}

/* Up minus down, now. */
static inline double rig_count(struct rig *rig, unsigned axis)
{
    const struct pik_axis *a = &rig->b.channel[axis].axis;
    pik_sample_until(&rig->b, rig->s.now_ns);
    return (double)(int64_t)(a->plus - a->minus);
}

static inline void rig_done(void *ctx, struct board_cycle *c, enum board_cycle_result result, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_ptr_equal(c, &r->cycle);
    assert_false(r->answered);
    r->answered = true;
    r->result = result;
    r->answered_ns = t_ns;
}

static inline enum board_cycle_result rig_submit(struct rig *r, bool write, uint8_t address, uint16_t data,
                                                 int64_t strobe_ns)
{
    r->answered = false;
    r->cycle = (struct board_cycle){
        .write = write, .address = address, .data = data, .strobe_ns = strobe_ns, .done = rig_done, .ctx = r};
    return pik_bus.submit(&r->b.base, &r->cycle, r->s.now_ns);
}

/* A whole cycle with the profile's strobe; the word read. */
static inline uint16_t rig_bus(struct rig *r, bool write, uint8_t address, uint16_t data)
{
    assert_int_equal(rig_submit(r, write, address, data, 0), BOARD_CYCLE_OK);
    rig_run_until(r, r->s.now_ns + r->b.profile.strobe_ns);
    assert_true(r->answered);
    assert_int_equal(r->result, BOARD_CYCLE_OK);
    return r->cycle.data;
}

#endif

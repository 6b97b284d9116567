/* One PSA-2 unit with constant inputs, its frames collected, and if wanted a listener on its lines. */
#ifndef PSABENCH_TESTS_PSA2_RIG_H
#define PSABENCH_TESTS_PSA2_RIG_H

#include "looks.h"
#include "psa2_profiles.h"

#include "board/psa2/psa2.h"

#include <string.h>

#define RIG_FRAMES 4096u
#define RIG_EDGES  400000u

struct rig_edge {
    int64_t t_ns;
    uint8_t sig;
    bool level;
};

struct rig_byte { /* as a logic analyser would decode it from the lines */
    enum psa2_group group;
    uint8_t mosi, miso[3];
    int64_t first_rise_ns, last_sample_ns, first_fall_ns;
};

struct rig {
    struct sched s;
    struct psa2 b;
    double volts[3]; /* at the sensors */
    double degc[4];
    struct psa2_frame frame[RIG_FRAMES];
    unsigned frames;
    uint16_t fault[16];
    unsigned faults;
    struct trace_sink sink;
    struct rig_edge edge[RIG_EDGES];
    unsigned edges;
    bool answered;
    enum psa2_result result;
    int64_t answered_ns;
};

static inline double rig_accel(void *ctx, unsigned axis, int64_t t_ns)
{
    (void)t_ns;
    return ((struct rig *)ctx)->volts[axis];
}

LOOKS_ROW(rig_accel_row, rig_accel);

static inline double rig_degc(void *ctx, unsigned channel, int64_t t_ns)
{
    (void)t_ns;
    return ((struct rig *)ctx)->degc[channel];
}

static inline void rig_frame(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_int_equal(t_ns, f->t_int_rise_ns);
    if (r->frames < RIG_FRAMES) r->frame[r->frames++] = *f;
}

static inline void rig_fault(void *ctx, uint16_t code, int64_t t_ns)
{
    (void)t_ns;
    struct rig *r = ctx;
    if (r->faults < COUNT(r->fault)) r->fault[r->faults++] = code;
}

static inline void rig_change(void *ctx, unsigned sig, bool level, int64_t t_ns)
{
    struct rig *r = ctx;
    if (r->edges < RIG_EDGES) r->edge[r->edges++] = (struct rig_edge){t_ns, (uint8_t)sig, level};
}

static inline void rig_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    trace_each(s, n, TRACE_FIRST(PSA2_LINES), rig_change, ctx);
}

static inline struct board_cfg rig_unit(double noise_scale)
{
    struct board_cfg u = {.adc_noise_scale = noise_scale, .temp_noise_scale = noise_scale, .seed = 7, .serial = 3};
    for (int i = 0; i < 3; i++) u.afe[i] = afe_nominal(AFE_VOLTAGE);
    return u;
}

/* Off; rig_power() or psa2_power_up() switches it on. */
static inline void rig_init(struct rig *r, const struct psa2_profile *p, double noise_scale)
{
    const struct board_io io = {.ctx = r, .accel = rig_accel_row, .temp_degc = rig_degc};
    const struct board_cfg u = rig_unit(noise_scale);
    char why[300];
    if (!psa2_profile_check(p, why, sizeof why)) fail_msg("%s", why);
    memset(r, 0, sizeof *r);
    for (int i = 0; i < 4; i++) r->degc[i] = 25.0;
    sched_init(&r->s);
    psa2_init(&r->b, p, &u, &io, &r->s);
    r->b.host = (struct psa2_host){.ctx = r, .frame = rig_frame, .fault = rig_fault};
    r->sink = (struct trace_sink){.mask = 0xFFFF, .steps = rig_steps, .ctx = r};
}

static inline void rig_run(struct rig *r, int64_t ns)
{
    const int64_t end_ns = r->s.now_ns + ns;
    while (r->s.now_ns < end_ns) { /* as the main loop does: the trace lags behind */
        const int64_t step_ns = end_ns - r->s.now_ns;
        sched_run_until(&r->s, r->s.now_ns + (step_ns < 100000 ? step_ns : 100000));
        trace_advance(&r->b.base.trace, r->s.now_ns - TRACE_LAG_NS);
    }
}

/* Runs until the set-up is over and one frame has come. */
static inline void rig_up(struct rig *r, const char *profile, double noise_scale)
{
    const struct psa2_profile p = psa2_profile_file(profile);
    rig_init(r, &p, noise_scale);
    psa2_power_up(&r->b, 0);
    for (int ms = 0; ms < 400 && r->frames == 0; ms++) rig_run(r, 1000000);
    assert_true(psa2_ready(&r->b));
    assert_int_equal(r->frames, 1);
}

static inline void rig_done(void *ctx, struct psa2_request *q, enum psa2_result result, int64_t t_ns)
{
    (void)q;
    struct rig *r = ctx;
    r->answered = true;
    r->result = result;
    r->answered_ns = t_ns;
}

/* Submits and waits up to a second of simulated time. */
static inline enum psa2_result rig_request(struct rig *r, struct psa2_request *q)
{
    q->done = rig_done;
    q->ctx = r;
    r->answered = false;
    const enum psa2_result refused = psa2_submit(&r->b, q, r->s.now_ns);
    if (refused != PSA2_OK) return refused;
    assert_false(r->answered); /* never from inside */
    for (int ms = 0; ms < 1000 && !r->answered; ms++) rig_run(r, 1000000);
    assert_true(r->answered);
    return r->result;
}

/* Decodes both serial ports from the collected edges: mode 0 while CST is high, mode 1 while it is low. */
static inline unsigned rig_decode_spi(const struct rig *r, struct rig_byte *out, unsigned cap)
{
    bool level[PSA2_LINES] = {[PSA2_LINE_CST] = true};
    unsigned n = 0, bits = 0;
    struct rig_byte now;
    memset(&now, 0, sizeof now);
    for (unsigned i = 0; i < r->edges; i++) {
        const struct rig_edge *e = &r->edge[i];
        level[e->sig] = e->level;
        if (e->sig == PSA2_LINE_CST) bits = 0;
        if (e->sig != PSA2_LINE_SCLK) continue;
        const bool temp = !level[PSA2_LINE_CST];
        if (bits == 0 && e->level) now.first_rise_ns = e->t_ns;
        if (e->level == temp) continue;
        now.mosi = (uint8_t)(now.mosi << 1 | level[temp ? PSA2_LINE_DINT : PSA2_LINE_DIN]);
        for (unsigned k = 0; k < 3; k++)
            now.miso[k] = (uint8_t)(now.miso[k] << 1 | level[temp ? PSA2_LINE_DOUTT : PSA2_LINE_DOUTX + k]);
        if (++bits < 8) continue;
        now.group = temp ? PSA2_TEMP : PSA2_ACCEL;
        now.last_sample_ns = e->t_ns;
        if (n < cap) out[n] = now;
        n++;
        bits = 0;
    }
    return n < cap ? n : cap;
}

#endif

/* The analog side of a PMKA in time: what flows into the integrators, and what the converter and the comparators see of it. */
#include "board/pmka/internal.h"

#include <math.h>

/* ---- inputs ---- */

/* Integral of an axis from its last instant to t_ns: one cell, half a period at most. */
static double cell_vs(struct pmka *b, unsigned axis, int64_t t_ns)
{
    struct pmka_axis *a = &b->axis[axis];
    int64_t node_ns[PMKA_NODES];
    double v[PMKA_NODES];
    pmka_nodes(a->at_ns, t_ns, node_ns);
    const struct looks at = {node_ns, PMKA_NODES, pmka_node_ns(t_ns - a->at_ns)};
    b->base.io.accel(b->base.io.ctx, axis, &at, v);
    afe_out_row_v(&b->base.afe[axis], v, b->board_degc, &at);
    const double vs = pmka_integral_vs(v, t_ns - a->at_ns);
    a->integral_vs += vs;
    a->at_ns = t_ns;
    return vs;
}

void pmka_integrate_axis(struct pmka *b, unsigned axis, int64_t t_ns)
{
    struct pmka_axis *a = &b->axis[axis];
    while (a->at_ns < t_ns) (void)cell_vs(b, axis, ns_earlier(t_ns, a->at_ns + pmka_half_ns(b)));
}

/* ---- integrators ---- */

static void apply_reset(const struct pmka *b, struct pmka_channel *c, int64_t from_ns, int64_t until_ns)
{
    if (b->base.faults & PMKA_FAULT_STUCK_RESET && c == &b->channel[0]) {
        pmka_int_reset(&c->integrator, PMKA_PLUS, b->uref_v, until_ns - from_ns);
        return;
    }
    if (!c->resetting) return;
    const int64_t on_ns = ns_later(from_ns, c->reset_from_ns), off_ns = ns_earlier(until_ns, c->reset_until_ns);
    if (on_ns < off_ns) pmka_int_reset(&c->integrator, c->sign, b->uref_v, off_ns - on_ns);
}

void pmka_integrate(struct pmka *b, unsigned i, int64_t t_ns)
{
    struct pmka_channel *c = &b->channel[i];
    while (c->at_ns < t_ns) {
        while (c->cell_ns <= c->at_ns) c->cell_ns += pmka_half_ns(b);
        const int64_t end_ns = ns_earlier(t_ns, c->cell_ns);
        const double input_vs = c->axis < 0 ? 0.0 : cell_vs(b, (unsigned)c->axis, end_ns);
        pmka_int_feed(&c->integrator, input_vs, end_ns - c->at_ns);
        apply_reset(b, c, c->at_ns, end_ns);
        (void)pmka_int_out_v(&c->integrator, end_ns); /* the limit */
        c->at_ns = end_ns;
    }
}

/* ---- probes ---- */

void pmka_probes_init(struct pmka *b)
{
    static const char *const name[PMKA_INTS] = {"U_X", "U_Y", "U_Z", "U_K"};
    for (unsigned i = 0; i < PMKA_INTS; i++) b->reals.name[i] = name[i];
    b->reals.count = PMKA_INTS;
    b->base.trace.reals = &b->reals;
}

void pmka_probe(struct pmka *b, unsigned i, int64_t t_ns)
{
    if (trace_real_watched(&b->reals)) trace_real(&b->reals, i, pmka_int_out_v(&b->channel[i].integrator, t_ns), t_ns);
}

/* ---- resets ---- */

static void put_reset_line(struct pmka *b, unsigned i, bool on, int64_t t_ns)
{
    const unsigned line = PMKA_LINE_RP1 + 2 * i + (b->channel[i].sign == PMKA_MINUS);
    pmka_line(b, line, on, t_ns);
}

static void start_reset(struct pmka *b, unsigned i, enum pmka_sign sign, int64_t t_ns)
{
    struct pmka_channel *c = &b->channel[i];
    c->resetting = true;
    c->sign = sign;
    c->reset_from_ns = t_ns;
    c->reset_until_ns = t_ns + pmka_half_ns(b);
    c->done = sign == PMKA_PLUS ? 1 : -1;
    c->count[sign]++;
    if (sign == PMKA_PLUS) b->counters.resets_plus++;
    else b->counters.resets_minus++;
    board_notify(&b->base, PMKA_EV_RESET, t_ns);
    put_reset_line(b, i, true, t_ns);
    sched_at(b->base.sched, &c->reset_end, c->reset_until_ns);
}

void pmka_cut_reset(struct pmka *b, unsigned i, int64_t t_ns)
{
    struct pmka_channel *c = &b->channel[i];
    pmka_integrate(b, i, t_ns);
    sched_cancel(b->base.sched, &c->reset_end);
    put_reset_line(b, i, false, t_ns);
    c->resetting = false;
}

/* Only the lines: how much flowed is known from the two instants. The end of a reset is the end of a cell, so that a probe
 * finds what is computed later in any case. */
static void reset_ended(void *ctx, int64_t t_ns)
{
    struct pmka *b = ctx;
    for (unsigned i = 0; i < PMKA_INTS; i++) {
        if (!b->channel[i].resetting || b->channel[i].reset_until_ns != t_ns) continue;
        put_reset_line(b, i, false, t_ns);
        if (!trace_real_watched(&b->reals)) continue;
        pmka_integrate(b, i, t_ns);
        pmka_probe(b, i, t_ns);
    }
}

/* Beyond Uc, or because the one out of work is being calibrated: then towards zero, which alternates the signs. */
static void check_comparators(struct pmka *b, unsigned i, double out_v, int64_t t_ns)
{
    const struct pmka_channel *c = &b->channel[i];
    const double *uc_v = b->specimen.uc_v[i];
    if (out_v > uc_v[PMKA_PLUS]) start_reset(b, i, PMKA_PLUS, t_ns);
    else if (out_v < -uc_v[PMKA_MINUS]) start_reset(b, i, PMKA_MINUS, t_ns);
    else if (c->said_axis < 0 && b->rotation.cal == PMKA_CAL_RESET) {
        b->counters.calibration_resets++;
        start_reset(b, i, out_v >= 0.0 ? PMKA_PLUS : PMKA_MINUS, t_ns);
    }
}

/* ---- converter ---- */

static int16_t to_code(struct pmka *b, double out_v, int64_t t_ns, bool *clipped)
{
    const struct pmka_profile *p = &b->profile;
    double code = out_v * b->specimen.adc_gain / p->adc_range_v * 32768.0 + b->specimen.adc_offset_lsb;
    if (p->adc_noise_lsb > 0.0 && b->base.cfg.adc_noise_scale > 0.0)
        code += p->adc_noise_lsb * b->base.cfg.adc_noise_scale * draws_gauss(&b->adc_noise, t_ns);
    code = floor(code + 0.5);
    *clipped = code > 32767.0 || code < -32768.0;
    if (b->adc_stuck) return b->adc_stuck_level ? -1 : 0;
    return (int16_t)(code > 32767.0 ? 32767.0 : code < -32768.0 ? -32768.0 : code);
}

#define SH   (UINT64_C(1) << PMKA_LINE_SH)
#define CONV (UINT64_C(1) << PMKA_LINE_CONV)

static void report_step(struct pmka *b, int64_t t_ns, uint64_t lines, uint64_t level)
{
    trace_steps(&b->base.trace, &(struct trace_step){ns_later(t_ns, b->base.trace.done_ns), lines, level}, 1);
}

/* Its end is known as it begins; should the board stop before, the lines fall the sooner. */
static void conversion_begins(void *ctx, int64_t t_ns)
{
    struct pmka *b = ctx;
    report_step(b, t_ns, CONV, CONV);
    report_step(b, b->sampled_ns + b->profile.convert_ns, SH | CONV, 0);
}

static void report_hold(struct pmka *b)
{
    report_step(b, b->sampled_ns, SH, SH);
    sched_at(b->base.sched, &b->conversion, b->sampled_ns + b->profile.hold_ns);
}

void pmka_converter_wake(struct pmka *b, int64_t t_ns)
{
    const int64_t begins_ns = b->sampled_ns + b->profile.hold_ns, ends_ns = b->sampled_ns + b->profile.convert_ns;
    if (b->life != PMKA_RUNNING || t_ns >= ends_ns || trace_watched(&b->base.trace, SH | CONV)) return;
    report_hold(b);
    if (begins_ns > t_ns) return;
    sched_cancel(b->base.sched, &b->conversion);
    conversion_begins(b, begins_ns);
}

void pmka_converter_stop(struct pmka *b, int64_t t_ns)
{
    sched_cancel(b->base.sched, &b->conversion);
    b->sampled_ns = INT64_MIN / 2;
    pmka_line(b, PMKA_LINE_SH, false, t_ns);
    pmka_line(b, PMKA_LINE_CONV, false, t_ns);
}

/* The multiplexer moves on as soon as the sample is held. */
static void hold_sample(struct pmka *b, unsigned i, int64_t t_ns)
{
    const unsigned next = (i + 1) % PMKA_INTS;
    b->sampled_ns = t_ns;
    pmka_line(b, PMKA_LINE_MUX0, next & 1u, t_ns);
    pmka_line(b, PMKA_LINE_MUX1, next >> 1 & 1u, t_ns);
    if (trace_watched(&b->base.trace, SH | CONV)) report_hold(b);
}

void pmka_sample(struct pmka *b, unsigned i, int64_t t_ns)
{
    struct pmka_channel *c = &b->channel[i];
    struct pmka_reading *r = &b->next;
    pmka_integrate(b, i, t_ns);
    const double out_v = pmka_int_out_v(&c->integrator, t_ns);
    pmka_probe(b, i, t_ns);
    r->code[i] = to_code(b, out_v, t_ns, &r->clipped[i]);
    r->reset[i] = c->done;
    r->serves[i] = (uint8_t)c->served;
    r->saturated[i] = c->integrator.saturated;
    b->counters.clips += r->clipped[i];
    b->counters.saturations += r->saturated[i];
    c->integrator.saturated = false;
    c->resetting = false;
    c->done = 0;
    c->served = (unsigned)(c->said_axis + 1);
    c->cell_ns = t_ns + pmka_half_ns(b);
    pmka_int_warm(&c->integrator, b->board_degc);
    hold_sample(b, i, t_ns);
    check_comparators(b, i, out_v, t_ns);
}

void pmka_sample_init(struct pmka *b)
{
    sched_ev_inner(&b->conversion, conversion_begins, b);
    b->sampled_ns = INT64_MIN / 2; /* never */
    for (unsigned i = 0; i < PMKA_INTS; i++) sched_ev_inner(&b->channel[i].reset_end, reset_ended, b);
}

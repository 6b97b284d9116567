/* What the inputs feed into the converters, tick by tick. */
#include "board/pik/internal.h"

#include <math.h>

#define GAUSS        0.28867513459481287 /* of the two points from the middle, sqrt(1/12) */
#define PIECE_PULSES 0.02
#define PIECES_MAX   8

/* ---- inputs ---- */

/* Integral since the last call: Gauss with two points, exact for a cubic, a look at most at a time. Both points lie within, so
 * that a step at either end is on its right side. */
static void integrate_input(struct pik *b, unsigned i, int64_t t_ns)
{
    struct pik_channel *c = &b->channel[i];
    const double span_ns = (double)(t_ns - b->fed_ns);
    const int64_t within_ns = (int64_t)(span_ns * (0.5 - GAUSS));
    const int64_t node_ns[2] = {b->fed_ns + within_ns, t_ns - 1 - within_ns};
    double v[2];
    const struct looks at = {node_ns, 2, (t_ns - b->fed_ns + 1) / 2};
    b->base.io.accel(b->base.io.ctx, i, &at, v);
    afe_out_row_v(&b->base.afe[i], v, b->degc, &at);
    c->due_vs += 0.5 * (v[0] + v[1]) * span_ns * 1e-9;
    c->slope_v_per_s = (v[1] - v[0]) / (2.0 * GAUSS * 1e-9 * span_ns);
}

/* What is beyond twice the strongest reference moves the integrator to its rail as well; charges stay within 64 bits. */
static double limited_v(const struct pik *b, double v)
{
    const double limit_v = 2.0 * b->profile.clock_hz / b->k_hz_per_v;
    return v > limit_v ? limit_v : v < -limit_v ? -limit_v : v;
}

static int64_t round_to_int64(double x)
{
    return (int64_t)floor(x + 0.5);
}

static struct pik_drive drive_at(const struct pik_channel *c, double v)
{
    struct pik_drive d = c->drive;
    d.per_tick = round_to_int64(v * c->per_volt);
    if (!(c->lost_per_volt > 0.0)) return d;
    const int64_t lost = round_to_int64(v * c->lost_per_volt), least = PIK_PULSE / 256;
    d.plus = d.plus + lost > least ? d.plus + lost : least;
    d.minus = d.minus - lost > least ? d.minus - lost : least;
    return d;
}

/* ---- converters ---- */

uint64_t pik_count_plus(const struct pik_channel *c)
{
    return c->plus_from + (c->stuck ? 0 : c->axis.plus);
}

uint64_t pik_count_minus(const struct pik_channel *c)
{
    return c->minus_from + (c->stuck ? 0 : c->axis.minus);
}

/* Up to and including tick with the drive it has; a pulse is notified at t_ns, when it is known, and traced at its own instant. */
static void advance_pulses(struct pik *b, unsigned i, int64_t tick, int64_t t_ns)
{
    struct pik_axis *a = &b->channel[i].axis;
    const bool watched = trace_watched(&b->base.trace, PIK_PULSE_LINES), each = b->base.observed || watched;
    for (int64_t next; each && (next = pik_axis_next(a)) <= tick;) {
        pik_axis_advance(a, next);
        const int64_t begun_ns = pik_tick_ns(b, next);
        if (watched) pik_lines_pulse(b, i, begun_ns);
        if (begun_ns >= b->heard_ns) board_notify(&b->base, PIK_EV_FX + i, t_ns);
    }
    pik_axis_advance(a, tick);
}

/* Into so many pieces of one mean each that the charge is nowhere off by PIECE_PULSES within them. */
static int64_t piece_count(const struct pik *b, const struct pik_channel *c, double span_s)
{
    const double bend = fabs(c->slope_v_per_s) * span_s * span_s * b->k_hz_per_v / 8.0;
    int64_t n = 1;
    while (n < PIECES_MAX && bend > PIECE_PULSES * (double)(n * n)) n *= 2;
    return n;
}

/* The ticks up to `tick` get all the charge that is due, as the slope has it. */
static void convert_ticks(struct pik *b, unsigned i, int64_t tick, int64_t t_ns)
{
    struct pik_channel *c = &b->channel[i];
    const int64_t from = c->axis.tick, ticks = tick - from;
    if (ticks <= 0) return;
    const double tick_s = 1000.0 / (double)b->clk.hz;
    const double mean_v = c->due_vs / ((double)ticks * tick_s) + c->zero_v + c->noise_v;
    const int64_t n = piece_count(b, c, (double)ticks * tick_s);
    for (int64_t k = 1; k <= n; k++) {
        const int64_t begin = c->axis.tick, end = from + ticks * k / n;
        const double off_ticks = 0.5 * (double)(begin + end - from - tick);
        c->axis.drive = drive_at(c, limited_v(b, mean_v + c->slope_v_per_s * off_ticks * tick_s));
        advance_pulses(b, i, end, t_ns);
    }
    c->due_vs = 0.0;
}

/* The order of channels at one instant is that of their numbers, as everywhere. */
void pik_sample_until(struct pik *b, int64_t t_ns)
{
    if (!b->on) return;
    const int64_t tick = pik_tick_at(b, t_ns);
    for (unsigned i = 0; i < PIK_AXES; i++) {
        if (t_ns > b->fed_ns) integrate_input(b, i, t_ns);
        convert_ticks(b, i, tick, t_ns);
    }
    b->fed_ns = t_ns;
}

/* The board's program: a sample each period, on its lines and to its CAN side. */
#include "board/toy/toy.h"

#include <math.h>

#define ALL          TRACE_FIRST(TOY_LINES)
#define STEPS        (2u * TOY_BITS + 1u)
#define BOARD_SENSOR 3u /* temperature channel of the board itself */

const struct board_line toy_lines[TOY_LINES] = {
    [TOY_LINE_FRAME] = {"FRAME", true},
    [TOY_LINE_CLK] = {"CLK", false},
    [TOY_LINE_DATA] = {"DATA", false},
};
const char *const toy_events[TOY_EVENTS] = {"RES", "SAMPLE", "POWER_DOWN", "POWER_UP"};

/* ---- inputs ---- */

static double input_v(struct toy *b, unsigned axis, int64_t t_ns)
{
    double v;
    const struct looks at = {&t_ns, 1, toy_period_ns(&b->profile)};
    b->base.io.accel(b->base.io.ctx, axis, &at, &v);
    afe_out_row_v(&b->base.afe[axis], &v, b->base.io.temp_degc(b->base.io.ctx, BOARD_SENSOR, t_ns), &at);
    return v;
}

static int16_t convert_input(struct toy *b, double volts, bool *clipped)
{
    const double code = floor(volts / b->profile.lsb_v + 0.5);
    *clipped = code > INT16_MAX || code < INT16_MIN;
    if (*clipped) return code > 0 ? INT16_MAX : INT16_MIN;
    return (int16_t)code;
}

/* The code as the controller reads it from the converter's data output. */
static int16_t read_code(const struct toy *b, int16_t code)
{
    return (int16_t)(uint16_t)chip_fault_word(b->dout, (uint16_t)code, 0xFFFF);
}

/* ---- lines ---- */

static uint64_t word_of(const struct toy_sample *s)
{
    uint64_t word = 0;
    for (unsigned i = 0; i < BOARD_AXES; i++) word = word << TOY_CODE_BITS | (uint16_t)s->code[i];
    return word;
}

/* All edges of the latest sample: known when it begins, and shorter than the trace's lag. */
static void fill_steps(const struct toy *b, struct trace_step steps[STEPS])
{
    const uint64_t word = word_of(&b->latest);
    for (int k = 0; k < TOY_BITS; k++) {
        const uint64_t data = word >> (TOY_BITS - 1 - k) & 1 ? TRACE_BIT(TOY_LINE_DATA) : 0;
        const int64_t fall_ns = b->sample_ns + (int64_t)k * b->profile.bit_ns;
        steps[2 * k] = (struct trace_step){fall_ns, ALL, data};
        steps[2 * k + 1] = (struct trace_step){fall_ns + b->profile.bit_ns / 2, ALL, data | TRACE_BIT(TOY_LINE_CLK)};
    }
    const int64_t end_ns = b->sample_ns + (int64_t)TOY_BITS * b->profile.bit_ns;
    steps[STEPS - 1] = (struct trace_step){end_ns, ALL, TRACE_BIT(TOY_LINE_FRAME)};
}

static void shift_out(struct toy *b)
{
    struct trace_step steps[STEPS];
    if (!trace_watched(&b->base.trace, ALL)) return;
    fill_steps(b, steps);
    trace_steps(&b->base.trace, steps, STEPS);
}

/* A client begins to watch: it gets what is left of the word under way. */
static void wake_lines(void *ctx, uint64_t mask)
{
    struct toy *b = ctx;
    struct trace_step steps[STEPS];
    const int64_t from_ns = b->base.trace.done_ns;
    unsigned first = 0;
    if (!(mask & ALL) || trace_watched(&b->base.trace, ALL) || b->latest.seq == 0) return;
    fill_steps(b, steps);
    while (first < STEPS - 1 && steps[first + 1].t_ns <= from_ns) first++;
    if (steps[first].t_ns < from_ns) steps[first].t_ns = from_ns;
    trace_steps(&b->base.trace, steps + first, STEPS - first);
}

static void rest_lines(struct toy *b, int64_t t_ns)
{
    trace_put(&b->base.trace, ALL, b->on ? TRACE_BIT(TOY_LINE_FRAME) : 0, t_ns);
}

/* ---- samples ---- */

int64_t toy_period_ns(const struct toy_profile *p)
{
    return (int64_t)p->period_us * 1000;
}

static void take_sample(struct toy *b, int64_t t_ns)
{
    struct toy_sample *s = &b->latest;
    const bool frozen = b->base.faults & TOY_FAULT_FROZEN_WORDS;
    uint8_t clipped = 0;
    for (unsigned i = 0; i < BOARD_AXES; i++) {
        bool at_the_end;
        const int16_t code = convert_input(b, input_v(b, i, t_ns), &at_the_end);
        clipped |= (uint8_t)(at_the_end << i);
        if (!frozen) s->code[i] = read_code(b, code);
    }
    s->clipped = clipped;
    s->seq++;
    b->counters.samples++;
}

static void sample_periodically(void *ctx, int64_t t_ns)
{
    struct toy *b = ctx;
    sched_at(b->base.sched, &b->sample_ev, t_ns + toy_period_ns(&b->profile));
    take_sample(b, t_ns);
    b->sample_ns = t_ns;
    shift_out(b);
    board_notify(&b->base, TOY_EV_SAMPLE, t_ns);
    if (b->on_sample) b->on_sample(b->can, &b->latest, t_ns);
}

void toy_sample_until(struct toy *b, int64_t t_ns)
{
    for (unsigned i = 0; b->on && i < BOARD_AXES; i++) (void)input_v(b, i, t_ns);
}

/* ---- life ---- */

void toy_init(struct toy *b, const struct toy_profile *p, const struct board_cfg *cfg, const struct board_io *io,
              struct sched *s)
{
    *b = (struct toy){.profile = *p};
    board_init(&b->base, toy_lines, TOY_LINES, cfg, io, s);
    b->base.trace.source = (struct trace_source){.wake = wake_lines, .ctx = b};
    sched_ev(&b->sample_ev, sample_periodically, b);
}

static void restart_samples(struct toy *b, int64_t t_ns)
{
    b->latest = (struct toy_sample){.seq = 0};
    rest_lines(b, t_ns);
    sched_at(b->base.sched, &b->sample_ev, t_ns + toy_period_ns(&b->profile));
}

void toy_power_up(struct toy *b, int64_t t_ns)
{
    b->on = true;
    restart_samples(b, t_ns);
    board_notify(&b->base, TOY_EV_POWER_UP, t_ns);
}

void toy_power_down(struct toy *b, int64_t t_ns)
{
    b->on = false;
    sched_cancel(b->base.sched, &b->sample_ev);
    rest_lines(b, t_ns);
    board_notify(&b->base, TOY_EV_POWER_DOWN, t_ns);
}

void toy_reset(struct toy *b, int64_t t_ns)
{
    if (!b->on) return;
    b->counters.resets++;
    restart_samples(b, t_ns);
    board_notify(&b->base, TOY_EV_RES, t_ns);
}

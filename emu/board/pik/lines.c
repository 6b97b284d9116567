/* Edges for the trace: computed only while a line is watched, pulse by pulse, period by period of CLK. */
#include "board/bus_lines.h"
#include "board/pik/internal.h"

#define BIT(line)    (UINT64_C(1) << (line))
#define CLK_BATCH    1000 /* periods reported at a time: well within what the trace keeps */
#define REST_HIGH    (BIT(PIK_LINE_LATCH) | BIT(PIK_LINE_CS) | BIT(PIK_LINE_RW))
#define EVERY_LINE   (BIT(PIK_LINES) - 1)
#define STUCK_OF(ax) (UINT64_C(3) << (PIK_LINE_FXP + 2 * (ax)))

const struct board_line pik_lines[PIK_LINES] = {
    [PIK_LINE_CLK] = {"CLK", false}, [PIK_LINE_LATCH] = {"LATCH", true}, [PIK_LINE_CS] = {"CS", true},
    [PIK_LINE_RW] = {"RW", true},    [PIK_LINE_FXP] = {"FXP", false},    [PIK_LINE_FXN] = {"FXN", false},
    [PIK_LINE_FYP] = {"FYP", false}, [PIK_LINE_FYN] = {"FYN", false},    [PIK_LINE_FZP] = {"FZP", false},
    [PIK_LINE_FZN] = {"FZN", false}, BUS_LINES_AB(PIK_LINE_AB0),         BUS_LINES_D(PIK_LINE_D0),
};
const char *const pik_events[PIK_EVENTS] = {PIK_EVENT_LIST(BOARD_EVENT_NAME)};

static uint64_t stuck_lines(const struct pik *b)
{
    uint64_t lines = 0;
    for (unsigned i = 0; i < PIK_AXES; i++) lines |= b->channel[i].stuck ? STUCK_OF(i) : 0;
    return lines;
}

static uint64_t stuck_level(const struct pik *b)
{
    uint64_t level = 0;
    for (unsigned i = 0; i < PIK_AXES; i++) level |= b->channel[i].stuck_level ? STUCK_OF(i) : 0;
    return level & stuck_lines(b);
}

void pik_lines_rest(struct pik *b, bool power, int64_t t_ns)
{
    trace_put(&b->base.trace, EVERY_LINE, power ? REST_HIGH | stuck_level(b) : 0, t_ns);
}

/* A level that was there before the trace can take an edge is shown from the first instant that it can. */
static void put_from(struct pik *b, uint64_t lines, bool level, int64_t t_ns)
{
    const int64_t from_ns = t_ns > b->base.trace.done_ns ? t_ns : b->base.trace.done_ns;
    trace_steps(&b->base.trace, &(struct trace_step){from_ns, lines, level ? lines : 0}, 1);
}

void pik_lines_pulse(struct pik *b, unsigned axis, int64_t from_ns)
{
    struct pik_channel *c = &b->channel[axis];
    const uint64_t line = BIT(PIK_LINE_FXP + 2 * axis + (c->axis.begun_sign < 0));
    c->shown_tick = c->axis.begun_tick;
    if (c->stuck) return;
    put_from(b, line, true, from_ns);
    put_from(b, line, false, pik_tick_ns(b, c->axis.begun_tick + c->axis.drive.pulse_ticks));
}

void pik_lines_stuck(struct pik *b, unsigned axis, int64_t t_ns)
{
    if (b->on) trace_put(&b->base.trace, STUCK_OF(axis), stuck_level(b), t_ns);
}

/* ---- CLK ---- */

/* Rises from clk_shown_tick on that come up to t_ns, each with its fall half a period later; how far it got. */
static int64_t report_clk(void *ctx, int64_t t_ns)
{
    struct pik *b = ctx;
    const int64_t period = b->profile.grid;
    if (!b->on || !trace_watched(&b->base.trace, BIT(PIK_LINE_CLK))) return t_ns;
    for (unsigned n = 0;; n++, b->clk_shown_tick += period) {
        const int64_t rise_ns = pik_tick_ns(b, b->clk_shown_tick);
        if (rise_ns > t_ns) return t_ns;
        if (n == CLK_BATCH) return rise_ns - 1;
        const int64_t fall_ns = rise_ns + (pik_tick_ns(b, b->clk_shown_tick + period) - rise_ns) / 2;
        const struct trace_step steps[2] = {{rise_ns, BIT(PIK_LINE_CLK), BIT(PIK_LINE_CLK)},
                                            {fall_ns, BIT(PIK_LINE_CLK), 0}};
        trace_steps(&b->base.trace, steps, 2);
    }
}

void pik_lines_clock(struct pik *b, int64_t t_ns)
{
    while (report_clk(b, t_ns) < t_ns) continue;
}

/* ---- late observers ---- */

static void wake_clk(struct pik *b)
{
    const int64_t period = b->profile.grid, known_ns = b->base.trace.done_ns;
    const int64_t from_ns = known_ns > b->clk.t0_ns ? known_ns : b->clk.t0_ns;
    b->clk_shown_tick = (pik_tick_at(b, from_ns) + period) / period * period;
    put_from(b, BIT(PIK_LINE_CLK), false, known_ns); /* low until its next rise */
}

/* The pulses under way at the last look; those that were over by then are not shown, those since then are at the next. */
static void wake_pulses(struct pik *b)
{
    for (unsigned i = 0; i < PIK_AXES; i++) {
        struct pik_channel *c = &b->channel[i];
        if (pik_axis_resetting(&c->axis) && c->shown_tick != c->axis.begun_tick)
            pik_lines_pulse(b, i, pik_tick_ns(b, c->axis.begun_tick));
    }
}

static void wake_lines(void *ctx, uint64_t mask)
{
    struct pik *b = ctx;
    if (!b->on) return;
    if (mask & BIT(PIK_LINE_CLK) && !trace_watched(&b->base.trace, BIT(PIK_LINE_CLK))) wake_clk(b);
    if (mask & PIK_PULSE_LINES) wake_pulses(b);
}

void pik_lines_init(struct pik *b)
{
    b->base.trace.source = (struct trace_source){.wake = wake_lines, .report = report_clk, .ctx = b};
}

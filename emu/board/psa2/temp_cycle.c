/* Where the temperature scan repeats itself.
 *
 * From the instant at which a conversion begins follow those of all later ones, as long as what its bursts left on the serial port
 * is over before the next word: by the edges of four clocks, and by the frames. All of these are the same after some time, if
 * their rates have a common measure. A conversion that begins at the same place of that time as an earlier one is followed by
 * the same ones, that much later. It happens soon: a burst that waits for a reading of the accelerometers goes on from where that
 * ends, wherever it came from. */
#include "board/psa2/internal.h"

static int64_t common_divisor(int64_t a, int64_t b)
{
    while (b) {
        const int64_t rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

static int64_t common_multiple(int64_t a, int64_t b)
{
    return a / common_divisor(a, b) * b;
}

/* The least time of whole nanoseconds that is a multiple of `counts` of a clock. */
static int64_t whole_ns(int64_t hz, int64_t counts)
{
    const int64_t span = counts * NS_PER_S;
    return span / common_divisor(span, hz);
}

/* 0: longer than a second. */
static int64_t unit_ns(const struct psa2 *b)
{
    const struct psa2_profile *p = &b->profile;
    const struct ads1282 *x = &b->adc[0];
    const int64_t each[] = {whole_ns(2 * (int64_t)p->sclk_hz, 1), whole_ns(2 * (int64_t)p->fclk_hz, 1),
                            whole_ns(b->tadc.clkin.hz, b->tadc.clkin.div),
                            whole_ns(x->clk.hz, x->timing.period_tclk * x->clk.div)};
    int64_t unit = 1;
    for (unsigned i = 0; i < sizeof each / sizeof *each; i++) {
        if (each[i] > NS_PER_S) return 0;
        unit = common_multiple(unit, each[i]);
        if (unit > NS_PER_S) return 0;
    }
    return unit;
}

void psa2_cycle_begin(struct psa2 *b)
{
    const struct clk *clkin = &b->tadc.clkin;
    b->lazy.cycle = (struct psa2_cycle){.unit_tau = unit_ns(b) * clkin->hz / clkin->div / NS_PER_S};
}

void psa2_cycle_break(struct psa2_cycle *c)
{
    if (c->span.tau == 0) c->n = 0;
}

static void close_cycle(struct psa2_cycle *c, unsigned from, struct psa2_start next)
{
    c->span = (struct psa2_start){next.tau - c->at[from].tau, next.sync_ns - c->at[from].sync_ns};
    c->n -= from;
    for (unsigned i = 0; i < c->n; i++) c->at[i] = c->at[i + from];
}

/* One that was noted, whole units before; n: none. */
static unsigned find_place(const struct psa2_cycle *c, int64_t start_tau, int64_t unit_tau)
{
    unsigned i = 0;
    while (i < c->n && (start_tau - c->at[i].tau) % unit_tau != 0) i++;
    return i;
}

void psa2_cycle_note(struct psa2_cycle *c, struct psa2_start at)
{
    if (c->unit_tau == 0 || c->span.tau > 0) return;
    const unsigned i = find_place(c, at.tau, c->unit_tau);
    if (i < c->n) {
        close_cycle(c, i, at);
        return;
    }
    if (c->n == PSA2_CYCLE_MAX) c->n = 0; /* it may begin later */
    c->at[c->n++] = at;
}

uint32_t psa2_cycle_pass(const struct psa2_cycle *c, struct psa2_start *at, int64_t until_ns)
{
    if (c->span.tau == 0) return 0;
    const unsigned from = find_place(c, at->tau, c->span.tau);
    if (from == c->n) return 0;
    const int64_t before = (at->tau - c->at[from].tau) / c->span.tau; /* cycles */
    const int64_t left_ns = until_ns - c->at[from].sync_ns - before * c->span.sync_ns;
    if (left_ns < 0) return 0;
    int64_t turns = before + left_ns / c->span.sync_ns;
    unsigned i = from, passed = 0;
    for (;; passed++) {
        const bool wraps = i + 1 == c->n;
        const unsigned next = wraps ? 0 : i + 1;
        if (c->at[next].sync_ns + (turns + wraps) * c->span.sync_ns > until_ns) break;
        turns += wraps;
        i = next;
    }
    *at = (struct psa2_start){c->at[i].tau + turns * c->span.tau, c->at[i].sync_ns + turns * c->span.sync_ns};
    return (uint32_t)(left_ns / c->span.sync_ns) * c->n + passed;
}

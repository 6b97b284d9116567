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
    if (c->span_tau == 0) c->n = 0;
}

/* From place i on. */
static void close_cycle(struct psa2_cycle *c, unsigned i, int64_t span_tau)
{
    const int64_t from_tau = c->off_tau[i];
    c->n -= i;
    c->first_tau += from_tau;
    c->span_tau = span_tau;
    for (unsigned k = 0; k < c->n; k++) c->off_tau[k] = c->off_tau[k + i] - from_tau;
}

void psa2_cycle_note(struct psa2_cycle *c, int64_t start_tau)
{
    if (c->unit_tau == 0 || c->span_tau > 0 || c->n >= PSA2_CYCLE_MAX) return;
    if (c->n == 0) c->first_tau = start_tau;
    const int64_t off_tau = start_tau - c->first_tau;
    for (unsigned i = 0; i < c->n; i++) {
        const int64_t span_tau = off_tau - c->off_tau[i];
        if (span_tau % c->unit_tau != 0) continue;
        close_cycle(c, i, span_tau);
        return;
    }
    c->off_tau[c->n++] = off_tau;
}

uint32_t psa2_cycle_pass(const struct psa2_cycle *c, int64_t *start_tau, int64_t until_tau)
{
    if (c->span_tau == 0 || until_tau <= *start_tau) return 0;
    const int64_t off_tau = (*start_tau - c->first_tau) % c->span_tau;
    unsigned i = 0;
    while (i < c->n && c->off_tau[i] != off_tau) i++;
    if (i == c->n) return 0;
    const int64_t left_tau = until_tau - *start_tau, cycles = left_tau / c->span_tau;
    const int64_t most_tau = off_tau + left_tau - cycles * c->span_tau; /* of the last cycle, which may reach into another */
    unsigned k = i, turned = 0;
    for (;;) {
        const unsigned next = k + 1 < c->n ? k + 1 : 0;
        if (c->off_tau[next] + (next == 0 || turned) * c->span_tau > most_tau) break;
        turned |= next == 0;
        k = next;
    }
    *start_tau += cycles * c->span_tau + c->off_tau[k] + turned * c->span_tau - off_tau;
    return (uint32_t)(cycles * c->n) + k + turned * c->n - i;
}

#include "chip/ad7712/internal.h"

/* The chip's own SCLK: first fall 4 tau after the frame's begin, low for three halves of a tau, high for one (sources 3.4). */
enum { FIRST_TAU = 4, LOW_HALVES = 3, PERIOD_HALVES = 4, HOLD_NS = 30 };

static bool in_frame(const struct ad7712 *a)
{
    return (a->port.reading && !a->port.rfs) || a->port.writing;
}

/* Inside a frame moving A0 is a breach, and garbles where the chip is strict; else it still counts for a write before its
 * first SCLK. Between two parts of a read it gives up the rest. */
void ad7712_a0_pin(struct ad7712 *a, bool level, int64_t t_ns)
{
    struct ad7712_port *p = &a->port;
    if (level == p->a0) return;
    p->a0 = level;
    p->a0_ns = t_ns;
    if (!in_frame(a)) {
        p->reading = false;
        return;
    }
    a->n.a0_violations++;
    p->garbled |= a->cfg.strict_timing;
}

void ad7712_rfs_pin(struct ad7712 *a, bool level, int64_t t_ns)
{
    if (level == a->port.rfs) return;
    a->port.rfs = level;
    if (ad7712_deaf(a)) return;
    if (level) ad7712_end_read(a, t_ns);
    else ad7712_begin_read(a, t_ns);
}

void ad7712_tfs_pin(struct ad7712 *a, bool level, int64_t t_ns)
{
    if (level == a->port.tfs) return;
    a->port.tfs = level;
    if (ad7712_deaf(a)) return;
    if (level) ad7712_end_write(a, t_ns);
    else ad7712_begin_write(a, t_ns);
}

static void clock_edge(struct ad7712 *a, bool level, int64_t t_ns)
{
    if (ad7712_deaf(a)) return;
    if (level) ad7712_clock_rise(a, t_ns);
    else ad7712_clock_fall(a, t_ns);
}

void ad7712_sclk_pin(struct ad7712 *a, bool level, int64_t t_ns)
{
    if (level == a->port.sclk) return;
    a->port.sclk = level;
    if (!a->port.mode) clock_edge(a, level, t_ns);
}

void ad7712_sdata_pin(struct ad7712 *a, bool level, int64_t t_ns)
{
    struct ad7712_port *p = &a->port;
    if (level == p->sdata) return;
    p->sdata = level;
    p->sdata_ns = t_ns;
    if (!p->writing || !p->clocked || p->mode || t_ns - p->rise_ns >= HOLD_NS) return;
    a->n.sdata_violations++;
    p->garbled |= a->cfg.strict_timing;
}

/* A frame under way is lost. */
void ad7712_mode_pin(struct ad7712 *a, bool level, int64_t t_ns)
{
    if (level == a->port.mode) return;
    ad7712_port_forget(a, t_ns);
    a->port.mode = level;
}

bool ad7712_sdata_driven(const struct ad7712 *a, int64_t t_ns)
{
    return t_ns < a->port.change_ns ? a->port.driven : a->port.driven_next;
}

bool ad7712_sdata(const struct ad7712 *a, int64_t t_ns)
{
    if (!ad7712_sdata_driven(a, t_ns)) return false;
    if (a->fault.dout) return a->fault.dout == CHIP_STUCK_HIGH;
    return t_ns < a->port.change_ns ? a->port.out : a->port.out_next;
}

bool ad7712_sclk(const struct ad7712 *a)
{
    return a->port.clock;
}

/* ---- whole words ---- */

/* All limits of the edges are kept, so that each bit is what the register holds. */
static bool within_limits(const struct ad7712 *a, unsigned bits, const struct ad7712_sclk *c)
{
    const struct ad7712_port *p = &a->port;
    const int64_t pulse_ns = ad7712_tau_ns(a, 2);
    const int64_t low_ns = c->period_ns - c->high_ns;
    return p->reading && !p->rfs && !p->mode && !p->sclk && !p->clocked && p->index == 0 && bits == p->width &&
           c->first_rise_ns >= p->change_ns && c->first_rise_ns - p->fall_ns >= pulse_ns &&
           c->first_rise_ns - p->rise_ns >= ad7712_tau_ns(a, 5) && c->period_ns >= ad7712_tau_ns(a, 5) &&
           c->high_ns >= pulse_ns && low_ns >= pulse_ns && low_ns >= ad7712_bit_access_ns(a);
}

static uint32_t read_edges(struct ad7712 *a, unsigned bits, const struct ad7712_sclk *c)
{
    uint32_t word = 0;
    for (unsigned i = 0; i < bits; i++) {
        const int64_t rise_ns = c->first_rise_ns + (int64_t)i * c->period_ns;
        ad7712_sclk_pin(a, true, rise_ns);
        word = word << 1 | ad7712_sdata(a, rise_ns);
        ad7712_sclk_pin(a, false, rise_ns + c->high_ns);
    }
    return word;
}

uint32_t ad7712_read_word(struct ad7712 *a, unsigned bits, const struct ad7712_sclk *c)
{
    struct ad7712_port *p = &a->port;
    if (!within_limits(a, bits, c)) return read_edges(a, bits, c);
    const uint32_t all = bits == 24 ? 0xFFFFFFu : 0xFFFFu;
    const uint32_t word = p->garbled ? all : p->shift >> (24 - bits) & all;
    p->rise_ns = c->first_rise_ns + (int64_t)(bits - 1) * c->period_ns;
    p->fall_ns = p->rise_ns + c->high_ns;
    p->index = (uint8_t)bits;
    p->driven = p->driven_next = true; /* as the edges leave them */
    p->out = word & 1;
    p->out_next = false;
    p->change_ns = p->fall_ns + ad7712_bit_access_ns(a);
    if (a->io.sdata) sched_at(a->sched, &a->sdata_ev, p->change_ns);
    ad7712_word_over(a, p->fall_ns);
    return chip_fault_word(a->fault.dout, word, all);
}

/* Data change with the falls of SCLK, the first bit with the frame's begin. */
void ad7712_write_word(struct ad7712 *a, uint32_t word, unsigned bits, const struct ad7712_sclk *c)
{
    const int64_t low_ns = c->period_ns - c->high_ns;
    for (unsigned i = 0; i < bits; i++) {
        const int64_t rise_ns = c->first_rise_ns + (int64_t)i * c->period_ns;
        ad7712_sdata_pin(a, word >> (bits - 1 - i) & 1, rise_ns - low_ns);
        ad7712_sclk_pin(a, true, rise_ns);
        ad7712_sclk_pin(a, false, rise_ns + c->high_ns);
    }
}

/* ---- self-clocking ---- */

static int64_t half_ns(const struct ad7712 *a, int64_t halves)
{
    return a->port.clock_ns + clk_span_ns(2 * a->clkin.hz, halves);
}

static void set_clock(struct ad7712 *a, bool level, int64_t t_ns)
{
    if (level == a->port.clock) return;
    a->port.clock = level;
    if (a->io.sclk) a->io.sclk(a->io.ctx, level, t_ns);
}

/* Half-tau from the first fall of SCLK to its edge number i: falls are even. */
static int64_t edge_halves(int64_t i)
{
    return i / 2 * PERIOD_HALVES + (i % 2 ? LOW_HALVES : 0);
}

void ad7712_own_clock(struct ad7712 *a, int64_t t_ns)
{
    a->port.clock_half = 0;
    a->port.clock_ns = t_ns + ad7712_tau_ns(a, FIRST_TAU);
    sched_at(a->sched, &a->clock_ev, a->port.clock_ns);
}

void ad7712_stop_clock(struct ad7712 *a, int64_t t_ns)
{
    sched_cancel(a->sched, &a->clock_ev);
    set_clock(a, true, t_ns);
}

/* After the last rise SCLK stays high; where its fall would be the frame is over inside (E0). */
static void on_clock(void *ctx, int64_t t_ns)
{
    struct ad7712 *a = ctx;
    const struct ad7712_port *p = &a->port;
    const int64_t i = a->port.clock_half++;
    const int64_t bits = p->writing ? 24 : p->width;
    const bool level = i % 2;
    if (i < 2 * bits) set_clock(a, level, t_ns);
    clock_edge(a, level, t_ns);
    if (i < 2 * bits) sched_at(a->sched, &a->clock_ev, half_ns(a, edge_halves(i + 1)));
}

void ad7712_pins_init(struct ad7712 *a)
{
    sched_ev_inner(&a->clock_ev, on_clock, a);
}

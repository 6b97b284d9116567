/* Exact edges of a clock whose frequency is hz / div.
 *
 * Edges come from a count, never from a rounded period: 4.096 MHz is 244.140625 ns, and adding 244 loses 2.1 s an hour.
 * Count k is a rising edge; for half periods use a clock of twice the frequency. All functions are pure. */
#ifndef PSABENCH_BASE_CLK_H
#define PSABENCH_BASE_CLK_H

#include <stdint.h>

struct clk {
    int64_t t0_ns; /* instant of edge 0 */
    int64_t hz;    /* 1 Hz .. 1 GHz */
    int64_t div;   /* >= 1: one edge every div counts of hz, so 4.096 MHz / 3 is exact */
};

/* ns of k counts of hz, rounded down. k * div < 2^53 and hz <= 1 GHz keep it inside int64. */
static inline int64_t clk_span_ns(int64_t hz, int64_t counts)
{
    return counts / hz * 1000000000 + counts % hz * 1000000000 / hz;
}

static inline int64_t clk_edge_ns(const struct clk *c, int64_t k)
{
    return c->t0_ns + clk_span_ns(c->hz, k * c->div);
}

/* First edge at or after t_ns (t_ns >= t0_ns). */
static inline int64_t clk_count_at(const struct clk *c, int64_t t_ns)
{
    const int64_t dt_ns = t_ns - c->t0_ns;
    const int64_t counts = dt_ns / 1000000000 * c->hz + dt_ns % 1000000000 * c->hz / 1000000000;
    int64_t k = counts / c->div;
    while (clk_edge_ns(c, k) < t_ns) k++;
    return k;
}

/* Edge after edge without a division, each equal to clk_edge_ns(). t_ns is the instant of the present one. */
struct clk_walk {
    int64_t t_ns;
    int64_t rest; /* of t_ns, in 1/hz ns: 0 .. hz - 1 */
    int64_t hz, step_ns, step_rest;
};

/* At edge k of the clock, to go on in steps of `every` edges. */
static inline struct clk_walk clk_walk(const struct clk *c, int64_t k, int64_t every)
{
    const int64_t step = every * c->div;
    return (struct clk_walk){.t_ns = clk_edge_ns(c, k),
                             .rest = k * c->div % c->hz * 1000000000 % c->hz,
                             .hz = c->hz,
                             .step_ns = clk_span_ns(c->hz, step),
                             .step_rest = step % c->hz * 1000000000 % c->hz};
}

static inline void clk_walk_on(struct clk_walk *w)
{
    w->t_ns += w->step_ns;
    w->rest += w->step_rest;
    if (w->rest < w->hz) return;
    w->rest -= w->hz;
    w->t_ns++;
}

#endif

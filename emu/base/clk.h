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

#endif

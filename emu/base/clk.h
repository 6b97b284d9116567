/* Exact edges of a clock whose frequency is hz / div.
 *
 * Edges come from a count, never from a rounded period: 4.096 MHz is 244.140625 ns, and adding 244 loses 2.1 s an hour.
 * Count k is a rising edge; for half periods use a clock of twice the frequency. All functions are pure. */
#ifndef PSABENCH_BASE_CLK_H
#define PSABENCH_BASE_CLK_H

#include <stdbool.h>
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

/* An edge and what its instant was rounded by: from here on steps need no division. */
struct clk_pos {
    int64_t k, t_ns; /* t_ns as clk_edge_ns() gives it */
    int64_t rest;    /* beyond t_ns, in 1/hz ns: 0 .. hz - 1 */
};

/* A way of k edges; back, if k is negative. rest is never negative. */
struct clk_step {
    int64_t k, ns, rest, hz;
};

static inline struct clk_step clk_step(const struct clk *c, int64_t k)
{
    const int64_t counts = (k < 0 ? -k : k) * c->div;
    const int64_t ns = clk_span_ns(c->hz, counts);
    const int64_t rest = counts % c->hz * 1000000000 % c->hz;
    if (k >= 0) return (struct clk_step){k, ns, rest, c->hz};
    return (struct clk_step){k, -ns - (rest > 0), rest > 0 ? c->hz - rest : 0, c->hz};
}

static inline struct clk_pos clk_pos(const struct clk *c, int64_t k)
{
    const struct clk_step s = clk_step(c, k);
    return (struct clk_pos){k, c->t0_ns + s.ns, s.rest};
}

/* First edge at or after t_ns (t_ns >= t0_ns). Edge floor(dt hz / 10^9 / div) is at or before; it is the one when its exact
 * instant is not before dt, else the next is. Counted from the second that has begun: one division that is not by 10^9. */
static inline struct clk_pos clk_pos_at(const struct clk *c, int64_t t_ns)
{
    const int64_t s = (t_ns - c->t0_ns) / 1000000000;
    const int64_t rest_ns = (t_ns - c->t0_ns) % 1000000000;
    const int64_t before = s * c->hz + rest_ns * c->hz / 1000000000;
    int64_t k = c->div == 1 ? before : before / c->div;
    k += (k * c->div - s * c->hz) * 1000000000 < rest_ns * c->hz;
    const int64_t exact = (k * c->div - s * c->hz) * 1000000000; /* in 1/hz ns from that second on */
    return (struct clk_pos){k, c->t0_ns + s * 1000000000 + exact / c->hz, exact % c->hz};
}

static inline int64_t clk_count_at(const struct clk *c, int64_t t_ns)
{
    return clk_pos_at(c, t_ns).k;
}

static inline struct clk_pos clk_on(struct clk_pos p, const struct clk_step *s)
{
    p.k += s->k;
    p.t_ns += s->ns;
    p.rest += s->rest;
    if (p.rest >= s->hz) {
        p.rest -= s->hz;
        p.t_ns++;
    }
    return p;
}

/* The latest edge of p, p + s, p + 2 s ... at or before t_ns, which is not before p; s goes forward. */
static inline struct clk_pos clk_on_to(struct clk_pos p, const struct clk_step *s, int64_t t_ns)
{
    const int64_t n = (t_ns - p.t_ns) / (s->ns + 1); /* never too many */
    const int64_t rest = p.rest + n * s->rest;
    p = (struct clk_pos){p.k + n * s->k, p.t_ns + n * s->ns + rest / s->hz, rest % s->hz};
    for (struct clk_pos next; next = clk_on(p, s), next.t_ns <= t_ns;) p = next;
    return p;
}

#endif

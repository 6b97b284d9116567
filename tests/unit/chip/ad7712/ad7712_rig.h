/* One AD7712 for the tests: on a 10 MHz clock, external clocking, powered up at 0, SCLK 1.25 MHz as the article's 1M25. */
#ifndef PSABENCH_TESTS_AD7712_RIG_H
#define PSABENCH_TESTS_AD7712_RIG_H

#include "rig.h"

#include "chip/ad7712/ad7712.h"

#include <math.h>
#include <string.h>

#define EDGES_MAX 8192u

struct edge {
    int64_t t_ns;
    bool level;
};

struct edges {
    struct edge e[EDGES_MAX];
    unsigned n;
};

struct rig {
    struct sched s;
    struct ad7712 a;
    double v[AD7712_CHANNELS], ohm[AD7712_CHANNELS];
    double (*signal)(int64_t t_ns); /* in place of v[], if there */
    struct edges drdy, sdata, sclk;
    unsigned looks;
    int64_t look_ns[512]; /* the latest at looks % 512 */
};

/* tau 100 ns; a frame: A0, 400 ns, RFS (TFS), 700 ns, SCLK rises every 800 ns and falls 400 ns later, 500 ns, RFS high. */
enum { TAU_NS = 100, A0_NS = 400, FIRST_NS = 700, SCLK_NS = 800, HIGH_NS = 400, LAST_NS = 500, MOD_NS = 51200 };

static inline double vin_v(void *ctx, unsigned channel, int64_t t_ns)
{
    struct rig *r = ctx;
    r->look_ns[r->looks++ % COUNT(r->look_ns)] = t_ns;
    return r->signal ? r->signal(t_ns) : r->v[channel];
}

static inline double source_ohm(void *ctx, unsigned channel, int64_t t_ns)
{
    (void)t_ns;
    return ((struct rig *)ctx)->ohm[channel];
}

static inline void note(struct edges *e, bool level, int64_t t_ns)
{
    if (e->n < EDGES_MAX) e->e[e->n++] = (struct edge){t_ns, level};
}

static inline void on_drdy(void *ctx, bool level, int64_t t_ns)
{
    note(&((struct rig *)ctx)->drdy, level, t_ns);
}

static inline void on_sdata(void *ctx, bool level, int64_t t_ns)
{
    note(&((struct rig *)ctx)->sdata, level, t_ns);
}

static inline void on_sclk(void *ctx, bool level, int64_t t_ns)
{
    note(&((struct rig *)ctx)->sclk, level, t_ns);
}

static const struct ad7712_cfg quiet = {.clkin_hz = 10000000, .vref_v = 2.5};

static inline void power_up_seeded(struct rig *r, const struct ad7712_cfg *cfg, uint64_t seed)
{
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    const struct ad7712_io io = {
        .ctx = r, .vin_v = vin_v, .source_ohm = source_ohm, .drdy = on_drdy, .sdata = on_sdata, .sclk = on_sclk};
    ad7712_init(&r->a, cfg, &io, &r->s, draws_of(seed, 1, "adc.x"));
    ad7712_power_up(&r->a, 0);
}

static inline void power_up(struct rig *r, const struct ad7712_cfg *cfg)
{
    power_up_seeded(r, cfg, 1);
}

static inline void wait_ns(struct rig *r, int64_t ns)
{
    sched_run_until(&r->s, r->s.now_ns + ns);
}

static inline void wait_until(struct rig *r, int64_t t_ns)
{
    sched_run_until(&r->s, t_ns);
}

/* Runs to the next fall of DRDY and returns its instant. */
static inline int64_t await_fall(struct rig *r)
{
    for (unsigned seen = r->drdy.n;;) {
        const int64_t next_ns = sched_next_ns(&r->s);
        assert_true(next_ns != SCHED_NEVER && r->drdy.n < EDGES_MAX);
        sched_run_until(&r->s, next_ns);
        for (; seen < r->drdy.n; seen++) {
            if (!r->drdy.e[seen].level) return r->drdy.e[seen].t_ns;
        }
    }
}

static inline void a0(struct rig *r, bool level)
{
    ad7712_a0_pin(&r->a, level, r->s.now_ns);
    wait_ns(r, A0_NS);
}

static inline void rfs(struct rig *r, bool level)
{
    ad7712_rfs_pin(&r->a, level, r->s.now_ns);
}

static inline void tfs(struct rig *r, bool level)
{
    ad7712_tfs_pin(&r->a, level, r->s.now_ns);
}

/* One pulse of SCLK, begun now; what SDATA says at its rise. */
static inline bool pulse(struct rig *r)
{
    ad7712_sclk_pin(&r->a, true, r->s.now_ns);
    const bool bit = ad7712_sdata(&r->a, r->s.now_ns);
    wait_ns(r, HIGH_NS);
    ad7712_sclk_pin(&r->a, false, r->s.now_ns);
    return bit;
}

static inline uint32_t pulses(struct rig *r, unsigned bits)
{
    uint32_t v = 0;
    for (unsigned i = 0; i < bits; i++) {
        if (i) wait_ns(r, SCLK_NS - HIGH_NS);
        v = v << 1 | pulse(r);
    }
    return v;
}

/* A read of `bits` bits with A0 at that level, edge by edge. */
static inline uint32_t read_frame(struct rig *r, bool level, unsigned bits)
{
    a0(r, level);
    rfs(r, false);
    wait_ns(r, FIRST_NS);
    const uint32_t v = pulses(r, bits);
    wait_ns(r, LAST_NS);
    rfs(r, true);
    wait_ns(r, LAST_NS);
    return v;
}

static inline void write_bits(struct rig *r, uint32_t word, unsigned bits)
{
    for (unsigned i = 0; i < bits; i++) {
        ad7712_sdata_pin(&r->a, word >> (bits - 1 - i) & 1, r->s.now_ns);
        wait_ns(r, SCLK_NS - HIGH_NS);
        pulse(r);
    }
}

static inline void write_frame(struct rig *r, bool level, uint32_t word, unsigned bits)
{
    a0(r, level);
    tfs(r, false);
    write_bits(r, word, bits);
    wait_ns(r, LAST_NS);
    tfs(r, true);
    wait_ns(r, LAST_NS);
}

static inline void write_control(struct rig *r, uint32_t word)
{
    write_frame(r, false, word, 24);
}

/* The control word, after the word that waits. */
static inline uint32_t read_control(struct rig *r)
{
    if (r->a.unread) read_frame(r, true, r->a.control & AD7712_CTL_WL ? 24 : 16);
    return read_frame(r, false, 24);
}

static inline void near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("got %.17g, want %.17g within %g", got, want, tolerance);
}

static inline uint32_t breaches(const struct rig *r)
{
    const struct ad7712_counters *n = &r->a.n;
    return n->a0_violations + n->sclk_violations + n->sdata_violations + n->frame_violations;
}

#endif

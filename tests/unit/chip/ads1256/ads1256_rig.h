/* One ADS1256 for the tests: on a 7.68 MHz clock, CS low, powered up at 0, SCLK 1.9 MHz. */
#ifndef PSABENCH_TESTS_ADS1256_RIG_H
#define PSABENCH_TESTS_ADS1256_RIG_H

#include "rig.h"

#include "chip/ads1256/ads1256.h"

#include <math.h>
#include <string.h>

#define EDGES_MAX 4096u

struct rig {
    struct sched s;
    struct ads1256 a;
    double v[9]; /* AIN0..7, AINCOM */
    struct edge {
        int64_t t_ns;
        bool level;
    } edge[EDGES_MAX];
    unsigned edges;
    double ohm[9]; /* behind them, for chips that look at it */
    unsigned gpio_calls, dout_calls;
    bool gpio[4], dout;
};

/* A byte: SCLK rises after FIRST_NS and then every SCLK_NS, falls HIGH_NS later; its last fall is at BYTE_NS. */
enum { BYTE_NS = 4200, FIRST_NS = 260, SCLK_NS = 525, HIGH_NS = 265, T6_NS = 6600, T11_NS = 3200 };

static inline double ain_v(void *ctx, unsigned ain, int64_t t_ns)
{
    (void)t_ns;
    return ((struct rig *)ctx)->v[ain];
}

static inline void on_drdy(void *ctx, bool level, int64_t t_ns)
{
    struct rig *r = ctx;
    if (r->edges < EDGES_MAX) r->edge[r->edges++] = (struct edge){t_ns, level};
}

static const struct ads1256_cfg quiet = {.clkin_hz = 7680000, .vref_v = 2.5};

static inline void power_up_io(struct rig *r, const struct ads1256_cfg *cfg, struct ads1256_io io, uint64_t seed)
{
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    io.ctx = r;
    ads1256_init(&r->a, cfg, &io, &r->s, draws_of(seed, 1, "adc.t"));
    ads1256_power_up(&r->a, 0);
    ads1256_cs_pin(&r->a, false, 0);
}

static inline void power_up(struct rig *r, const struct ads1256_cfg *cfg, uint64_t seed)
{
    power_up_io(r, cfg, (struct ads1256_io){.ain_v = ain_v, .drdy = on_drdy}, seed);
}

static inline void wait_ns(struct rig *r, int64_t ns)
{
    sched_run_until(&r->s, r->s.now_ns + ns);
}

/* Runs to the next fall of DRDY and returns its instant. */
static inline int64_t await_fall(struct rig *r)
{
    for (unsigned seen = r->edges;;) {
        const int64_t next_ns = sched_next_ns(&r->s);
        assert_true(next_ns != SCHED_NEVER && r->edges < EDGES_MAX);
        sched_run_until(&r->s, next_ns);
        for (; seen < r->edges; seen++) {
            if (!r->edge[seen].level) return r->edge[seen].t_ns;
        }
    }
}

/* Up, calibrated at the default settings, first word ready. */
static inline void rig_up_seeded(struct rig *r, const struct ads1256_cfg *cfg, uint64_t seed)
{
    power_up(r, cfg, seed);
    await_fall(r);
}

static inline void rig_up(struct rig *r, const struct ads1256_cfg *cfg)
{
    rig_up_seeded(r, cfg, 1);
}

static inline uint8_t xfer(struct rig *r, uint8_t mosi)
{
    wait_ns(r, FIRST_NS);
    spi_first(&r->a.spi, r->s.now_ns);
    wait_ns(r, BYTE_NS - FIRST_NS);
    return spi_byte(&r->a.spi, mosi, r->s.now_ns);
}

/* A command with the t11 after it. */
static inline void command(struct rig *r, uint8_t opcode)
{
    xfer(r, opcode);
    wait_ns(r, T11_NS);
}

static inline void wreg(struct rig *r, uint8_t addr, uint8_t value)
{
    xfer(r, 0x50 | addr);
    xfer(r, 0);
    command(r, value);
}

static inline uint8_t rreg(struct rig *r, uint8_t addr)
{
    xfer(r, 0x10 | addr);
    xfer(r, 0);
    wait_ns(r, T6_NS);
    const uint8_t value = xfer(r, 0);
    wait_ns(r, T11_NS);
    return value;
}

static inline int32_t read_word(struct rig *r)
{
    int32_t v = 0;
    for (int i = 0; i < 3; i++) v = v << 8 | xfer(r, 0);
    return (v ^ 0x800000) - 0x800000;
}

static inline int32_t rdata(struct rig *r)
{
    xfer(r, 0x01);
    wait_ns(r, T6_NS);
    const int32_t v = read_word(r);
    wait_ns(r, T11_NS);
    return v;
}

/* Slow rate without ACAL, FSC and OFC recalculated: what the tests of the codes start from. */
static inline void set_rate(struct rig *r, uint8_t drate)
{
    wreg(r, ADS1256_DRATE, drate);
    xfer(r, 0xF0);
    await_fall(r);
}

static inline int64_t tau_ns(int64_t tau)
{
    return clk_span_ns(7680000, tau);
}

static inline void near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("got %.17g, want %.17g within %g", got, want, tolerance);
}

#endif

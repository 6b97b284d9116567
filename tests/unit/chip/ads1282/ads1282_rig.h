/* One ADS1281/ADS1282, its clock, its input and a bus master, for the tests of the chip at its pins. */
#ifndef PSABENCH_TESTS_ADS1282_RIG_H
#define PSABENCH_TESTS_ADS1282_RIG_H

#include "rig.h"

#include "chip/ads1282/ads1282.h"

#include <math.h>
#include <string.h>

#define MCLK_HZ   4096000
#define BIT_TCLK  4 /* SCLK 1.024 MHz */
#define T_DR_1000 258436

static inline void hex_is(uint32_t got, uint32_t want)
{
    if (got != want) fail_msg("got %08X, want %08X", (unsigned)got, (unsigned)want);
}

static inline void near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("got %.17g, want %.17g within %g", got, want, tolerance);
}

/* One chip, its clock, and a bus master that counts tCLK. */
struct rig {
    struct sched s;
    struct ads1282 a;
    struct clk clk;
    double v, ramp_v_per_s; /* input: v + ramp t + sine */
    double sine_v, sine_hz;
    int64_t tclk; /* the master's time */
    int gap_tclk; /* from the last rise of a byte to the first of the next */
    enum bus { BYTES, BITS, PINS } bus;
    unsigned falls, rises, asked_mux, samples, mflags, clocks;
    int64_t fall_ns, rise_ns, first_sample_ns, last_sample_ns, mflag_ns;
    bool mflag;
};

static inline double input(void *ctx, unsigned mux, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_true(t_ns >= r->last_sample_ns && t_ns <= r->s.now_ns);
    if (r->samples++ == 0) r->first_sample_ns = t_ns;
    r->last_sample_ns = t_ns;
    r->asked_mux = mux;
    const double t_s = (double)t_ns * 1e-9;
    const double sine_v = r->sine_v != 0.0 ? r->sine_v * sin(6.283185307179586 * r->sine_hz * t_s) : 0.0;
    return r->v + r->ramp_v_per_s * t_s + sine_v;
}

static inline void drdy(void *ctx, bool level, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_int_equal(level, ads1282_drdy(&r->a));
    if (level) r->rises++, r->rise_ns = t_ns;
    else r->falls++, r->fall_ns = t_ns;
}

static inline void mflag(void *ctx, bool level, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_int_not_equal(level, r->mflag);
    assert_int_equal(t_ns, r->s.now_ns);
    r->mflag = level;
    r->mflags++;
    r->mflag_ns = t_ns;
}

static const struct ads1282_cfg quiet = {.part = ADS1282_PART_1282, .clk_hz = MCLK_HZ, .vref_v = 5.0};

/* io: what beyond input and DRDY is connected. */
static inline void wired(struct rig *r, const struct ads1282_cfg *cfg, uint64_t seed, struct ads1282_io io)
{
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    r->clk = (struct clk){.hz = cfg->clk_hz, .div = 1};
    r->gap_tclk = 24;
    io.ctx = r;
    io.vin_v = input;
    io.drdy = drdy;
    ads1282_init(&r->a, cfg, &io, &r->s, draws_of(seed, 1, "adc"));
}

static inline void unpowered(struct rig *r, const struct ads1282_cfg *cfg, uint64_t seed)
{
    wired(r, cfg, seed, (struct ads1282_io){0});
}

static inline void powered(struct rig *r, const struct ads1282_cfg *cfg)
{
    unpowered(r, cfg, 1);
    ads1282_power_up(&r->a, 0);
}

static inline int64_t at_tclk(struct rig *r, int64_t tclk)
{
    r->tclk = tclk;
    const int64_t t_ns = clk_edge_ns(&r->clk, tclk);
    if (t_ns > r->s.now_ns) sched_run_until(&r->s, t_ns); /* a byte by pins ends 2 tCLK after its last rise */
    return t_ns;
}

/* To the next DRDY fall; 0 when there is none within 300 ms. */
static inline int64_t to_fall(struct rig *r)
{
    const unsigned falls = r->falls;
    const int64_t limit_ns = r->s.now_ns + 300000000;
    while (r->falls == falls && sched_next_ns(&r->s) <= limit_ns) sched_run_until(&r->s, sched_next_ns(&r->s));
    if (r->falls == falls) sched_run_until(&r->s, limit_ns);
    r->tclk = clk_count_at(&r->clk, r->s.now_ns);
    return r->falls == falls ? 0 : r->fall_ns;
}

/* Eight bits by the pins: DIN moves with SCLK's fall, DOUT is looked at before its rise. */
static inline uint8_t byte_by_pins(struct rig *r, uint8_t mosi, int64_t rise)
{
    uint8_t miso = 0;
    for (int i = 0; i < 8; i++) {
        ads1282_din_pin(&r->a, (mosi >> (7 - i)) & 1, at_tclk(r, rise + i * BIT_TCLK - BIT_TCLK / 2));
        const int64_t t_ns = at_tclk(r, rise + i * BIT_TCLK);
        miso = (uint8_t)((miso << 1) | ads1282_dout(&r->a));
        ads1282_sclk_pin(&r->a, true, t_ns);
        ads1282_sclk_pin(&r->a, false, at_tclk(r, rise + i * BIT_TCLK + BIT_TCLK / 2));
    }
    r->tclk -= BIT_TCLK / 2; /* gaps count from the last rise */
    return miso;
}

static inline uint8_t byte_by_bits(struct rig *r, uint8_t mosi, int64_t rise)
{
    uint8_t miso = 0;
    for (int i = 0; i < 8; i++) {
        const int64_t t_ns = at_tclk(r, rise + i * BIT_TCLK);
        miso = (uint8_t)((miso << 1) | spi_miso(&r->a.spi));
        spi_sample(&r->a.spi, (mosi >> (7 - i)) & 1, t_ns);
        if (i == 0) spi_first(&r->a.spi, at_tclk(r, rise + BIT_TCLK / 2));
    }
    return miso;
}

/* One byte in SPI mode 0, its first rise a gap after the previous byte's last. */
static inline uint8_t byte(struct rig *r, uint8_t mosi)
{
    const int64_t rise = r->tclk + r->gap_tclk;
    if (r->bus == PINS) return byte_by_pins(r, mosi, rise);
    if (r->bus == BITS) return byte_by_bits(r, mosi, rise);
    spi_first(&r->a.spi, at_tclk(r, rise + BIT_TCLK / 2));
    return spi_byte(&r->a.spi, mosi, at_tclk(r, rise + 7 * BIT_TCLK));
}

static inline void send(struct rig *r, unsigned n, const uint8_t *bytes)
{
    for (unsigned i = 0; i < n; i++) byte(r, bytes[i]);
}

#define SEND(r, ...) send(r, sizeof((uint8_t[]){__VA_ARGS__}), (const uint8_t[]){__VA_ARGS__})

static inline uint32_t read_bytes(struct rig *r, unsigned n)
{
    uint32_t word = 0;
    while (n-- > 0) word = (word << 8) | byte(r, 0);
    return word;
}

static inline uint8_t rreg(struct rig *r, uint8_t addr)
{
    SEND(r, (uint8_t)(0x20 | addr), 0x00);
    return byte(r, 0);
}

static inline void wreg(struct rig *r, uint8_t addr, uint8_t value)
{
    SEND(r, (uint8_t)(0x40 | addr), 0x00, value);
}

/* Word of a settled input. */
static inline uint32_t settled_word(struct rig *r)
{
    for (int i = 0; i < 64; i++) to_fall(r);
    return read_bytes(r, 4);
}

static inline double fraction(uint32_t word)
{
    return (double)((int64_t)(int32_t)word) * 0x1p-31;
}

#endif

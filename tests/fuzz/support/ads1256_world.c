#include "ads1256_world.h"

#include <math.h>
#include <string.h>

/* A word has 3 bytes, and RREG of 16 registers sends 2 + 16: so many bytes of zeros are behind everything. */
enum { BEHIND_ALL = 3 + 2 + 16 };
enum {
    CONVERSIONS_MAX = 200,
    POSTPONED_MAX = 8,
    HIZ_TAU = 10 /* t9 */
};               /* of one run, with END_NS: what bounds its time */
#define END_NS (2 * NS_PER_S)

static double input(void *ctx, unsigned ain, int64_t t_ns)
{
    struct w1256 *w = ctx;
    assert(ain < ADS1256_INPUTS && t_ns == w->s.now_ns);
    return w->v[ain];
}

static double source_ohm(void *ctx, unsigned ain, int64_t t_ns)
{
    struct w1256 *w = ctx;
    assert(ain < ADS1256_INPUTS && t_ns == w->s.now_ns);
    return ain == 7 ? INFINITY : 1000.0 * ain;
}

static void mix(struct w1256 *w, uint64_t v)
{
    w->trail = (w->trail ^ v) * UINT64_C(0x9E3779B97F4A7C15);
    w->trail ^= w->trail >> 29;
}

/* Data period of a rate, counted in words of 256 tau; ns, rounded down. */
static int64_t period_ns(const struct w1256 *w, const struct ads1256_rate *r)
{
    return clk_span_ns(w->a.clkin.hz, (int64_t)r->navg * 256);
}

static int64_t least(int64_t a, int64_t b)
{
    return a < b ? a : b;
}

/* What may govern the next conversion: the rate of the run and the one that follows it. */
static void note_rate(struct w1256 *w)
{
    const struct ads1256 *a = &w->a;
    w->settle_ns = least(w->settle_ns, ads1256_settle_ns(a));
    w->period_ns = least(w->period_ns, period_ns(w, a->rate_next));
    if (a->rate) w->period_ns = least(w->period_ns, period_ns(w, a->rate));
}

/* A fall is a conversion, a data period after the last and no earlier than the settling time after a restart. */
static void fell(struct w1256 *w, int64_t t_ns)
{
    assert(w->a.mode == ADS1256_RUNNING);
    assert(w->a.n.conversions > w->conversions);
    note_rate(w);
    assert(t_ns - w->fall_ns >= w->period_ns - 1);
    assert(t_ns - w->restart_ns >= w->settle_ns - 1);
    w->conversions = w->a.n.conversions;
    w->fall_ns = t_ns;
    w->period_ns = INT64_MAX;
    note_rate(w);
}

static void on_drdy(void *ctx, bool level, int64_t t_ns)
{
    struct w1256 *w = ctx;
    assert(level != w->drdy && level == ads1256_drdy(&w->a));
    assert(t_ns >= w->drdy_ns && t_ns <= w->s.now_ns);
    w->drdy = level;
    w->drdy_ns = t_ns;
    mix(w, (uint64_t)t_ns << 1 | level);
    if (!level) fell(w, t_ns);
}

static void on_gpio(void *ctx, unsigned d, bool level, int64_t t_ns)
{
    struct w1256 *w = ctx;
    assert(d < ADS1256_GPIOS && ads1256_gpio_is_output(&w->a, d));
    mix(w, (uint64_t)t_ns << 4 | d << 1 | level);
}

/* ---- invariants ---- */

static void check_registers(const struct ads1256 *a)
{
    for (unsigned i = 0; i < ADS1256_REGS; i++) {
        const struct reg_spec *r = &a->regs.map[i];
        const uint8_t own = i == ADS1256_STATUS ? ADS1256_STATUS_DRDY : 0;
        assert(((a->value[i] ^ r->reset) & (uint8_t) ~(r->rw | own)) == 0);
    }
    assert((a->value[ADS1256_STATUS] & ADS1256_STATUS_DRDY) == ads1256_drdy(a));
}

static void check_counters(const struct ads1256_counters *was, const struct ads1256_counters *now)
{
    uint32_t a[sizeof *was / sizeof(uint32_t)], b[sizeof a / sizeof a[0]];
    memcpy(a, was, sizeof a);
    memcpy(b, now, sizeof b);
    for (unsigned i = 0; i < sizeof a / sizeof a[0]; i++) assert(b[i] >= a[i]);
}

static void check(struct w1256 *w)
{
    const struct ads1256 *a = &w->a;
    check_registers(a);
    check_counters(&w->seen, &a->n);
    w->seen = a->n;
    note_rate(w);
    assert(sched_next_ns(&w->s) > w->s.now_ns);
    assert(ads1256_drdy(a) == w->drdy);
    assert(a->word >= -0x800000 && a->word <= 0x7FFFFF);
    assert(ads1256_clkout_hz(a) <= a->clkin.hz);
    assert(a->pins.driven || ads1256_dout(a) == ADS1256_DOUT_IDLE);
}

/* ---- operations ---- */

static void wait_ns(struct w1256 *w, int64_t ns)
{
    sched_run_until(&w->s, w->s.now_ns + ns);
}

/* Eight periods of SCLK, low at both ends; returns what DOUT said. */
static uint8_t xfer_bytes(struct w1256 *w, uint8_t mosi, int64_t half_ns)
{
    spi_first(&w->a.spi, w->s.now_ns);
    wait_ns(w, 15 * half_ns);
    const uint8_t miso = spi_byte(&w->a.spi, mosi, w->s.now_ns);
    wait_ns(w, half_ns);
    return miso;
}

static uint8_t xfer_pins(struct w1256 *w, uint8_t mosi, int64_t half_ns)
{
    uint8_t miso = 0;
    for (int bit = 7; bit >= 0; bit--) {
        ads1256_sclk_pin(&w->a, true, w->s.now_ns);
        ads1256_din_pin(&w->a, mosi >> bit & 1, w->s.now_ns);
        wait_ns(w, half_ns);
        miso = (uint8_t)(miso << 1 | ads1256_dout(&w->a));
        ads1256_sclk_pin(&w->a, false, w->s.now_ns);
        wait_ns(w, half_ns);
    }
    return miso;
}

static bool twin(const struct w1256 *w)
{
    return w->drive == W1256_TWIN_BYTES || w->drive == W1256_TWIN_PINS;
}

/* Whether the moment is one at which bytes and pins are the same; waits for it for a while. */
static bool moment(struct w1256 *w, int64_t half_ns)
{
    for (unsigned i = 0; sched_next_ns(&w->s) <= w->s.now_ns + 16 * half_ns; i++) {
        if (i == POSTPONED_MAX) return false;
        sched_run_until(&w->s, sched_next_ns(&w->s));
    }
    return true;
}

/* Zeros in a row that the chip has taken. An edge lost to a strict chip is a bit that it has not shifted, and an SCLK that
 * stopped offers it a half read word again. */
static void note_quiet(struct w1256 *w, uint8_t mosi, const struct ads1256_counters *before)
{
    const bool whole = !w->a.cfg.strict_bus || w->a.n.sclk_violations == before->sclk_violations;
    const bool counts = whole && mosi == 0 && w->a.n.conversions == w->quiet_word;
    w->quiet = counts ? w->quiet + 1 : 0;
    w->quiet_word = w->a.n.conversions;
}

static void send(struct w1256 *w, uint8_t mosi, int64_t gap_ns, int64_t half_ns)
{
    wait_ns(w, gap_ns);
    if (twin(w) && !moment(w, half_ns)) return;
    const bool by_pins = w->drive == W1256_PINS || w->drive == W1256_TWIN_PINS;
    const struct ads1256_counters before = w->a.n;
    const uint8_t miso = by_pins ? xfer_pins(w, mosi, half_ns) : xfer_bytes(w, mosi, half_ns);
    if (twin(w)) wait_ns(w, clk_span_ns(w->a.clkin.hz, HIZ_TAU)); /* an event of the pins alone */
    mix(w, w->a.n.conversions == before.conversions ? miso : 0);
    note_quiet(w, mosi, &before);
    assert(w->quiet <= BEHIND_ALL || miso == ADS1256_DOUT_IDLE); /* no read past the word */
    assert(!w->a.cs || miso == ADS1256_DOUT_IDLE);
}

/* SCLK from 1.92 MHz down, T6 and T11 kept or not. */
static void op_byte(struct w1256 *w, struct script *s)
{
    const uint8_t mosi = script_byte(s);
    send(w, mosi, script_span_ns(s), 261);
}

static void op_zeros(struct w1256 *w, struct script *s)
{
    static const int64_t half_ns[] = {261, 400, 977, 3000};
    const unsigned n = script_byte(s) % 32;
    const int64_t half = half_ns[script_byte(s) % 4];
    for (unsigned i = 0; i < n; i++) send(w, 0, 7000, half);
}

static void op_write_register(struct w1256 *w, struct script *s)
{
    const uint8_t addr = script_byte(s) % 16;
    send(w, 0x50 | addr, 7000, 261);
    send(w, 0, 0, 261);
    send(w, script_byte(s), 0, 261);
}

static void op_rate(struct w1256 *w, struct script *s)
{
    send(w, 0x50 | ADS1256_DRATE, 7000, 261);
    send(w, 0, 0, 261);
    send(w, ads1256_rates[script_byte(s) % ADS1256_RATES].code, 0, 261);
}

static void op_wait(struct w1256 *w, struct script *s)
{
    wait_ns(w, script_span_ns(s));
}

/* To the next event, a nanosecond before it, or after it. */
static void op_next(struct w1256 *w, struct script *s)
{
    const int64_t next_ns = sched_next_ns(&w->s);
    if (next_ns == SCHED_NEVER || next_ns > END_NS) return;
    sched_run_until(&w->s, next_ns + script_byte(s) % 3 - 1);
}

static void restarts(struct w1256 *w)
{
    w->restart_ns = w->s.now_ns;
    w->settle_ns = INT64_MAX;
}

static void op_sync(struct w1256 *w, struct script *s)
{
    const bool level = script_byte(s) & 1;
    if (level && w->a.mode == ADS1256_SYNC_LOW) restarts(w);
    ads1256_sync_pin(&w->a, level, w->s.now_ns);
}

static void op_reset(struct w1256 *w, struct script *s)
{
    const bool level = script_byte(s) & 1;
    if (level != w->a.reset) restarts(w);
    ads1256_reset_pin(&w->a, level, w->s.now_ns);
}

static void op_cs(struct w1256 *w, struct script *s)
{
    const bool level = script_byte(s) & 1;
    if (level != w->a.cs) w->quiet = 0; /* in RDATAC a half read word is offered again (M50) */
    ads1256_cs_pin(&w->a, level, w->s.now_ns);
}

static void op_gpio(struct w1256 *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    ads1256_gpio_pin(&w->a, b & 7, b >> 3 & 1, w->s.now_ns);
    for (unsigned d = 0; d < 8; d++) mix(w, ads1256_gpio(&w->a, d));
}

static void op_input(struct w1256 *w, struct script *s)
{
    static const double v[] = {0.0, 1.0, 2.5, 5.0, 4.0, -0.2, 1e300, -1e300};
    const uint8_t b = script_byte(s);
    w->v[b % ADS1256_INPUTS] = v[b / ADS1256_INPUTS % 8];
}

/* Edges as they come, of SCLK and DIN, with as much time between them as the script says; or the reset pattern. */
static void op_edges(struct w1256 *w, struct script *s)
{
    static const int64_t pattern_tau[] = {307, 5, 550, 5, 1050};
    const uint8_t b = script_byte(s);
    if (w->drive != W1256_PINS) return;
    for (unsigned i = 0; i < 5 && b == 0xFF; i++) {
        ads1256_sclk_pin(&w->a, i % 2 == 0, w->s.now_ns);
        wait_ns(w, clk_span_ns(w->a.clkin.hz, pattern_tau[i] + 1));
    }
    for (unsigned i = 0; i < 4; i++) {
        if (b >> i & 1) ads1256_din_pin(&w->a, b >> (i + 4) & 1, w->s.now_ns);
        else ads1256_sclk_pin(&w->a, b >> (i + 4) & 1, w->s.now_ns);
        wait_ns(w, script_span_ns(s));
    }
    w->quiet = 0;
}

bool w1256_step(struct w1256 *w, struct script *s)
{
    static void (*const ops[])(struct w1256 * w, struct script * s) = {
        op_byte,  op_zeros, op_write_register, op_rate,  op_wait,  op_next, op_sync,
        op_reset, op_cs,    op_gpio,           op_input, op_edges,
    };
    if (!script_more(s) || w->s.now_ns >= END_NS || w->a.n.conversions >= CONVERSIONS_MAX) return false;
    ops[script_byte(s) % (sizeof ops / sizeof ops[0])](w, s);
    check(w);
    return true;
}

/* The counters that only pins can move, like those of DOUT's high impedance, are left out. */
void w1256_same(const struct w1256 *a, const struct w1256 *b)
{
    struct ads1256_counters n = a->a.n;
    n.sclk_violations = b->a.n.sclk_violations;
    n.din_violations = b->a.n.din_violations;
    assert(a->s.now_ns == b->s.now_ns);
    assert(a->trail == b->trail);
    assert(memcmp(&n, &b->a.n, sizeof n) == 0); /* counters only: no padding */
    assert(memcmp(a->a.value, b->a.value, sizeof a->a.value) == 0);
}

void w1256_init(struct w1256 *w, struct script *s, enum w1256_drive drive)
{
    static const uint32_t clkin_hz[] = {7680000, 4096000, 10000000, 100000};
    const uint8_t choice = script_byte(s), strict = script_byte(s);
    const struct ads1256_cfg cfg = {.part = choice & 1 ? ADS1256_PART_1255 : ADS1256_PART_1256,
                                    .start = (enum ads1256_start)(strict >> 3 & 3) % 3,
                                    .clkin_hz = clkin_hz[drive >= W1256_TWIN_BYTES ? 0 : choice >> 1 & 3],
                                    .vref_v = choice & 8 ? 2.5 : 2.048,
                                    .noise_scale = choice & 16 ? 1.0 : 0.0,
                                    .offset_v = choice & 32 ? 1e-3 : 0.0,
                                    .gain_error = choice & 64 ? -0.02 : 0.0,
                                    .cells_max = choice & 128 ? 1 : 0,
                                    .strict_timing = strict & 1,
                                    .strict_bus = strict & 2,
                                    .strict_cs = strict & 4};
    memset(w, 0, sizeof *w);
    w->drive = drive;
    w->drdy = true;
    w->period_ns = w->settle_ns = INT64_MAX;
    sched_init(&w->s);
    const struct ads1256_io io = {
        .ctx = w, .ain_v = input, .source_ohm = strict & 32 ? source_ohm : NULL, .drdy = on_drdy, .gpio = on_gpio};
    ads1256_init(&w->a, &cfg, &io, &w->s, draws_of(1, 1, "adc"));
    ads1256_power_up(&w->a, 0);
    ads1256_cs_pin(&w->a, false, 0);
    check(w);
}

#include "ads1282_world.h"

#include <string.h>

/* A word has 4 bytes, and RREG of 32 registers sends 2 + 32: so many bytes of zeros are behind everything. */
enum { BEHIND_ALL = 4 + 2 + 32 };
/* Of one run: what bounds its time. The bit-true modulator takes a step each microsecond. */
enum { END_NS = 300000000, MODULATOR_END_NS = 40000000, CONVERSIONS_MAX = 60, BITS_MAX = 20000, POSTPONED_MAX = 8 };

/* ---- what the chip calls ---- */

static double input(void *ctx, unsigned mux, int64_t t_ns)
{
    struct w1282 *w = ctx;
    assert(mux <= 4 && mux != 2);
    assert(t_ns >= w->asked_ns && t_ns <= w->s.now_ns);
    w->asked_ns = t_ns;
    return w->v;
}

static void mix(struct w1282 *w, uint64_t v)
{
    w->trail = (w->trail ^ v) * UINT64_C(0x9E3779B97F4A7C15);
    w->trail ^= w->trail >> 29;
}

/* A fall is a conversion, one data period after the last and no earlier than the settling time after a restart; but in
 * continuous synchronisation DRDY goes on while nothing has settled. */
static void fell(struct w1282 *w, int64_t t_ns)
{
    const struct ads1282 *a = &w->a;
    const bool converted = a->count.conversions > w->conversions;
    assert(a->running);
    assert(converted || (a->config0 & ADS1282_CONFIG0_SYNC));
    assert(!w->fallen || t_ns - w->fall_ns >= ads1282_period_ns(a) - 1);
    assert(!converted || t_ns - w->restart_ns >= ads1282_settle_ns(a) - 1);
    w->conversions = a->count.conversions;
    w->fall_ns = t_ns;
    w->fallen = true;
}

static void on_drdy(void *ctx, bool level, int64_t t_ns)
{
    struct w1282 *w = ctx;
    assert(level != w->drdy && level == ads1282_drdy(&w->a));
    assert(t_ns >= w->drdy_ns && t_ns <= w->s.now_ns);
    w->drdy = level;
    w->drdy_ns = t_ns;
    mix(w, (uint64_t)t_ns << 1 | level);
    if (!level) fell(w, t_ns);
}

static void on_mflag(void *ctx, bool level, int64_t t_ns)
{
    struct w1282 *w = ctx;
    assert(level != w->mflag && level == ads1282_mflag(&w->a) && t_ns <= w->s.now_ns);
    w->mflag = level;
    mix(w, (uint64_t)t_ns << 2 | level);
}

static void on_modulator(void *ctx, bool m0, bool m1, int64_t t_ns)
{
    struct w1282 *w = ctx;
    assert((w->a.config0 & ADS1282_CONFIG0_FILTR) == 0 && t_ns >= w->bits_ns && t_ns <= w->s.now_ns);
    w->bits_ns = t_ns;
    w->bits++;
    mix(w, (uint64_t)t_ns << 2 | (m0 ? 2u : 0u) | m1);
}

/* ---- invariants ---- */

static void check_registers(const struct ads1282 *a)
{
    for (unsigned i = 0; i < ADS1282_REGS; i++) {
        const struct reg_spec *r = &a->regs.map[i];
        assert(((a->reg_value[i] ^ r->reset) & (uint8_t)~r->rw) == 0);
        assert(reg_peek(&a->regs, i) == a->reg_value[i]);
    }
}

static void check_counters(const struct ads1282_counters *was, const struct ads1282_counters *now)
{
    uint32_t a[sizeof *was / sizeof(uint32_t)], b[sizeof a / sizeof a[0]];
    memcpy(a, was, sizeof a);
    memcpy(b, now, sizeof b);
    for (unsigned i = 0; i < sizeof a / sizeof a[0]; i++) assert(b[i] >= a[i]);
}

static void check(struct w1282 *w)
{
    check_registers(&w->a);
    check_counters(&w->seen, &w->a.count);
    w->seen = w->a.count;
    assert(sched_next_ns(&w->s) > w->s.now_ns);
    assert(ads1282_drdy(&w->a) == w->drdy);
}

/* ---- bytes ---- */

static bool twin(const struct w1282 *w)
{
    return w->drive == W1282_TWIN_BYTES || w->drive == W1282_TWIN_PINS;
}

static void wait_ns(struct w1282 *w, int64_t ns)
{
    sched_run_until(&w->s, w->s.now_ns + ns);
}

/* Eight periods of SCLK, low at both ends; returns what DOUT said. */
static uint8_t xfer_bytes(struct w1282 *w, uint8_t mosi, int64_t half_ns)
{
    wait_ns(w, half_ns);
    spi_first(&w->a.spi, w->s.now_ns);
    wait_ns(w, 13 * half_ns);
    const uint8_t miso = spi_byte(&w->a.spi, mosi, w->s.now_ns);
    wait_ns(w, half_ns);
    return miso;
}

static void sclk(struct w1282 *w, bool level)
{
    const bool before = ads1282_dout(&w->a);
    ads1282_sclk_pin(&w->a, level, w->s.now_ns);
    /* DOUT changes at falls; but RESET, acting with the last rise of its byte, clears it, and may leave the chip alive. */
    const bool reset = !w->a.alive || (w->a.spi.bits == 0 && (w->a.spi.in & 0xFE) == 0x06);
    assert(!level || ads1282_dout(&w->a) == before || reset);
}

static uint8_t xfer_pins(struct w1282 *w, uint8_t mosi, int64_t half_ns)
{
    uint8_t miso = 0;
    for (int bit = 7; bit >= 0; bit--) {
        ads1282_din_pin(&w->a, mosi >> bit & 1, w->s.now_ns);
        miso = (uint8_t)(miso << 1 | ads1282_dout(&w->a));
        sclk(w, true);
        wait_ns(w, half_ns);
        sclk(w, false);
        wait_ns(w, bit ? half_ns : 0);
    }
    return miso;
}

/* Whether the moment is one at which bytes and pins are the same; waits for it for a while. Late reads are counted by
 * SCLK falls, of which a byte shows the first alone: no byte in the last 4 tCLK before an update. */
static bool moment(struct w1282 *w, int64_t half_ns)
{
    for (unsigned i = 0; i < POSTPONED_MAX; i++) {
        const int64_t since_ns = w->s.now_ns - w->a.rise_ns, next_ns = sched_next_ns(&w->s);
        const int64_t end_ns = w->s.now_ns + 16 * half_ns;
        if (since_ns < w->a.gap_ns && since_ns + 2 * half_ns >= w->a.gap_ns) wait_ns(w, 2 * half_ns);
        else if (next_ns <= end_ns || w->a.update_ns <= end_ns) sched_run_until(&w->s, next_ns);
        else return true;
    }
    return false;
}

static void send(struct w1282 *w, uint8_t mosi, int64_t gap_ns, int64_t half_ns)
{
    wait_ns(w, gap_ns);
    if (twin(w) && !moment(w, half_ns)) return;
    const bool by_pins = w->drive == W1282_PINS || w->drive == W1282_TWIN_PINS;
    const uint32_t before = w->a.count.conversions;
    const uint8_t miso = by_pins ? xfer_pins(w, mosi, half_ns) : xfer_bytes(w, mosi, half_ns);
    mix(w, w->a.count.conversions == before ? miso : 0);
    w->quiet = mosi || w->a.count.conversions != w->quiet_word ? 0 : w->quiet + 1;
    w->quiet_word = w->a.count.conversions;
    assert(w->quiet <= BEHIND_ALL || miso == 0); /* no read past the word */
}

/* ---- operations ---- */

static void op_byte(struct w1282 *w, struct script *s)
{
    const uint8_t mosi = script_byte(s);
    send(w, mosi, script_span_ns(s), 488);
}

static void op_zeros(struct w1282 *w, struct script *s)
{
    static const int64_t half_ns[] = {488, 122, 977, 3000};
    const unsigned n = script_byte(s) % 64;
    const int64_t half = half_ns[script_byte(s) % 4];
    for (unsigned i = 0; i < n; i++) send(w, 0, 6000, half);
}

static void op_write_register(struct w1282 *w, struct script *s)
{
    const uint8_t addr = script_byte(s) % 16;
    send(w, 0x40 | addr, 6000, 488);
    send(w, 0, 6000, 488);
    send(w, script_byte(s), 6000, 488);
}

static void op_wait(struct w1282 *w, struct script *s)
{
    wait_ns(w, script_span_ns(s));
}

/* To the next event, a nanosecond before it, or after it. */
static void op_next(struct w1282 *w, struct script *s)
{
    const int64_t next_ns = sched_next_ns(&w->s);
    if (next_ns == SCHED_NEVER || next_ns > END_NS) return;
    sched_run_until(&w->s, next_ns + script_byte(s) % 3 - 1);
}

static void op_sync(struct w1282 *w, struct script *s)
{
    const uint32_t before = w->a.count.restarts;
    ads1282_sync_pin(&w->a, script_byte(s) & 1, w->s.now_ns);
    if (w->a.count.restarts != before) w->restart_ns = w->s.now_ns;
}

static void op_reset(struct w1282 *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    const bool was = b & 2 ? w->a.pin.pwdn : w->a.pin.reset;
    if (was != (b & 1)) w->restart_ns = w->s.now_ns;
    if (b & 2) ads1282_pwdn_pin(&w->a, b & 1, w->s.now_ns);
    else ads1282_reset_pin(&w->a, b & 1, w->s.now_ns);
}

static void op_input(struct w1282 *w, struct script *s)
{
    static const double v[] = {0.0, 1e-6, 1.25, -1.25, 2.5, -2.5, 2.6, -1e9};
    ads1282_sample_until(&w->a, w->s.now_ns);
    w->v = v[script_byte(s) % 8];
}

static void op_mode(struct w1282 *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    const struct ads1282_mode_pins pins = {b & 3, b & 4, b & 8, b & 16};
    if (w->a.cfg.pin_mode) ads1282_mode_pins(&w->a, &pins, w->s.now_ns);
    else send(w, (uint8_t)(b % 0x14), 6000, 488); /* a command of one byte */
}

/* Edges as they come, of SCLK and DIN, with as much time between them as the script says. */
static void op_edges(struct w1282 *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    if (w->drive != W1282_PINS) return;
    for (unsigned i = 0; i < 4; i++) {
        if (b >> i & 1) ads1282_din_pin(&w->a, b >> (i + 4) & 1, w->s.now_ns);
        else sclk(w, b >> (i + 4) & 1);
        wait_ns(w, script_span_ns(s));
    }
    w->quiet = 0;
}

bool w1282_step(struct w1282 *w, struct script *s)
{
    static void (*const ops[])(struct w1282 * w, struct script * s) = {
        op_byte, op_zeros, op_write_register, op_wait, op_next, op_sync, op_reset, op_input, op_mode, op_edges,
    };
    const bool slow = w->a.cfg.chain == ADS1282_CHAIN_MODULATOR;
    if (!script_more(s) || w->s.now_ns >= (slow ? MODULATOR_END_NS : END_NS)) return false;
    if (w->a.count.conversions >= CONVERSIONS_MAX || w->bits >= BITS_MAX) return false;
    ops[script_byte(s) % (sizeof ops / sizeof ops[0])](w, s);
    check(w);
    return true;
}

void w1282_same(const struct w1282 *a, const struct w1282 *b)
{
    assert(a->s.now_ns == b->s.now_ns);
    assert(a->trail == b->trail);
    assert(memcmp(&a->a.count, &b->a.count, sizeof a->a.count) == 0); /* counters only: no padding */
    assert(memcmp(a->a.reg_value, b->a.reg_value, sizeof a->a.reg_value) == 0);
}

void w1282_init(struct w1282 *w, struct script *s, enum w1282_drive drive)
{
    static const uint32_t clk_hz[] = {4096000, 1024000, 1000000, 3999999};
    const uint8_t choice = script_byte(s), strict = script_byte(s), more = script_byte(s);
    const struct ads1282_cfg cfg = {.part = choice & 1 ? ADS1282_PART_1281 : ADS1282_PART_1282,
                                    .clk_hz = clk_hz[choice >> 1 & 3],
                                    .vref_v = choice & 8 ? 2.5 : 5.0,
                                    .noise_scale = choice & 16 ? 1.0 : 0.0,
                                    .strict_sdatac = strict & 1,
                                    .strict_gap = strict & 2,
                                    .wreg_gap_free = strict & 4,
                                    .strict_sync = strict & 8,
                                    .strict_config0 = strict & 16,
                                    .cal_corrected = strict & 32,
                                    .pin_mode = (choice & 1) && (more & 12) == 12,
                                    .power_up_tclk = more & 16 ? 65536 : 0,
                                    .chain = (enum ads1282_chain)((more & 3) % 3)};
    memset(w, 0, sizeof *w);
    w->drive = drive;
    w->drdy = true;
    sched_init(&w->s);
    const struct ads1282_io io = {.ctx = w,
                                  .vin_v = input,
                                  .drdy = on_drdy,
                                  .mflag = more & 32 ? on_mflag : NULL,
                                  .modulator = more & 64 ? on_modulator : NULL};
    ads1282_init(&w->a, &cfg, &io, &w->s, draws_of(1, 1, "adc"));
    ads1282_power_up(&w->a, 0);
    check(w);
}

#include "ad7712_world.h"

#include <math.h>
#include <string.h>

enum { CONVERSIONS_MAX = 200 }; /* of one run, with END_NS: what bounds its time */
#define END_NS (4 * NS_PER_S)

static double vin_v(void *ctx, unsigned channel, int64_t t_ns)
{
    struct w7712 *w = ctx;
    assert(channel < AD7712_CHANNELS && t_ns <= w->s.now_ns && t_ns >= w->look_ns);
    w->look_ns = t_ns;
    return w->v[channel];
}

static double source_ohm(void *ctx, unsigned channel, int64_t t_ns)
{
    (void)t_ns;
    assert(channel < AD7712_CHANNELS);
    return ((struct w7712 *)ctx)->ohm;
}

static void mix(struct w7712 *w, uint64_t v)
{
    w->trail = (w->trail ^ v) * UINT64_C(0x9E3779B97F4A7C15);
    w->trail ^= w->trail >> 29;
}

/* A fall is a new word, never two within the shortest output period of the clock, which is off by 700 ppm at most. */
static void on_drdy(void *ctx, bool level, int64_t t_ns)
{
    struct w7712 *w = ctx;
    assert(level != w->drdy && level == ad7712_drdy(&w->a));
    assert(t_ns >= w->drdy_ns && t_ns <= w->s.now_ns);
    w->drdy = level;
    w->drdy_ns = t_ns;
    mix(w, (uint64_t)t_ns << 1 | level);
    if (level) return;
    assert(w->a.state == AD7712_RUNNING && w->a.unread);
    assert(w->a.n.conversions > w->conversions);
    assert(t_ns - w->fall_ns >= clk_span_ns(w->a.cfg.clkin_hz, AD7712_FS_MIN * AD7712_MOD_TAU) * 998 / 1000);
    w->conversions = w->a.n.conversions;
    w->fall_ns = t_ns;
}

/* The chip's own SCLK moves in self-clocking mode only. */
static void on_sclk(void *ctx, bool level, int64_t t_ns)
{
    struct w7712 *w = ctx;
    assert(level != w->sclk && t_ns <= w->s.now_ns);
    assert(w->a.port.mode);
    w->sclk = level;
    mix(w, (uint64_t)t_ns << 2 | 2 | level);
}

static void check_counters(const struct ad7712_counters *was, const struct ad7712_counters *now)
{
    uint32_t a[sizeof *was / sizeof(uint32_t)], b[sizeof a / sizeof a[0]];
    memcpy(a, was, sizeof a);
    memcpy(b, now, sizeof b);
    for (unsigned i = 0; i < sizeof a / sizeof a[0]; i++) assert(b[i] >= a[i]);
}

static void check(struct w7712 *w)
{
    const struct ad7712 *a = &w->a;
    check_counters(&w->seen, &a->n);
    w->seen = a->n;
    assert(sched_next_ns(&w->s) > w->s.now_ns);
    assert(ad7712_drdy(a) == w->drdy && ad7712_sclk(a) == w->sclk);
    assert(a->control <= 0xFFFFFF && a->word <= 0xFFFFFF);
    for (unsigned c = 0; c < AD7712_CHANNELS; c++) assert(a->zero[c] <= 0xFFFFFF && a->full[c] <= 0xFFFFFF);
    assert(a->port.index <= a->port.width && a->port.width <= 24 && a->port.taken <= 24);
    assert(!a->port.reading || !a->port.writing);
    assert(ad7712_sdata_driven(a, w->s.now_ns) || !ad7712_sdata(a, w->s.now_ns));
    assert(ad7712_period_ns(a) >= clk_span_ns(a->clkin.hz, AD7712_FS_MIN * AD7712_MOD_TAU));
    assert(a->state != AD7712_RUNNING || a->ready_ev.queued || a->begin_ev.queued);
    assert(a->state == AD7712_RUNNING || (a->drdy && !a->ready_ev.queued));
}

void w7712_init(struct w7712 *w, struct script *s, enum w7712_drive drive, bool twin)
{
    static const uint32_t clocks[] = {10000000, 9830400, 400000, 5000000};
    memset(w, 0, sizeof *w);
    const uint8_t b = script_byte(s), c = script_byte(s);
    const struct ad7712_cfg cfg = {.part = (enum ad7712_part)(b & 3),
                                   .clkin_hz = clocks[b >> 2 & 3],
                                   .vref_v = 2.5,
                                   .noise_scale = b >> 4 & 1,
                                   .offset_v = {0.01, -0.02},
                                   .gain_error = {0.01, -0.01},
                                   .cells_max = (uint8_t)(c & 1   ? 1
                                                          : c & 2 ? 8
                                                                  : 0),
                                   .bit_access_ns = c & 4 ? 220 : 0,
                                   .strict_timing = b >> 5 & 1,
                                   .strict_drdy = b >> 6 & 1,
                                   .free_settling = b >> 7};
    sched_init(&w->s);
    w->drive = drive;
    w->twin = twin;
    w->drdy = w->sclk = true;
    w->fall_ns = -NS_PER_S;
    const struct ad7712_io io = {
        .ctx = w, .vin_v = vin_v, .source_ohm = c & 8 ? source_ohm : NULL, .drdy = on_drdy, .sclk = on_sclk};
    ad7712_init(&w->a, &cfg, &io, &w->s, draws_of(c, 1, "adc"));
    ad7712_power_up(&w->a, 0);
    check(w);
}

/* ---- operations ---- */

static void op_wait(struct w7712 *w, struct script *s)
{
    sched_run_until(&w->s, w->s.now_ns + script_span_ns(s));
}

static void op_drdy(struct w7712 *w, struct script *s)
{
    (void)s;
    const int64_t next_ns = sched_next_ns(&w->s);
    if (next_ns < END_NS) sched_run_until(&w->s, next_ns);
}

static void op_input(struct w7712 *w, struct script *s)
{
    static const double volts[] = {0.0, 1.0, -1.0, 2.5, -2.5, 2.7, -10.0, NAN};
    static const double ohms[] = {0.0, 10e3, 1e6, INFINITY};
    const uint8_t b = script_byte(s);
    ad7712_sample_until(&w->a, w->s.now_ns);
    w->v[b & 1] = volts[b >> 1 & 7];
    w->ohm = ohms[b >> 4 & 3];
}

typedef void pin_fn(struct ad7712 *a, bool level, int64_t t_ns);

/* Twins leave the frames' pins to the frames. */
static void op_pin(struct w7712 *w, struct script *s)
{
    static pin_fn *const pins[] = {ad7712_sync_pin, ad7712_standby_pin, ad7712_a0_pin,   ad7712_mode_pin,
                                   ad7712_rfs_pin,  ad7712_tfs_pin,     ad7712_sclk_pin, ad7712_sdata_pin};
    const uint8_t b = script_byte(s);
    pins[w->twin ? b % 3 : b & 7](&w->a, b >> 3 & 1, w->s.now_ns);
}

static void op_power(struct w7712 *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    if (b & 1) ad7712_power_up(&w->a, w->s.now_ns);
    else ad7712_power_off(&w->a, w->s.now_ns);
    w->fall_ns = -NS_PER_S;
}

static void op_fault(struct w7712 *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    if (b & 1) {
        ad7712_flip(&w->a, b >> 1 & 15, script_byte(s), w->s.now_ns);
        return;
    }
    /* DRDY stays free: its falls are what the invariants hang on. */
    const struct chip_fault f = {.dout = (enum chip_stuck)((b >> 1 & 3) % 3),
                                 .lost_sync = b >> 3 & 1,
                                 .clock_ppm = b >> 4 ? ((int32_t)(b >> 4) - 8) * 100 : 0};
    ad7712_fault(&w->a, &f, w->s.now_ns);
}

struct frame {
    bool write;
    unsigned bits;
    uint32_t word;
    struct ad7712_sclk c;
};

static uint32_t by_edges(struct w7712 *w, const struct frame *f)
{
    uint32_t got = 0;
    for (unsigned i = 0; i < f->bits; i++) {
        const int64_t rise_ns = f->c.first_rise_ns + (int64_t)i * f->c.period_ns;
        if (f->write) {
            sched_run_until(&w->s, rise_ns - (f->c.period_ns - f->c.high_ns));
            ad7712_sdata_pin(&w->a, f->word >> (f->bits - 1 - i) & 1, w->s.now_ns);
        }
        sched_run_until(&w->s, rise_ns);
        ad7712_sclk_pin(&w->a, true, rise_ns);
        got = got << 1 | ad7712_sdata(&w->a, rise_ns);
        sched_run_until(&w->s, rise_ns + f->c.high_ns);
        ad7712_sclk_pin(&w->a, false, w->s.now_ns);
    }
    return f->write ? 0 : got;
}

static uint32_t by_words(struct w7712 *w, const struct frame *f)
{
    if (!f->write) return ad7712_read_word(&w->a, f->bits, &f->c);
    ad7712_write_word(&w->a, f->word, f->bits, &f->c);
    return 0;
}

/* A frame with an SCLK of any speed, right or wrong. */
static void op_frame(struct w7712 *w, struct script *s)
{
    const uint8_t b = script_byte(s), t = script_byte(s);
    static const unsigned bits[] = {24, 16, 8, 25};
    static const int64_t halves_ns[] = {400, 250, 200, 199, 60, 3000, 401, 300};
    const int64_t low_ns = halves_ns[t & 7], high_ns = halves_ns[t >> 3 & 7];
    struct frame f = {.write = b & 1, .bits = bits[b >> 1 & 3], .word = (uint32_t)script_uint(s, b & 1 ? 3 : 0)};
    ad7712_mode_pin(&w->a, false, w->s.now_ns);
    ad7712_sclk_pin(&w->a, false, w->s.now_ns);
    ad7712_a0_pin(&w->a, b >> 3 & 1, w->s.now_ns);
    sched_run_until(&w->s, w->s.now_ns + (b & 16 ? 400 : 199));
    pin_fn *const select = f.write ? ad7712_tfs_pin : ad7712_rfs_pin;
    select(&w->a, true, w->s.now_ns);
    select(&w->a, false, w->s.now_ns);
    f.c = (struct ad7712_sclk){w->s.now_ns + low_ns + (t >> 6) * 300, low_ns + high_ns, high_ns};
    const uint32_t got = w->drive == W7712_WORDS ? by_words(w, &f) : by_edges(w, &f);
    sched_run_until(&w->s, f.c.first_rise_ns + (int64_t)(f.bits - 1) * f.c.period_ns + high_ns + (b & 32 ? 500 : 9));
    select(&w->a, true, w->s.now_ns);
    mix(w, got);
}

bool w7712_step(struct w7712 *w, struct script *s)
{
    static void (*const ops[])(struct w7712 * w, struct script * s) = {op_frame, op_frame, op_frame, op_drdy,
                                                                       op_wait,  op_input, op_pin,   op_drdy,
                                                                       op_frame, op_wait,  op_power, op_fault};
    if (!script_more(s) || w->s.now_ns > END_NS || w->a.n.conversions > CONVERSIONS_MAX) return false;
    ops[script_byte(s) % (sizeof ops / sizeof *ops)](w, s);
    sched_run_until(&w->s, w->s.now_ns); /* a bit that flips may restart the filter at this very instant */
    check(w);
    return true;
}

void w7712_same(const struct w7712 *a, const struct w7712 *b)
{
    assert(a->s.now_ns == b->s.now_ns && a->trail == b->trail);
    assert(memcmp(&a->a.n, &b->a.n, sizeof a->a.n) == 0);
    assert(a->a.control == b->a.control && a->a.word == b->a.word && a->a.unread == b->a.unread);
    assert(memcmp(a->a.zero, b->a.zero, sizeof a->a.zero) == 0 && memcmp(a->a.full, b->a.full, sizeof a->a.full) == 0);
    assert(a->a.port.index == b->a.port.index && a->a.port.reading == b->a.port.reading);
}

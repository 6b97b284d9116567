/* A word at once against its edges: the same bits, counters, levels and instants, in frames of all kinds and timings. */
#include "ad7712_rig.h"
#include "base/rng.h"

struct frame {
    bool write, level;
    unsigned bits;
    uint32_t word;
    int64_t a0_ns, last_ns;
    struct ad7712_sclk c; /* first_rise_ns: after RFS */
};

static int64_t pick(struct rng *rng, const int64_t *values, unsigned n)
{
    return values[rng_u64(rng) % n];
}

/* Mostly as a board would, now and then outside of a limit. */
static struct frame random_frame(struct rng *rng, bool rough)
{
    static const int64_t first_ns[] = {700, 700, 300, 299, 100, 1300};
    static const int64_t low_ns[] = {400, 400, 300, 200, 199, 100, 99, 60};
    static const int64_t high_ns[] = {400, 400, 300, 200, 199, 50};
    static const int64_t a0_ns[] = {400, 400, 200, 199, 0};
    static const int64_t last_ns[] = {500, 500, 400, 399, 10, 9};
    static const unsigned bits[] = {16, 24, 24, 16, 8, 23, 25, 1};
    struct frame f = {.level = rng_u64(rng) % 3, .bits = bits[rng_u64(rng) % (rough ? 8 : 2)]};
    f.write = rng_u64(rng) % 5 == 0;
    const uint32_t md = rng_u64(rng) % 3 ? 0 : (uint32_t)(rng_u64(rng) % 8);
    f.word = AD7712_CONTROL(md, rng_u64(rng) % 3, rng_u64(rng) % 2, rng_u64(rng) % 2, rng_u64(rng) % 4 == 0,
                            19 + rng_u64(rng) % 4);
    if (f.write) f.bits = rough && rng_u64(rng) % 4 == 0 ? f.bits : 24;
    const unsigned n = rough ? 100 : 2;
    const int64_t high = pick(rng, high_ns, n < COUNT(high_ns) ? n : COUNT(high_ns));
    const int64_t low = pick(rng, low_ns, n < COUNT(low_ns) ? n : COUNT(low_ns));
    f.c = (struct ad7712_sclk){pick(rng, first_ns, n < COUNT(first_ns) ? n : COUNT(first_ns)), high + low, high};
    f.a0_ns = pick(rng, a0_ns, n < COUNT(a0_ns) ? n : COUNT(a0_ns));
    f.last_ns = pick(rng, last_ns, n < COUNT(last_ns) ? n : COUNT(last_ns));
    return f;
}

/* The edges, each at its own instant of the clock. */
static uint32_t by_pins(struct rig *r, const struct frame *f, const struct ad7712_sclk *c)
{
    uint32_t got = 0;
    for (unsigned i = 0; i < f->bits; i++) {
        const int64_t rise_ns = c->first_rise_ns + (int64_t)i * c->period_ns;
        if (f->write) {
            wait_until(r, rise_ns - (c->period_ns - c->high_ns));
            ad7712_sdata_pin(&r->a, f->word >> (f->bits - 1 - i) & 1, r->s.now_ns);
        }
        wait_until(r, rise_ns);
        ad7712_sclk_pin(&r->a, true, rise_ns);
        got = got << 1 | ad7712_sdata(&r->a, rise_ns);
        wait_until(r, rise_ns + c->high_ns);
        ad7712_sclk_pin(&r->a, false, r->s.now_ns);
    }
    return f->write ? 0 : got;
}

static uint32_t by_word(struct rig *r, const struct frame *f, const struct ad7712_sclk *c)
{
    if (!f->write) return ad7712_read_word(&r->a, f->bits, c);
    ad7712_write_word(&r->a, f->word, f->bits, c);
    return 0;
}

static uint32_t run_frame(struct rig *r, const struct frame *f, bool words)
{
    ad7712_a0_pin(&r->a, f->level, r->s.now_ns);
    wait_ns(r, f->a0_ns);
    if (f->write) tfs(r, false);
    else rfs(r, false);
    struct ad7712_sclk c = f->c;
    c.first_rise_ns += r->s.now_ns;
    if (f->write && c.first_rise_ns < r->s.now_ns + c.period_ns - c.high_ns) c.first_rise_ns += c.period_ns;
    const uint32_t got = words ? by_word(r, f, &c) : by_pins(r, f, &c);
    wait_until(r, c.first_rise_ns + (f->bits - 1) * c.period_ns + c.high_ns + f->last_ns);
    if (f->write) tfs(r, true);
    else rfs(r, true);
    return got;
}

static void same(const struct rig *p, const struct rig *w, unsigned i)
{
    if (memcmp(&p->a.n, &w->a.n, sizeof p->a.n)) fail_msg("frame %u: counters", i);
    assert_int_equal(p->a.control, w->a.control);
    assert_memory_equal(p->a.zero, w->a.zero, sizeof p->a.zero);
    assert_memory_equal(p->a.full, w->a.full, sizeof p->a.full);
    assert_int_equal(p->a.word, w->a.word);
    assert_int_equal(p->a.unread, w->a.unread);
    assert_int_equal(p->a.port.reading, w->a.port.reading);
    assert_int_equal(p->a.port.index, w->a.port.index);
    assert_int_equal(p->a.port.rise_ns, w->a.port.rise_ns);
    assert_int_equal(p->a.port.fall_ns, w->a.port.fall_ns);
    for (int64_t t_ns = p->s.now_ns - 200; t_ns < p->s.now_ns + 400; t_ns += 50) {
        assert_int_equal(ad7712_sdata(&p->a, p->s.now_ns), ad7712_sdata(&w->a, w->s.now_ns));
        assert_int_equal(ad7712_sdata_driven(&p->a, t_ns), ad7712_sdata_driven(&w->a, t_ns));
    }
    assert_int_equal(p->drdy.n, w->drdy.n);
    for (unsigned k = 0; k < p->drdy.n; k++) {
        assert_int_equal(p->drdy.e[k].t_ns, w->drdy.e[k].t_ns);
        assert_int_equal(p->drdy.e[k].level, w->drdy.e[k].level);
    }
}

static void words_are_the_edges(void **state)
{
    (void)state;
    const uint64_t seed = rig_seed(1);
    unsigned whole = 0, conversions = 0, breached = 0;
    for (unsigned s = 0; s < 40; s++) {
        struct rng rng = rng_stream(seed, s, "frames");
        struct ad7712_cfg cfg = quiet;
        cfg.noise_scale = 1.0;
        cfg.strict_timing = s % 4 == 1;
        cfg.strict_drdy = s % 8 >= 6;
        cfg.free_settling = s % 5 == 4;
        cfg.bit_access_ns = s % 7 == 5 ? 350 : 0;
        static struct rig p, w;
        power_up_seeded(&p, &cfg, s);
        power_up_seeded(&w, &cfg, s);
        p.v[0] = w.v[0] = 0.7;
        const struct chip_fault fault = {.dout = s % 10 == 9   ? CHIP_STUCK_HIGH
                                                 : s % 10 == 8 ? CHIP_STUCK_LOW
                                                               : CHIP_FREE};
        ad7712_fault(&p.a, &fault, 0);
        ad7712_fault(&w.a, &fault, 0);
        for (unsigned i = 0; i < 300; i++) {
            p.drdy.n = w.drdy.n = 0;
            const struct frame f = random_frame(&rng, s % 2);
            if (rng_u64(&rng) % 2) { /* when a word waits, or at any time */
                wait_ns(&p, (int64_t)(rng_u64(&rng) % 3000000));
                wait_until(&w, p.s.now_ns);
            }
            const uint32_t a = run_frame(&p, &f, false), b = run_frame(&w, &f, true);
            if (a != b) fail_msg("session %u, frame %u: %06X %06X", s, i, a, b);
            same(&p, &w, i);
            whole += !f.write && !f.level && a == p.a.control;
            if (p.a.control & AD7712_CTL_PD) assert_true(p.a.state == AD7712_DOWN);
        }
        conversions += p.a.n.conversions;
        breached += breaches(&p);
    }
    assert_true(whole > 100 && conversions > 1000 && breached > 1000); /* something has happened */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(words_are_the_edges),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* ADS1281/ADS1282: bits of another modulator in place of its own. */
#include "ads1282_rig.h"

enum { CLOCKS = 100000 };

struct bits {
    struct rig r;
    uint8_t bits[CLOCKS];
    unsigned n;
};

static void on_bits(void *ctx, bool m0, bool m1, int64_t t_ns)
{
    struct bits *b = ctx; /* r is its first member */
    (void)t_ns;
    if (b->n < CLOCKS) b->bits[b->n++] = (uint8_t)(m0 | m1 << 1);
}

/* What the modulator puts out for a voltage at rest. */
static const uint8_t *bits_of(double v)
{
    static struct bits b;
    memset(&b, 0, sizeof b);
    wired(&b.r, &quiet, 1, (struct ads1282_io){.modulator = on_bits});
    ads1282_power_up(&b.r.a, 0);
    b.r.v = v;
    wreg(&b.r, ADS1282_CONFIG0, 0x50);
    at_tclk(&b.r, b.r.tclk + 4 * (CLOCKS + 10));
    assert_int_equal(b.n, CLOCKS);
    return b.bits;
}

static void up(struct rig *r, enum ads1282_chain chain, uint8_t config0, double v)
{
    struct ads1282_cfg cfg = quiet;
    cfg.chain = chain;
    unpowered(r, &cfg, 1);
    ads1282_power_up(&r->a, 0);
    r->v = v;
    wreg(r, ADS1282_CONFIG0, config0);
}

static void play(struct rig *r, const uint8_t *bits, int64_t count)
{
    ads1282_play(&r->a, &(struct ads1282_recording){.bits = bits, .count = count}, at_tclk(r, r->tclk + 24));
}

static uint32_t next_out(struct rig *r)
{
    assert_true(to_fall(r) > 0);
    return (uint32_t)(r->a.out >> 32);
}

/* In every mode and whatever chain is soldered, to the last bit; the volts at the pins do not matter. */
static void the_chain_makes_the_same_words_of_its_own_bits(void **state)
{
    (void)state;
    static const uint8_t modes[] = {0x41, 0x52, 0x56, 0x62, 0x66, 0x61, 0xE2, 0x63};
    static const double volts[] = {0.7, -2.5};
    for (unsigned k = 0; k < COUNT(modes) * COUNT(volts) * 2; k++) {
        static struct rig own, played;
        const uint8_t mode = modes[k % COUNT(modes)];
        const double v = volts[k / COUNT(modes) % COUNT(volts)];
        const uint8_t *bits = bits_of(v);
        up(&own, ADS1282_CHAIN_MODULATOR, mode, v);
        up(&played, k / COUNT(modes) / COUNT(volts) ? ADS1282_CHAIN_DIRECT : ADS1282_CHAIN_EXACT, mode, -1.0);
        play(&played, bits, CLOCKS);
        for (unsigned i = 0; i < 20; i++) hex_is(next_out(&played), next_out(&own));
        assert_int_equal(played.a.count.bits_missing, 0);
        assert_false(ads1282_mflag(&played.a));
    }
}

/* The first byte is the first clock that the chain takes; then they go by with MCLK, a restart does not wind back. */
static void a_restart_does_not_wind_back(void **state)
{
    (void)state;
    static struct rig r, late;
    enum { WAIT_TCLK = 4 * 1001 + 2 };
    uint8_t bits[3 * 1024 + 63000];
    for (unsigned i = 0; i < sizeof bits; i++) bits[i] = (uint8_t)(i * 2654435761u >> 28 & 3);
    up(&r, ADS1282_CHAIN_EXACT, 0x62, 0.0);
    play(&r, bits, sizeof bits);
    ads1282_sync_pin(&r.a, true, at_tclk(&r, r.tclk + WAIT_TCLK));
    up(&late, ADS1282_CHAIN_EXACT, 0x62, 0.0);
    play(&late, bits + WAIT_TCLK / 4, sizeof bits - WAIT_TCLK / 4);
    for (unsigned i = 0; i < 20; i++) hex_is(next_out(&r), next_out(&late));
}

static void past_its_end_zero_is_converted_and_counted(void **state)
{
    (void)state;
    static struct rig r;
    up(&r, ADS1282_CHAIN_EXACT, 0x62, 2.0);
    play(&r, bits_of(1.0), 64 * 256);
    near(fraction(next_out(&r)), 0.4, 1e-4);
    assert_int_equal(r.a.count.bits_missing, 0);
    for (int i = 0; i < 70; i++) next_out(&r);
    assert_in_range(r.a.count.bits_missing, 69 * 256, 71 * 256);
    near(fraction(next_out(&r)), 0.0, 1e-9);
}

static void without_bits_the_model_converts_again(void **state)
{
    (void)state;
    static struct rig r;
    up(&r, ADS1282_CHAIN_EXACT, 0x52, 1.0);
    play(&r, bits_of(-2.0), CLOCKS);
    near(fraction(next_out(&r)), -0.8, 1e-4);
    play(&r, NULL, 0);
    near(fraction(next_out(&r)), 0.4, 1e-4);
}

/* The pins show the recording. */
static void m0_and_m1_are_those_played(void **state)
{
    (void)state;
    static struct bits b;
    memset(&b, 0, sizeof b);
    wired(&b.r, &quiet, 1, (struct ads1282_io){.modulator = on_bits});
    ads1282_power_up(&b.r.a, 0);
    wreg(&b.r, ADS1282_CONFIG0, 0x50);
    b.n = 0;
    static const uint8_t bits[] = {0, 1, 2, 3, 3, 1, 0, 2, 2, 1};
    play(&b.r, bits, COUNT(bits));
    b.n = 0;
    at_tclk(&b.r, b.r.tclk + 4 * (int64_t)COUNT(bits) + 4);
    assert_memory_equal(b.bits, bits, sizeof bits);
}

/* Ones alone are 5/4 of full scale: more than our modulator ever gives. */
static void ones_alone_are_five_quarters_of_full_scale(void **state)
{
    (void)state;
    static uint8_t bits[CLOCKS];
    for (int level = 0; level < 2; level++) {
        static struct rig r;
        memset(bits, level ? 3 : 0, sizeof bits);
        up(&r, ADS1282_CHAIN_EXACT, 0x66, 0.0);
        wreg(&r, ADS1282_FSC2, 0x20); /* gain 1/2 shows what lies beyond full scale */
        play(&r, bits, sizeof bits);
        near(fraction(next_out(&r)), (level ? 0.5 : -0.5) * 1.25 * 1.000169, 1e-7);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_chain_makes_the_same_words_of_its_own_bits),
        cmocka_unit_test(a_restart_does_not_wind_back),
        cmocka_unit_test(past_its_end_zero_is_converted_and_counted),
        cmocka_unit_test(without_bits_the_model_converts_again),
        cmocka_unit_test(m0_and_m1_are_those_played),
        cmocka_unit_test(ones_alone_are_five_quarters_of_full_scale),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* ADS1281/ADS1282 driven edge by edge: SCLK, DIN, DOUT, the limits of their timing, bytes against pins (sources 1.1, 1.4). */
#include "ads1282_rig.h"
#include "base/rng.h"

/* ---- The same chip, however it is driven ---- */

/* Waits until nothing happens during the next byte and 4 tCLK after it: where inside a byte a conversion ends, only bits can tell. False: the
 * sinc's words come faster than bytes. */
static bool clear_of_conversions(struct rig *r)
{
    for (int i = 0; i < 200; i++) {
        if (sched_next_ns(&r->s) > clk_edge_ns(&r->clk, r->tclk + r->gap_tclk + 10 * BIT_TCLK)) return true;
        const int64_t next = clk_count_at(&r->clk, sched_next_ns(&r->s));
        at_tclk(r, next > r->tclk + 24 ? next : r->tclk + 24); /* a gap is clearly too short or clearly not */
    }
    return false;
}

static void pulse_reset(struct rig *r)
{
    ads1282_reset_pin(&r->a, false, at_tclk(r, r->tclk + 30));
    ads1282_reset_pin(&r->a, true, at_tclk(r, r->tclk + 20));
}

static void pulse_sync(struct rig *r)
{
    ads1282_sync_pin(&r->a, true, at_tclk(r, r->tclk + 30));
    ads1282_sync_pin(&r->a, false, at_tclk(r, r->tclk + 5));
}

static uint8_t random_byte(uint64_t u)
{
    static const uint8_t likely[] = {0x00, 0x11, 0x10, 0x12, 0x21, 0x41, 0x56, 0x52, 0x04, 0x06, 0x2A,
                                     0x48, 0x02, 0x60, 0x61, 0x53, 0xD2, 0x6E, 0x51, 0x01, 0x00};
    return u % 5 ? likely[(u >> 32) % sizeof likely] : (uint8_t)(u >> 40);
}

static void random_event(struct rig *r, uint64_t u)
{
    static const int gaps[] = {24, 24, 24, 30, 4};
    r->gap_tclk = gaps[(u >> 16) % COUNT(gaps)];
    if (u % 7 == 0) at_tclk(r, r->tclk + 24 + (int64_t)(u >> 8) % 3000);
    if (u % 1009 == 0) at_tclk(r, r->tclk + 64 * 4096);
    if (u % 1511 == 0) pulse_sync(r);
    if (u % 2503 == 0) pulse_reset(r);
    if (u % 3001 == 0) at_tclk(r, r->tclk + 65 * 4096);
}

static void random_traffic(struct rig *r, uint64_t seed, uint8_t *out, unsigned n)
{
    struct rng g = rng_stream(seed, 0, "bus");
    r->ramp_v_per_s = 1.0;
    for (unsigned i = 0; i < n; i++) {
        const uint64_t u = rng_u64(&g);
        random_event(r, u);
        if (!clear_of_conversions(r)) pulse_reset(r);
        (void)clear_of_conversions(r);
        out[i] = byte(r, random_byte(u));
    }
}

static void assert_same_chip(const struct rig *x, const struct rig *y)
{
    assert_int_equal(x->falls, y->falls);
    assert_int_equal(x->rises, y->rises);
    assert_int_equal(x->fall_ns, y->fall_ns);
    assert_int_equal(x->rise_ns, y->rise_ns);
    assert_memory_equal(x->a.reg_value, y->a.reg_value, ADS1282_REGS);
    assert_memory_equal(&x->a.count, &y->a.count, sizeof x->a.count); /* uint32_t only: no padding */
    assert_int_equal(x->a.regs.bad_access, y->a.regs.bad_access);
}

static void bytes_bits_and_pins_drive_the_same_chip(void **state)
{
    (void)state;
    enum { BYTES_EACH = 4000 };
    static uint8_t out[3][BYTES_EACH];
    static struct rig r[3];
    const uint64_t seed = rig_seed(5);
    unsigned conversions = 0;
    unsigned restarts = 0;
    for (unsigned strict = 0; strict < 8; strict++) {
        struct ads1282_cfg cfg = quiet;
        cfg.strict_sdatac = strict & 1;
        cfg.strict_gap = strict & 2;
        cfg.wreg_gap_free = strict & 4;
        cfg.strict_config0 = strict & 4;
        cfg.part = strict & 4 ? ADS1282_PART_1281 : ADS1282_PART_1282;
        for (int bus = BYTES; bus <= PINS; bus++) {
            powered(&r[bus], &cfg);
            r[bus].bus = (enum bus)bus;
            random_traffic(&r[bus], seed + strict, out[bus], BYTES_EACH);
        }
        assert_memory_equal(out[BYTES], out[BITS], BYTES_EACH);
        assert_memory_equal(out[BYTES], out[PINS], BYTES_EACH);
        assert_same_chip(&r[BYTES], &r[BITS]);
        assert_same_chip(&r[BYTES], &r[PINS]);
        conversions += r[0].a.count.conversions;
        restarts += r[0].a.count.restarts;
    }
    assert_true(conversions > 100 && restarts > 100); /* there was something to see */
}

/* ---- DOUT ---- */

static void dout_changes_at_falls_of_sclk_only(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 1.1;
    const uint32_t word = settled_word(&r);
    to_fall(&r);
    for (int i = 0; i < 40; i++) { /* bit 31 is there without a clock; zeros follow bit 0 */
        const bool want = i < 32 && (word >> (31 - i) & 1);
        assert_int_equal(ads1282_dout(&r.a), want);
        ads1282_sclk_pin(&r.a, true, at_tclk(&r, r.tclk + 2));
        assert_int_equal(ads1282_dout(&r.a), want);
        assert_int_equal(ads1282_drdy(&r.a), i > 0);
        ads1282_sclk_pin(&r.a, false, at_tclk(&r, r.tclk + 2));
        assert_true(ads1282_drdy(&r.a));
    }
}

static void the_same_level_again_is_no_edge(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    for (int i = 0; i < 5; i++) ads1282_sclk_pin(&r.a, true, at_tclk(&r, r.tclk + 2));
    assert_int_equal(r.a.spi.bits, 1);
    for (int i = 0; i < 5; i++) ads1282_sclk_pin(&r.a, false, at_tclk(&r, r.tclk + 2));
    assert_int_equal(r.a.spi.bits, 1);
}

static void dout_is_low_without_power_and_in_reset(void **state)
{
    (void)state;
    struct rig r;
    unpowered(&r, &quiet, 1);
    assert_false(ads1282_dout(&r.a));
    ads1282_power_up(&r.a, 0);
    r.v = -1.0; /* bit 31 set */
    (void)settled_word(&r);
    to_fall(&r);
    assert_true(ads1282_dout(&r.a));
    ads1282_sclk_pin(&r.a, true, at_tclk(&r, r.tclk + 2));
    ads1282_reset_pin(&r.a, false, at_tclk(&r, r.tclk + 1));
    assert_false(ads1282_dout(&r.a));
    ads1282_reset_pin(&r.a, true, at_tclk(&r, r.tclk + 9));
    assert_false(ads1282_dout(&r.a));
}

/* A conversion ends after `bits` clocks: upper bits old, lower bits new. Sources 1.5, the exact tear is M50. */
static void a_read_by_pins_tears_at_its_bit(void **state)
{
    (void)state;
    struct rig ref;
    powered(&ref, &quiet);
    ref.ramp_v_per_s = 20.0;
    uint32_t words[2] = {0, 0};
    while (ref.falls < 67) {
        to_fall(&ref);
        words[0] = words[1];
        words[1] = read_bytes(&ref, 4);
    }
    for (int bits = 1; bits < 32; bits++) {
        struct rig r;
        powered(&r, &quiet);
        r.ramp_v_per_s = 20.0;
        while (r.falls < 66) to_fall(&r);
        const int64_t first_rise = r.tclk + 4096 - BIT_TCLK * bits + 2; /* the conversion ends between two rises */
        uint32_t word = 0;
        for (int i = 0; i < 32; i++) {
            const int64_t t_ns = at_tclk(&r, first_rise + i * BIT_TCLK);
            word = word << 1 | ads1282_dout(&r.a);
            ads1282_sclk_pin(&r.a, true, t_ns);
            ads1282_sclk_pin(&r.a, false, at_tclk(&r, r.tclk + 2));
        }
        const uint32_t low = UINT32_MAX >> bits;
        hex_is(word, (words[0] & ~low) | (words[1] & low));
        assert_int_equal(r.a.count.torn_reads, 1);
    }
}

/* Sources 1.5: a read ends at least 4 tCLK before the next DRDY fall. */
static void sclk_in_the_last_4_tclk_before_an_update_is_a_late_read(void **state)
{
    (void)state;
    for (int before = 3; before <= 6; before++) { /* tCLK from the last SCLK fall to the update */
        struct rig r;
        powered(&r, &quiet);
        r.bus = PINS;
        while (r.falls < 3) to_fall(&r);
        at_tclk(&r, r.tclk + 4096 - before - 2 - 28 - r.gap_tclk);
        byte(&r, 0);
        assert_int_equal(r.falls, 3);
        assert_int_equal(r.a.count.late_reads, before < 4);
        to_fall(&r);
        assert_int_equal(r.a.count.torn_reads, 1);
    }
}

/* ---- Limits: sources 1.4 ---- */

/* One byte by hand; times in ns from its first rise. */
struct wave {
    int64_t period_ns, high_ns; /* of SCLK */
    int64_t din_ns;             /* DIN toggles this long after each rise; negative: before */
};

/* tCLK is 244.140625 ns. */
static const struct {
    const char *what;
    struct wave w;
    struct ads1282_limits want;
} limits[] = {
    {"all well", {976, 488, 300}, {0}},
    {"fastest: 2 tCLK", {489, 244, 240}, {0}},
    {"slowest: 16 tCLK, high and low 8", {3906, 1953, 1000}, {0}},
    {"high 10 tCLK", {3906, 2441, 1000}, {.sclk_width = 0}},
    {"period below 2 tCLK", {487, 243, 240}, {.sclk_period = 7}},
    {"period above 16 tCLK", {3909, 1954, 1000}, {.sclk_period = 7}},
    {"high below 0.8 tCLK", {976, 194, 400}, {.sclk_width = 8}},
    {"high just 0.8 tCLK", {976, 196, 400}, {0}},
    {"low below 0.8 tCLK", {976, 976 - 194, 400}, {.sclk_width = 7}},
    {"high above 10 tCLK", {3906, 2444, 1000}, {.sclk_width = 8}},
    {"low above 10 tCLK", {3906, 3906 - 2444, 1000}, {.sclk_width = 7}},
    {"DIN 50 ns before the rise", {976, 488, -50}, {0}},
    {"DIN 49 ns before", {976, 488, -49}, {.din_setup = 8}},
    {"DIN 50 ns after", {976, 488, 50}, {0}},
    {"DIN 49 ns after", {976, 488, 49}, {.din_hold = 8}},
};

static void clock_byte(struct rig *r, const struct wave *w, int64_t from_ns)
{
    bool din = false;
    for (int i = 0; i < 8; i++) {
        const int64_t rise_ns = from_ns + i * w->period_ns;
        const int64_t fall_ns = rise_ns + w->high_ns;
        for (int edge = 0; edge < 3; edge++) { /* in the order of time */
            const int64_t din_ns = rise_ns + w->din_ns;
            const int turn = w->din_ns < 0 ? 0 : w->din_ns < w->high_ns ? 1 : 2;
            if (edge == turn) {
                sched_run_until(&r->s, din_ns);
                ads1282_din_pin(&r->a, din = !din, din_ns);
            } else if (edge == (turn == 0)) {
                sched_run_until(&r->s, rise_ns);
                ads1282_sclk_pin(&r->a, true, rise_ns);
            } else {
                sched_run_until(&r->s, fall_ns);
                ads1282_sclk_pin(&r->a, false, fall_ns);
            }
        }
    }
}

static void limits_are(const char *what, const struct ads1282_limits *got, const struct ads1282_limits *want)
{
    if (memcmp(got, want, sizeof *got) == 0) return; /* uint32_t only: no padding */
    fail_msg("%s: period %u, width %u, set-up %u, hold %u, DRDY %u, SYNC %u, keep-out %u, RESET %u", what,
             got->sclk_period, got->sclk_width, got->din_setup, got->din_hold, got->drdy_to_sclk, got->sync_width,
             got->sync_keepout, got->reset_width);
}

static void breaches_of_the_sclk_and_din_limits_are_counted(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(limits); k++) {
        struct rig r;
        powered(&r, &quiet);
        sched_run_until(&r.s, 100000);
        clock_byte(&r, &limits[k].w, 100000);
        limits_are(limits[k].what, &r.a.limit, &limits[k].want);
        hex_is(r.a.spi.in, limits[k].w.din_ns < 0 ? 0xAA : 0x55); /* the byte counts all the same */
    }
}

static void the_first_bit_wants_100_ns_after_drdy(void **state)
{
    (void)state;
    for (int64_t dt_ns = 99; dt_ns <= 100; dt_ns++) {
        struct rig r;
        powered(&r, &quiet);
        const int64_t t_ns = to_fall(&r) + dt_ns;
        sched_run_until(&r.s, t_ns);
        ads1282_sclk_pin(&r.a, true, t_ns);
        assert_int_equal(r.a.limit.drdy_to_sclk, dt_ns < 100);
    }
}

static void brief_pulses_of_sync_and_reset_are_counted(void **state)
{
    (void)state;
    static const struct {
        int64_t low_ns, high_ns;
        uint32_t want;
    } rows[] = {{489, 489, 0}, {488, 488, 0}, {487, 489, 1}, {489, 487, 1}, {100, 100, 2}};
    for (unsigned k = 0; k < COUNT(rows); k++) {
        struct rig r;
        powered(&r, &quiet);
        int64_t t_ns = 100000;
        for (int i = 0; i < 5; i++) { /* edges high, low, high, low, ...: the first has a long low before it */
            sched_run_until(&r.s, t_ns);
            ads1282_sync_pin(&r.a, i % 2 == 0, t_ns);
            t_ns += i == 0 || i == 2 ? rows[k].high_ns : rows[k].low_ns;
            if (i == 2) break;
        }
        ads1282_sync_pin(&r.a, false, t_ns);
        assert_int_equal(r.a.limit.sync_width, rows[k].high_ns < 488 ? 2 + (rows[k].low_ns < 488) : rows[k].want);
        assert_int_equal(r.a.count.restarts, 2); /* obeyed all the same */
        t_ns += 100000;
        ads1282_reset_pin(&r.a, false, t_ns);
        ads1282_reset_pin(&r.a, true, t_ns + rows[k].low_ns);
        assert_int_equal(r.a.limit.reset_width, rows[k].low_ns < 488);
    }
}

/* Edge 4096 of CLK lies at 1000000 ns exactly, its neighbours 244.14 ns away. */
static void a_sync_rise_within_30_ns_of_clk_is_counted_and_strictly_one_clk_late(void **state)
{
    (void)state;
    static const struct {
        int64_t t_ns;
        bool counted;
        int64_t edge, strict_edge;
    } rows[] = {
        {1000000 - 31, false, 4096, 4096}, {1000000 - 29, true, 4096, 4097},  {1000000, true, 4096, 4097},
        {1000000 + 29, true, 4097, 4097},  {1000000 + 31, false, 4097, 4097},
    };
    for (unsigned k = 0; k < 2 * COUNT(rows); k++) {
        struct rig r;
        struct ads1282_cfg cfg = quiet;
        cfg.strict_sync = k % 2;
        powered(&r, &cfg);
        sched_run_until(&r.s, rows[k / 2].t_ns);
        ads1282_sync_pin(&r.a, true, rows[k / 2].t_ns);
        assert_int_equal(r.a.limit.sync_keepout, rows[k / 2].counted);
        const int64_t edge = cfg.strict_sync ? rows[k / 2].strict_edge : rows[k / 2].edge;
        assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, edge + T_DR_1000));
    }
}

static void a_strict_part_misses_a_sync_after_a_brief_low(void **state)
{
    (void)state;
    for (int strict = 0; strict < 2; strict++) {
        struct rig r;
        struct ads1282_cfg cfg = quiet;
        cfg.strict_sync = strict;
        powered(&r, &cfg);
        ads1282_sync_pin(&r.a, true, at_tclk(&r, 1000));
        ads1282_sync_pin(&r.a, false, at_tclk(&r, 1010));
        ads1282_sync_pin(&r.a, true, at_tclk(&r, 1011));
        assert_int_equal(r.a.count.restarts, strict ? 1 : 2);
    }
}

/* ---- Gaps ---- */

/* By pins the gap is the data sheet's own: last rise to first rise. */
static void gaps_count_from_rise_to_rise(void **state)
{
    (void)state;
    static const struct {
        const char *what;
        int gap_tclk;
        bool strict, wreg_free, rreg;
        uint32_t violations;
        bool obeyed;
    } rows[] = {
        {"24 tCLK", 24, false, false, false, 0, true},
        {"23 tCLK, kind part", 23, false, false, false, 2, true},
        {"23 tCLK, strict part", 23, true, false, false, 2, false},
        {"24 tCLK, strict part", 24, true, false, false, 0, true},
        {"WREG needs none", 5, true, true, false, 0, true},
        {"RREG needs it", 23, true, false, true, 2, false},
        {"RREG needs it before its data alone", 23, true, true, true, 1, true},
        {"the same, kind part", 23, false, true, true, 1, true},
    };
    for (unsigned k = 0; k < COUNT(rows); k++) {
        struct rig r;
        struct ads1282_cfg cfg = quiet;
        cfg.strict_gap = rows[k].strict;
        cfg.wreg_gap_free = rows[k].wreg_free;
        powered(&r, &cfg);
        r.bus = PINS;
        SEND(&r, 0x11);
        at_tclk(&r, r.tclk + 100);
        byte(&r, rows[k].rreg ? 0x24 : 0x43);
        r.gap_tclk = rows[k].gap_tclk;
        byte(&r, 0x00);
        const uint8_t last = byte(&r, 0x07);
        const bool obeyed = rows[k].rreg ? last == 0x03 : reg_peek(&r.a.regs, ADS1282_HPF0) == 0x07;
        if (r.a.count.gap_violations != rows[k].violations || obeyed != rows[k].obeyed)
            fail_msg("%s: %u, obeyed %d", rows[k].what, r.a.count.gap_violations, obeyed);
        if (!rows[k].obeyed) assert_true(r.a.count.refused > 0);
    }
}

static void a_lost_byte_takes_its_command_with_it(void **state)
{
    (void)state;
    struct rig r;
    struct ads1282_cfg cfg = quiet;
    cfg.strict_gap = true;
    powered(&r, &cfg);
    byte(&r, 0x43);
    r.gap_tclk = 10;
    byte(&r, 0x00);
    r.gap_tclk = 30;
    SEND(&r, 0x11); /* an opcode again, not the byte of a WREG */
    assert_false(r.a.rdatac);
    hex_is(reg_peek(&r.a.regs, ADS1282_HPF0), 0x32);
    assert_int_equal(r.a.count.refused, 1);
}

/* ---- Interface time-out ---- */

static void sclk_must_rest_low_for_64_periods(void **state)
{
    (void)state;
    for (int high = 0; high < 2; high++) {
        struct rig r;
        powered(&r, &quiet);
        r.bus = PINS;
        to_fall(&r);
        ads1282_sclk_pin(&r.a, true, r.s.now_ns + 1000);
        if (!high) ads1282_sclk_pin(&r.a, false, r.s.now_ns + 1488);
        for (int i = 0; i < 64; i++) to_fall(&r);
        assert_int_equal(r.a.count.realigned, !high);
        ads1282_sclk_pin(&r.a, false, r.s.now_ns + 1000);
        at_tclk(&r, r.tclk + 100);
        wreg(&r, ADS1282_HPF0, 0x77);
        hex_is(reg_peek(&r.a.regs, ADS1282_HPF0), high ? 0x32 : 0x77);
    }
}

/* 64 data periods of the rate that CONFIG0 names; of 1000 words/s where it names none. */
static void the_time_out_also_runs_while_the_converter_stands_still(void **state)
{
    (void)state;
    static const struct {
        const char *what;
        uint8_t n, bytes[3];
        int64_t period_tclk;
    } rows[] = {
        {"STANDBY", 1, {0x02}, 4096},
        {"reserved rate", 3, {0x41, 0x00, 0x6A}, 4096},
        {"modulator output", 3, {0x41, 0x00, 0x50}, 4096},
        {"sinc only", 3, {0x41, 0x00, 0x51}, 128},
    };
    for (unsigned k = 0; k < 2 * COUNT(rows); k++) {
        struct rig r;
        powered(&r, &quiet);
        to_fall(&r);
        send(&r, rows[k / 2].n, rows[k / 2].bytes);
        const int64_t restart = r.tclk;
        SEND(&r, 0x43, 0x00); /* WREG without its byte */
        const int periods = k % 2 ? 66 : 62;
        at_tclk(&r, restart + 968 + periods * rows[k / 2].period_tclk);
        if (rows[k / 2].period_tclk > 1000) at_tclk(&r, restart + periods * 4096 + 4484);
        if (r.a.count.realigned != (unsigned)(k % 2)) fail_msg("%s, %d periods", rows[k / 2].what, periods);
        SEND(&r, 0x11); /* its byte, or SDATAC */
        assert_int_equal(r.a.rdatac, k % 2 == 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bytes_bits_and_pins_drive_the_same_chip),
        cmocka_unit_test(dout_changes_at_falls_of_sclk_only),
        cmocka_unit_test(the_same_level_again_is_no_edge),
        cmocka_unit_test(dout_is_low_without_power_and_in_reset),
        cmocka_unit_test(a_read_by_pins_tears_at_its_bit),
        cmocka_unit_test(sclk_in_the_last_4_tclk_before_an_update_is_a_late_read),
        cmocka_unit_test(breaches_of_the_sclk_and_din_limits_are_counted),
        cmocka_unit_test(the_first_bit_wants_100_ns_after_drdy),
        cmocka_unit_test(brief_pulses_of_sync_and_reset_are_counted),
        cmocka_unit_test(a_sync_rise_within_30_ns_of_clk_is_counted_and_strictly_one_clk_late),
        cmocka_unit_test(a_strict_part_misses_a_sync_after_a_brief_low),
        cmocka_unit_test(gaps_count_from_rise_to_rise),
        cmocka_unit_test(a_lost_byte_takes_its_command_with_it),
        cmocka_unit_test(sclk_must_rest_low_for_64_periods),
        cmocka_unit_test(the_time_out_also_runs_while_the_converter_stands_still),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* libpsabench: the AD7710 family at its pins, as a bit-banging driver has them. */
#include "api_rig.h"

#include <math.h>

static void frame_begin(psabench_part *p, const char *frame, int level)
{
    set(p, "A0", level);
    run(psabench_of(p), 300);
    set(p, frame, 0);
    run(psabench_of(p), 500);
}

static uint32_t read_bits(psabench_part *p, int level, unsigned bits)
{
    uint32_t word = 0;
    frame_begin(p, "RFS", level);
    for (unsigned i = 0; i < bits; i++) {
        set(p, "SCLK", 1);
        word = word << 1 | (uint32_t)get(p, "SDATA");
        run(psabench_of(p), 500);
        set(p, "SCLK", 0);
        run(psabench_of(p), 500);
    }
    set(p, "RFS", 1);
    run(psabench_of(p), 500);
    return word;
}

static void write_bits(psabench_part *p, int level, uint32_t word)
{
    frame_begin(p, "TFS", level);
    for (unsigned i = 0; i < 24; i++) {
        set(p, "SDATA", word >> (23 - i) & 1);
        run(psabench_of(p), 500);
        set(p, "SCLK", 1);
        run(psabench_of(p), 500);
        set(p, "SCLK", 0);
    }
    run(psabench_of(p), 500);
    set(p, "TFS", 1);
    set(p, "SDATA", 0);
    run(psabench_of(p), 500);
}

static uint32_t control_of(const psabench_part *p)
{
    uint32_t word = 0;
    for (unsigned i = 0; i < 3; i++) word = word << 8 | (uint32_t)psabench_peek(p, i);
    return word;
}

static void clean(const psabench_part *p)
{
    static const char *const names[] = {"a0_violations", "sclk_violations", "sdata_violations", "frame_violations",
                                        "stale_reads",   "refused",         "dropped",          "over_reads"};
    for (unsigned i = 0; i < COUNT(names); i++) assert_int_equal(counter(p, names[i]), 0);
}

/* From power-up to a calibrated word of 24 bits and back to the coefficient, with pins alone. */
static void a_driver_at_the_pins(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ad7712", "adc", "noise_scale=0 offset_v=0.01 gain_error=-0.02");
    assert_int_equal(get(p, "DRDY"), 1);
    until(p, "DRDY", 0);
    assert_int_equal(psabench_now_ns(b), 3 * 325 * 51200);
    good(b, psabench_set_volts(p, 0, 1.5));
    good(b, psabench_set_volts(p, 1, 0.25));
    write_bits(p, 0, 0x208013); /* self-calibration, 24 bits, 1028 Hz */
    assert_int_equal(control_of(p), 0x208013);
    until(p, "DRDY", 1);
    until(p, "DRDY", 0);
    assert_int_equal(control_of(p), 0x008013);
    const uint32_t word = read_bits(p, 1, 24);
    assert_true(fabs(word / 8388608.0 - 1.5) < 1e-6); /* 1.25 V of 2.5 V */
    assert_int_equal(get(p, "DRDY"), 1);
    assert_int_equal(read_bits(p, 0, 24), 0x008013);
    write_bits(p, 0, 0xE08013);
    const uint32_t full = read_bits(p, 1, 24);
    assert_true(fabs(full - 4194304 / 0.98) < 2.0);
    for (unsigned i = 0; i < 3; i++) assert_int_equal(psabench_peek(p, 6 + i), full >> (16 - 8 * i) & 0xFF);
    assert_int_equal(psabench_peek(p, 18), PSABENCH_BAD_ARGUMENT);
    assert_int_equal(counter(p, "calibrations"), 1);
    assert_int_equal(counter(p, "sampling_hz"), 39062);
    clean(p);
    psabench_free(b);
}

static uint32_t settled_word(psabench_part *p, uint32_t control)
{
    write_bits(p, 0, control);
    run(psabench_of(p), 5 * MS);
    until(p, "DRDY", 0);
    return read_bits(p, 1, 24);
}

static void inputs_of_each_part(void **state)
{
    (void)state;
    static const struct {
        const char *part;
        int inputs;
        double ain1_v, ain2_v, full2_v;
    } rows[] = {{"ad7710", 4, 0.5, 0.4, 2.5},
                {"ad7711", 3, 0.5, 0.75, 2.5},
                {"ad7711a", 2, 0.5, 0.0, 2.5},
                {"ad7712", 3, 0.5, 0.75, 10.0}};
    static const double volts[] = {0.75, 0.25, 0.75, 0.35};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        psabench *b = psabench_new(1);
        psabench_part *p = part(b, rows[i].part, "u", "noise_scale=0");
        for (int k = 0; k < 4; k++) assert_int_equal(psabench_set_volts(p, k, volts[k]) < 0, k >= rows[i].inputs);
        assert_true(fabs(settled_word(p, 0x008013) / 8388608.0 - 1.0 - rows[i].ain1_v / 2.5) < 2e-7);
        assert_true(fabs(settled_word(p, 0x028013) / 8388608.0 - 1.0 - rows[i].ain2_v / rows[i].full2_v) < 2e-7);
        settled_word(p, 0x00C013); /* b14 */
        static const unsigned iout_na[] = {20000, 200000, 400000, 0};
        assert_int_equal(counter(p, "iout_na"), iout_na[i]);
        assert_int_equal(counter(p, "bad_bit"), i == 3);
        clean(p);
        psabench_free(b);
    }
}

static void options_reach_the_chip(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ad7712", "a", "clkin_hz=8000000 vref_v=2 noise_scale=0 looks=1 source_ohm=10000");
    until(p, "DRDY", 0);
    assert_int_equal(psabench_now_ns(b), 3 * 325 * 64000);
    good(b, psabench_set_volts(p, 0, 1.0));
    const uint32_t word = settled_word(p, 0x008013);
    assert_true(fabs(word / 8388608.0 - 1.5) < 1e-5);
    const uint32_t burnt = settled_word(p, 0x00A013); /* 4.5 uA in 10 kohm */
    assert_true(fabs((double)(burnt - word) / 8388608.0 - 0.045 / 2.0) < 1e-5);
    psabench_part *q = part(b, "ad7712", "b",
                            "noise_scale=0 rfs_access_ns=400 bit_access_ns=220 drdy_rise_ns=110 strict_drdy=1 "
                            "strict_timing=1 free_settling=1");
    until(q, "DRDY", 0);
    set(q, "A0", 1);
    run(b, 200);
    set(q, "RFS", 0);
    run(b, 399);
    assert_int_equal(get(q, "SDATA"), 0);
    run(b, 1);
    assert_int_equal(get(q, "SDATA"), 1); /* 8000h */
    set(q, "RFS", 1);
    run(b, 1000);
    read_bits(q, 1, 16);
    assert_int_equal(read_bits(q, 1, 16), 0xFFFF);
    assert_int_equal(counter(q, "stale_reads"), 1);
    assert_null(psabench_part_new(b, "ad7712", "c", "looks=3"));
    assert_null(psabench_part_new(b, "ad7712", "c", "clkin_hz=399999"));
    psabench_free(b);
}

struct sclk_log {
    int edges;
    uint32_t word;
};

static void on_sclk(void *ctx, psabench_part *p, int number, int level, int64_t t_ns)
{
    (void)number;
    (void)t_ns;
    struct sclk_log *log = ctx;
    log->edges++;
    if (level) log->word = log->word << 1 | (uint32_t)get(p, "SDATA");
}

static void self_clocking_can_be_watched(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ad7712", "u", "noise_scale=0");
    struct sclk_log log = {0};
    set(p, "MODE", 1);
    good(b, psabench_watch(p, pin(p, "SCLK"), on_sclk, &log));
    log = (struct sclk_log){0};
    set(p, "A0", 1);
    until(p, "DRDY", 0);
    set(p, "RFS", 0);
    run(b, 20000);
    assert_int_equal(log.edges, 32);
    assert_int_equal(log.word, 0x8000);
    assert_int_equal(get(p, "DRDY"), 1);
    psabench_free(b);
}

static void stranger_kinds_of_access_are_refused(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ad7710", "u", "");
    uint8_t byte = 0;
    assert_true(psabench_spi(p, &byte, &byte, 1) < 0); /* it has no SPI port */
    assert_true(psabench_set(p, pin(p, "DRDY"), 1) < 0);
    assert_true(psabench_pin_is_input(p, pin(p, "SDATA")) && psabench_pin_is_input(p, pin(p, "SCLK")));
    assert_true(psabench_board_read(p, 0, 0, MS) < 0);
    psabench_free(b);
}

/* Three parts that share SYNC are in step; noise is each one's own and the seed's. */
static void parts_on_one_bench(void **state)
{
    (void)state;
    uint32_t words[2][3];
    for (unsigned run_no = 0; run_no < 2; run_no++) {
        psabench *b = psabench_new(5);
        psabench_part *p[3];
        static const char *const names[] = {"x", "y", "z"};
        for (unsigned i = 0; i < 3; i++) p[i] = part(b, "ad7712", names[i], "");
        for (unsigned i = 0; i < 3; i++) write_bits(p[i], 0, 0x008013);
        for (unsigned i = 0; i < 3; i++) set(p[i], "SYNC", 0);
        run(b, 1000);
        for (unsigned i = 0; i < 3; i++) set(p[i], "SYNC", 1);
        until(p[0], "DRDY", 0);
        for (unsigned i = 0; i < 3; i++) assert_int_equal(get(p[i], "DRDY"), 0);
        for (unsigned i = 0; i < 3; i++) words[run_no][i] = read_bits(p[i], 1, 24);
        assert_true(words[run_no][0] != words[run_no][1] && words[run_no][1] != words[run_no][2]);
        psabench_free(b);
    }
    assert_memory_equal(words[0], words[1], sizeof words[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_driver_at_the_pins),
        cmocka_unit_test(inputs_of_each_part),
        cmocka_unit_test(options_reach_the_chip),
        cmocka_unit_test(self_clocking_can_be_watched),
        cmocka_unit_test(stranger_kinds_of_access_are_refused),
        cmocka_unit_test(parts_on_one_bench),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Reading the ADS1256: DRDY, RDATA, RDATAC, gaps and bits (sources 2.4, 2.5). */
#include "ads1256_rig.h"
#include "base/rng.h"

static void data_read_inside_t6_is_garbled_when_strict(void **state)
{
    (void)state;
    static const uint8_t reads[][2] = {{0x11, 0x00}, {0x01}};
    for (unsigned strict = 0; strict < 2; strict++) {
        for (unsigned i = 0; i < COUNT(reads); i++) {
            struct ads1256_cfg cfg = quiet;
            cfg.strict_timing = strict;
            struct rig r;
            rig_up(&r, &cfg);
            r.v[0] = 1.0;
            set_rate(&r, 0x82);
            xfer(&r, reads[i][0]);
            if (i == 0) xfer(&r, reads[i][1]);
            wait_ns(&r, tau_ns(50) - FIRST_NS - 1); /* one nanosecond short of t6 */
            const uint8_t first = xfer(&r, 0);
            assert_int_equal(first, strict ? 0xFF : i == 0 ? 0x01 : 0x19);
            assert_int_equal(r.a.n.gap_violations, 1);
            if (i == 1) assert_int_equal(xfer(&r, 0), strict ? 0xFF : 0x99);
            if (i == 1) xfer(&r, 0);
            wait_ns(&r, T11_NS);
            assert_int_equal(rreg(&r, ADS1256_DRATE), 0x82); /* the next one is sound */
        }
    }
}

static void drdy_rises_with_the_24th_bit_and_not_before(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    set_rate(&r, 0x92);
    assert_int_equal(rreg(&r, ADS1256_STATUS) & 1, 0);
    const uint32_t overruns = r.a.n.overruns;
    xfer(&r, 0x01);
    wait_ns(&r, T6_NS);
    xfer(&r, 0);
    xfer(&r, 0);
    assert_false(ads1256_drdy(&r.a));
    const int64_t last_bit_ns = r.s.now_ns + BYTE_NS;
    xfer(&r, 0);
    assert_true(ads1256_drdy(&r.a));
    assert_int_equal(r.edge[r.edges - 1].t_ns, last_bit_ns);
    wait_ns(&r, T11_NS);
    assert_int_equal(rreg(&r, ADS1256_STATUS) & 1, 1); /* the bit follows the pin */
    await_fall(&r);
    assert_int_equal(r.a.n.overruns, overruns);
    assert_int_equal(rreg(&r, ADS1256_STATUS) & 1, 0);
}

static void no_data_without_rdata_or_rdatac(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    r.v[0] = 1.0;
    set_rate(&r, 0x92);
    for (int i = 0; i < 6; i++) assert_int_equal(xfer(&r, 0), ADS1256_DOUT_IDLE);
    assert_false(ads1256_drdy(&r.a));
    assert_int_equal(rdata(&r), 1677721); /* 1 V of 5 V full scale */
    assert_int_equal(rdata(&r), 1677721); /* asked again, the same word */
}

static void rdatac_gives_a_word_at_each_fall_until_an_embedded_sdatac(void **state)
{
    (void)state;
    for (unsigned at = 0; at < 3; at++) { /* the byte of the read that carries 0Fh */
        struct rig r;
        rig_up(&r, &quiet);
        r.v[0] = 1.0;
        set_rate(&r, 0x92);
        xfer(&r, 0x03);
        wait_ns(&r, T6_NS);
        assert_int_equal(read_word(&r), 1677721);
        r.v[0] = -1.0;
        await_fall(&r);
        await_fall(&r);
        assert_int_equal(read_word(&r), -1677721);
        assert_int_equal(xfer(&r, 0x51), ADS1256_DOUT_IDLE); /* read out; other commands are ignored */
        await_fall(&r);
        int32_t v = 0;
        for (unsigned i = 0; i < 3; i++) v = v << 8 | xfer(&r, i == at ? 0x0F : 0x00);
        assert_int_equal(v, -1677721 & 0xFFFFFF); /* the word itself comes out whole */
        assert_true(ads1256_drdy(&r.a));
        await_fall(&r);
        assert_int_equal(read_word(&r), 0);
        assert_false(ads1256_drdy(&r.a));
        assert_int_equal(rreg(&r, ADS1256_DRATE), 0x92);
        assert_int_equal(r.a.n.gap_violations, 0);
        assert_int_equal(r.a.n.bad_opcodes, 0);
        assert_int_equal(r.a.n.torn_reads, 0);
    }
}

static void sdatac_alone_ends_the_mode_and_the_word(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    r.v[0] = 1.0;
    set_rate(&r, 0x92);
    xfer(&r, 0x03);
    wait_ns(&r, T6_NS);
    command(&r, 0x0F);
    assert_int_equal(rreg(&r, ADS1256_DRATE), 0x92);
    assert_false(ads1256_drdy(&r.a)); /* nothing of the word was read meanwhile */
    xfer(&r, 0x03);
    wait_ns(&r, T6_NS);
    command(&r, 0x0F);
    await_fall(&r);
    assert_int_equal(read_word(&r), 0); /* what was left of the old word is gone with the new one */
    assert_int_equal(r.a.n.gap_violations, 0);
    xfer(&r, 0x03);
    wait_ns(&r, T6_NS);
    read_word(&r);
    command(&r, 0x0F); /* with DRDY high */
    assert_int_equal(r.a.n.gap_violations, 1);
}

static void rdatac_outlives_chip_select_and_offers_a_word_anew(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    r.v[0] = 1.0; /* 199999h */
    set_rate(&r, 0x82);
    xfer(&r, 0x03);
    wait_ns(&r, T6_NS);
    assert_int_equal(xfer(&r, 0), 0x19);
    ads1256_cs_pin(&r.a, true, r.s.now_ns + 2000);
    for (unsigned i = 0; i < 5; i++) assert_int_equal(xfer(&r, 0), ADS1256_DOUT_IDLE); /* for others on the bus */
    ads1256_cs_pin(&r.a, false, r.s.now_ns + 3000);
    wait_ns(&r, 3000);
    assert_int_equal(read_word(&r), 1677721);
    assert_int_equal(r.a.n.dropped, 1);
    ads1256_cs_pin(&r.a, true, r.s.now_ns + 2000);
    ads1256_cs_pin(&r.a, false, r.s.now_ns + 3000);
    wait_ns(&r, 3000);
    assert_int_equal(xfer(&r, 0), ADS1256_DOUT_IDLE); /* but not one that has been read */
    ads1256_cs_pin(&r.a, true, r.s.now_ns + 2000);
    await_fall(&r);
    ads1256_cs_pin(&r.a, false, r.s.now_ns);
    assert_int_equal(read_word(&r), 1677721);
    assert_int_equal(r.a.n.dropped, 1);
}

static void rdatac_ends_with_chip_select_when_strict(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.strict_cs = true;
    for (unsigned bytes = 0; bytes < 4; bytes++) {
        struct rig r;
        rig_up(&r, &cfg);
        r.v[0] = 1.0;
        set_rate(&r, 0x82);
        xfer(&r, 0x03);
        wait_ns(&r, T6_NS);
        for (unsigned i = 0; i < bytes; i++) xfer(&r, 0);
        ads1256_cs_pin(&r.a, true, r.s.now_ns + 2000);
        ads1256_cs_pin(&r.a, false, r.s.now_ns + 3000);
        await_fall(&r);
        assert_int_equal(read_word(&r), 0);
        assert_int_equal(rreg(&r, ADS1256_DRATE), 0x82);
        assert_int_equal(r.a.n.dropped, bytes == 1 || bytes == 2);
    }
}

/* A byte of the word that begins in the 16 tau before an update: counted, and garbled when strict. */
static void reads_in_the_update_window_are_counted(void **state)
{
    (void)state;
    for (unsigned row = 0; row < 6; row++) {
        const bool strict = row & 1;
        const int64_t before_tau = (int64_t[]){17, 15, 0}[row / 2]; /* first edge before the update */
        struct ads1256_cfg cfg = quiet;
        cfg.strict_bus = strict;
        struct rig r;
        rig_up(&r, &cfg);
        r.v[0] = 1.0; /* 199999h */
        set_rate(&r, 0x92);
        await_fall(&r);
        const int64_t next_ns = r.s.now_ns + tau_ns(256 * 60);
        wait_ns(&r, tau_ns(256 * 60) - 20000);
        xfer(&r, 0x01);
        const int64_t first_ns = next_ns - tau_ns(before_tau);
        wait_ns(&r, first_ns - FIRST_NS - r.s.now_ns + 1);
        const bool inside = before_tau == 15;
        assert_int_equal(xfer(&r, 0), inside && strict ? 0xFF : 0x19);
        assert_int_equal(r.a.n.window_reads, inside);
    }
}

/* After SDATAC the next command waits for DRDY: counted if it comes while DRDY is still high. */
static void command_after_sdatac_waits_for_drdy(void **state)
{
    (void)state;
    for (unsigned waits = 0; waits < 3; waits++) {
        struct rig r;
        rig_up(&r, &quiet);
        set_rate(&r, 0x92);
        xfer(&r, 0x03);
        wait_ns(&r, T6_NS);
        xfer(&r, 0);
        xfer(&r, 0);
        command(&r, 0x0F); /* with the last byte of the word */
        assert_true(ads1256_drdy(&r.a));
        if (waits) await_fall(&r);
        if (waits == 2)
            wait_ns(&r, tau_ns(256 * 60 - 14) - FIRST_NS); /* in the pulse before the next one: DRDY has been */
        rreg(&r, ADS1256_DRATE);
        assert_int_equal(r.a.n.gap_violations, !waits);
        rreg(&r, ADS1256_DRATE);
        assert_int_equal(r.a.n.gap_violations, !waits);
    }
}

static void only_the_first_word_of_a_hasty_rdatac_is_garbled(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.strict_timing = true;
    struct rig r;
    rig_up(&r, &cfg);
    r.v[0] = 1.0;
    set_rate(&r, 0x82);
    xfer(&r, 0x03);
    assert_int_equal(read_word(&r), -1);
    await_fall(&r);
    assert_int_equal(read_word(&r), 1677721);
}

static void reset_command_is_obeyed_inside_an_rdatac_read(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    set_rate(&r, 0x92);
    xfer(&r, 0x03);
    wait_ns(&r, T6_NS);
    xfer(&r, 0);
    xfer(&r, 0xFE);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_DRATE), 0xF0);
    await_fall(&r);
    assert_int_equal(rreg(&r, ADS1256_DRATE), 0xF0);
}

static void a_read_across_an_update_is_torn_and_counted(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    r.v[0] = 2.5; /* 400000h */
    set_rate(&r, 0x92);
    r.v[0] = -0.01; /* FFBE77h */
    await_fall(&r);
    await_fall(&r);
    r.v[0] = 2.5;
    xfer(&r, 0x01);
    wait_ns(&r, T6_NS);
    assert_int_equal(xfer(&r, 0), 0xFF);
    wait_ns(&r, 3 * tau_ns(256 * 60)); /* new words, 2.5 V */
    assert_int_equal(xfer(&r, 0), 0x00);
    assert_int_equal(xfer(&r, 0), 0x00);
    assert_true(r.a.n.torn_reads > 0);
}

/* 250 phases of a read to the update, 84 of them between the first SCLK of the first byte and that of the last: what the host
 * has in its hand decides. */
static void torn_is_counted_for_mixed_words_and_no_others(void **state)
{
    (void)state;
    for (unsigned continuous = 0; continuous < 2; continuous++) {
        unsigned mixed = 0;
        for (int64_t lead_ns = 100; lead_ns <= 25000; lead_ns += 100) {
            struct rig r;
            rig_up(&r, &quiet);
            r.v[0] = 1.0;
            set_rate(&r, 0x92);
            if (continuous) xfer(&r, 0x03);
            const int64_t first_ns = await_fall(&r), second_ns = await_fall(&r), old = r.a.word & 0xFFFFFF;
            r.v[0] = -0.7;
            wait_ns(&r, second_ns - first_ns - lead_ns);
            const uint32_t before = r.a.n.torn_reads;
            if (!continuous) {
                xfer(&r, 0x01);
                wait_ns(&r, T6_NS);
            }
            const int64_t got = read_word(&r) & 0xFFFFFF;
            wait_ns(&r, 30000); /* in any phase the new word has come */
            const int64_t new = r.a.word & 0xFFFFFF, differ = old ^ new;
            assert_true((differ & 0xFF0000) && (differ & 0xFF00) && (differ & 0xFF));
            const bool whole = got == old || got == new;
            if (r.a.n.torn_reads - before != !whole)
                fail_msg("%lld ns before DRDY: read %06llx of %06llx, %06llx", (long long)lead_ns, (long long)got,
                         (long long)old, (long long)new);
            mixed += !whole;
            if (continuous && got == old) assert_int_equal(read_word(&r) & 0xFFFFFF, new); /* from its first byte on */
        }
        assert_int_equal(mixed, 84);
    }
}

static void order_reverses_the_bits_of_each_output_byte(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    r.v[0] = 1.0; /* 199999h */
    set_rate(&r, 0x82);
    wreg(&r, ADS1256_STATUS, 0x08);
    assert_int_equal(rreg(&r, ADS1256_DRATE), 0x41);
    assert_int_equal(rdata(&r) & 0xFFFFFF, 0x989999);
}

/* The same random traffic bit by bit and byte by byte: the same answers, counters and registers. */
static void bits_and_bytes_drive_the_same_chip(void **state)
{
    (void)state;
    struct rng traffic = rng_stream(rig_seed(7), 0, "traffic");
    static const uint8_t likely[] = {0x00, 0x01, 0x03, 0x0F, 0x10, 0x50, 0x53, 0x82, 0xF0, 0xFC, 0xFE, 0x92, 0x04};
    struct rig byte, bit;
    rig_up(&byte, &quiet);
    rig_up(&bit, &quiet);
    byte.v[0] = bit.v[0] = 1.234;
    for (unsigned i = 0; i < 20000; i++) {
        const uint64_t x = rng_u64(&traffic);
        const uint8_t mosi = x & 1 ? likely[(x >> 8) % COUNT(likely)] : (uint8_t)(x >> 16);
        const int64_t pause_ns = (int64_t)((x >> 24) % 16 ? (x >> 32) % 9000 : (x >> 32) % 3000000);
        wait_ns(&byte, pause_ns);
        wait_ns(&bit, pause_ns);
        wait_ns(&bit, FIRST_NS);
        spi_first(&bit.a.spi, bit.s.now_ns);
        for (int b = 7; b >= 0; b--) {
            if (b == 0) wait_ns(&bit, BYTE_NS - FIRST_NS - 7 * 500);
            spi_sample(&bit.a.spi, mosi >> b & 1, bit.s.now_ns);
            if (b > 0) wait_ns(&bit, 500);
        }
        assert_int_equal(xfer(&byte, mosi), bit.a.spi.sent);
        assert_int_equal(byte.s.now_ns, bit.s.now_ns);
    }
    assert_memory_equal(byte.a.value, bit.a.value, ADS1256_REGS);
    assert_int_equal(byte.a.n.gap_violations, bit.a.n.gap_violations);
    assert_int_equal(byte.a.n.bad_opcodes, bit.a.n.bad_opcodes);
    assert_int_equal(byte.a.n.conversions, bit.a.n.conversions);
    assert_int_equal(byte.edges, bit.edges);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(data_read_inside_t6_is_garbled_when_strict),
        cmocka_unit_test(drdy_rises_with_the_24th_bit_and_not_before),
        cmocka_unit_test(no_data_without_rdata_or_rdatac),
        cmocka_unit_test(rdatac_gives_a_word_at_each_fall_until_an_embedded_sdatac),
        cmocka_unit_test(sdatac_alone_ends_the_mode_and_the_word),
        cmocka_unit_test(rdatac_outlives_chip_select_and_offers_a_word_anew),
        cmocka_unit_test(rdatac_ends_with_chip_select_when_strict),
        cmocka_unit_test(reads_in_the_update_window_are_counted),
        cmocka_unit_test(command_after_sdatac_waits_for_drdy),
        cmocka_unit_test(only_the_first_word_of_a_hasty_rdatac_is_garbled),
        cmocka_unit_test(reset_command_is_obeyed_inside_an_rdatac_read),
        cmocka_unit_test(a_read_across_an_update_is_torn_and_counted),
        cmocka_unit_test(torn_is_counted_for_mixed_words_and_no_others),
        cmocka_unit_test(order_reverses_the_bits_of_each_output_byte),
        cmocka_unit_test(bits_and_bytes_drive_the_same_chip),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

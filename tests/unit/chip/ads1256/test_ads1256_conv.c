/* Conversions, calibrations and codes of the ADS1256: sources 2.5 .. 2.8. */
#include "ads1256_rig.h"

/* Restart by the pin: first fall at t18 after the first clock edge, then every Navg * 256 tau, to the nanosecond. */
static void first_word_after_t18_then_periodic_at_every_rate(void **state)
{
    (void)state;
    static const uint32_t clocks_hz[] = {7680000, 4096000};
    for (unsigned c = 0; c < COUNT(clocks_hz); c++) {
        for (unsigned i = 0; i < ADS1256_RATES; i++) {
            struct ads1256_cfg cfg = quiet;
            cfg.clkin_hz = clocks_hz[c];
            cfg.cells_max = 1;
            struct rig r;
            rig_up(&r, &cfg);
            wreg(&r, ADS1256_DRATE, ads1256_rates[i].code);
            ads1256_sync_pin(&r.a, false, r.s.now_ns);
            wait_ns(&r, 1000);
            const int64_t k = clk_count_at(&r.a.clkin, r.s.now_ns);
            ads1256_sync_pin(&r.a, true, r.s.now_ns);
            const int64_t period_tau = 256 * (int64_t)ads1256_rates[i].navg;
            for (int64_t n = 0; n < 3; n++)
                assert_int_equal(await_fall(&r), clk_edge_ns(&r.a.clkin, k + 1382 + (n + 1) * period_tau));
            assert_int_equal(ads1256_settle_ns(&r.a), clk_span_ns(cfg.clkin_hz, 1382 + period_tau));
            assert_int_equal(r.a.n.restarts, 1);
        }
    }
}

static void unread_words_give_a_pulse_of_16_tau(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    set_rate(&r, 0x92);
    const uint32_t overruns = r.a.n.overruns;
    const unsigned from = r.edges;
    await_fall(&r);
    await_fall(&r);
    assert_int_equal(r.edges, from + 4);
    for (unsigned i = from; i < r.edges; i += 2) {
        assert_true(r.edge[i].level && !r.edge[i + 1].level);
        near((double)(r.edge[i + 1].t_ns - r.edge[i].t_ns), (double)tau_ns(16), 1.0);
    }
    assert_int_equal(r.a.n.overruns, overruns + 2);
}

/* At 100 SPS; SYNC halts the conversion, or WAKEUP alone restarts it. */
static void rig_of_sync(struct rig *r, bool halts)
{
    struct ads1256_cfg cfg = quiet;
    cfg.sync_halts = halts;
    rig_up(r, &cfg);
    set_rate(r, 0x82);
}

static void sync_command_restarts_at_the_first_edge_of_wakeup(void **state)
{
    (void)state;
    for (int halts = 0; halts < 2; halts++) {
        struct rig r;
        rig_of_sync(&r, halts);
        const unsigned edges = r.edges;
        command(&r, 0xFC);
        assert_int_equal(ads1256_drdy(&r.a), halts);
        wait_ns(&r, 50000000); /* held as long as one likes */
        assert_int_equal(r.edges > edges + 4, !halts);
        const int64_t first_edge_ns = r.s.now_ns + FIRST_NS;
        xfer(&r, 0x00);
        assert_true(ads1256_drdy(&r.a));
        const int64_t k = clk_count_at(&r.a.clkin, first_edge_ns);
        assert_int_equal(await_fall(&r), clk_edge_ns(&r.a.clkin, k + 1382 + 256 * 300));
        assert_int_equal(r.a.n.restarts, 1);
        assert_int_equal(r.a.n.gap_violations, 0);
    }
}

/* What libraries do that wait for DRDY before each command: they go on, or hang. */
static void drdy_between_sync_and_wakeup_goes_on_unless_sync_halts(void **state)
{
    (void)state;
    for (int halts = 0; halts < 2; halts++) {
        struct rig r;
        rig_of_sync(&r, halts);
        (void)rdata(&r); /* DRDY is high again */
        command(&r, 0xFC);
        for (int ms = 0; ms < 15 && ads1256_drdy(&r.a); ms++) wait_ns(&r, 1000000);
        assert_int_equal(ads1256_drdy(&r.a), halts);
        command(&r, 0xF0); /* what comes in between takes its place */
        await_fall(&r);
        const uint32_t restarts = r.a.n.restarts;
        command(&r, 0x00);
        assert_int_equal(r.a.n.restarts, restarts);
        assert_false(ads1256_drdy(&r.a));
    }
}

static void a_wakeup_slower_than_the_settling_time_restarts_at_its_end(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet); /* 30000 words/s: 0.21 ms */
    command(&r, 0xFC);
    spi_first(&r.a.spi, r.s.now_ns);
    wait_ns(&r, 2000000);
    spi_byte(&r.a.spi, 0x00, r.s.now_ns);
    const int64_t k = clk_count_at(&r.a.clkin, r.s.now_ns);
    assert_int_equal(await_fall(&r), clk_edge_ns(&r.a.clkin, k + 1382 + 256));
    assert_int_equal(await_fall(&r), clk_edge_ns(&r.a.clkin, k + 1382 + 2 * 256));
}

static void word_after_a_synchronised_channel_change_is_settled(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    r.v[0] = 1.0;
    r.v[3] = -2.0;
    r.v[8] = 0.5;
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        wreg(&r, ADS1256_MUX, 0x08);
        set_rate(&r, ads1256_rates[i].code);
        wreg(&r, ADS1256_MUX, 0x38);
        command(&r, 0xFC);
        xfer(&r, 0x00);
        near(rdata(&r), 0.5 / 5.0 * 8388608, 4); /* the previous channel's word */
        await_fall(&r);
        near(rdata(&r), -2.5 / 5.0 * 8388608, 4);
        assert_int_equal(r.a.n.calibrations, i + 2);
    }
}

static void unsynchronised_channel_change_mixes_the_running_word(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    r.v[2] = 2.0;
    set_rate(&r, 0x82);
    wait_ns(&r, 5000000);
    wreg(&r, ADS1256_MUX, 0x21);
    await_fall(&r);
    const int32_t mixed = rdata(&r);
    assert_true(mixed > 1000000 && mixed < 2400000); /* about half of 2/5 full scale */
    await_fall(&r);
    near(rdata(&r), 0.4 * 8388608, 4);
}

static void undefined_rate_codes_are_stored_and_keep_the_rate(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    set_rate(&r, 0x92);
    wreg(&r, ADS1256_DRATE, 0x20);
    assert_int_equal(rreg(&r, ADS1256_DRATE), 0x20);
    assert_int_equal(r.a.n.bad_drate, 1);
    const int64_t from_ns = await_fall(&r);
    near((double)(await_fall(&r) - from_ns), (double)tau_ns(256 * 60), 1.0);
}

static const struct {
    uint8_t pga_code;
    double vin_v;
    int32_t code;
    uint32_t clipped;
} ranges[] = {
    {0, 0.0, 0, 0},        {0, 2.5, 4194304, 0},   {0, -2.5, -4194304, 0}, {0, 4.9999999, 8388607, 0},
    {0, 5.1, 8388607, 1},  {0, -5.1, -8388608, 1}, {1, 1.0, 3355443, 0},   {3, 0.3, 4026532, 0},
    {6, 0.01, 1073742, 0}, {7, 0.01, 1073742, 0},  {6, 0.079, 8388607, 1}, {6, -0.079, -8388608, 1},
};

static void codes_follow_the_formula_at_every_gain(void **state)
{
    (void)state;
    for (unsigned i = 0; i < COUNT(ranges); i++) {
        struct rig r;
        rig_up(&r, &quiet);
        r.v[0] = 2.0 + ranges[i].vin_v;
        r.v[1] = 2.0;
        await_fall(&r);
        wreg(&r, ADS1256_ADCON, 0x20 | ranges[i].pga_code);
        set_rate(&r, 0x82);
        near(rdata(&r), ranges[i].code, 3); /* FSC has 22 bits */
        assert_int_equal(r.a.n.clipped > 0, ranges[i].clipped);
    }
}

/* Full scale is twice the reference. */
static void codes_scale_with_the_reference(void **state)
{
    (void)state;
    static const double vref_v[] = {0.5, 2.048, 2.5, 2.6};
    for (unsigned i = 0; i < COUNT(vref_v); i++) {
        struct ads1256_cfg cfg = quiet;
        cfg.vref_v = vref_v[i];
        struct rig r;
        rig_up(&r, &cfg);
        r.v[0] = 0.3;
        set_rate(&r, 0x82);
        near(rdata(&r), 0.3 / (2 * vref_v[i]) * 8388608, 4);
    }
}

static void fsc_kept_from_another_rate_is_a_gross_gain_error(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    r.v[0] = 1.0;
    await_fall(&r);
    wreg(&r, ADS1256_DRATE, 0x82); /* no ACAL: 44AC08h of 30 kSPS stays */
    await_fall(&r);
    await_fall(&r);
    near(rdata(&r) / 1677721.6, 1.172, 0.0005);
    assert_int_equal(rreg(&r, ADS1256_FSC2), 0x44);
}

static void self_calibration_takes_away_offset_and_gain_error(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.offset_v = 2e-3;
    cfg.gain_error = -0.004;
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        for (unsigned pga = 0; pga < 7; pga += 3) {
            struct rig r;
            rig_up(&r, &cfg);
            r.v[0] = 0.05;
            wreg(&r, ADS1256_ADCON, (uint8_t)(0x20 | pga));
            set_rate(&r, ads1256_rates[i].code);
            near(rdata(&r), 0.01 * (1 << pga) * 8388608, 4);
            const double ofc = ads1256_rates[i].alpha * 0.996 * (1 << pga) * 2e-3 / 5.0;
            assert_int_equal(rreg(&r, ADS1256_OFC0), (unsigned)lround(ofc) & 0xFF);
            assert_int_equal(rreg(&r, ADS1256_OFC1), (unsigned)lround(ofc) >> 8 & 0xFF);
        }
    }
}

static void offset_and_gain_calibrations_touch_their_own_registers_only(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.offset_v = 2e-3;
    cfg.gain_error = 0.01;
    for (uint8_t opcode = 0xF1; opcode <= 0xF2; opcode++) {
        struct rig r;
        rig_up(&r, &cfg);
        await_fall(&r);
        wreg(&r, ADS1256_OFC0, 0x55);
        wreg(&r, ADS1256_FSC0, 0x66);
        xfer(&r, opcode);
        await_fall(&r);
        assert_int_equal(reg_peek(&r.a.regs, ADS1256_OFC0) == 0x55, opcode == 0xF2);
        assert_int_equal(reg_peek(&r.a.regs, ADS1256_FSC0) == 0x66, opcode == 0xF1);
        assert_int_equal(r.a.n.calibrations, 2);
    }
}

/* From the command's last bit to the fall of DRDY: the printed time, to one clock. */
static void calibrations_last_as_printed(void **state)
{
    (void)state;
    static const struct {
        uint8_t drate, pga, opcode;
        double us;
    } rows[] = {
        {0xF0, 0, 0xF0, 596},   {0xF0, 2, 0xF0, 692},   {0xF0, 6, 0xF0, 892},     {0xF0, 0, 0xF1, 386.7},
        {0xF0, 0, 0xF2, 417},   {0xE0, 3, 0xF2, 551},   {0xD0, 4, 0xF0, 1029},    {0xC0, 0, 0xF0, 1300},
        {0xB0, 0, 0xF2, 1400},  {0xA1, 0, 0xF0, 3600},  {0x92, 1, 0xF0, 6600},    {0x82, 0, 0xF0, 31200},
        {0x82, 0, 0xF1, 20320}, {0x82, 0, 0xF2, 21000}, {0x03, 0, 0xF0, 1227200},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct rig r;
        rig_up(&r, &quiet);
        wreg(&r, ADS1256_ADCON, 0x20 | rows[i].pga);
        wreg(&r, ADS1256_DRATE, rows[i].drate);
        xfer(&r, rows[i].opcode);
        assert_true(ads1256_drdy(&r.a));
        const int64_t from_ns = r.s.now_ns;
        near((double)(await_fall(&r) - from_ns) * 1e-3, rows[i].us, 0.2);
    }
}

static void commands_during_a_calibration_are_counted(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet, 1);
    assert_int_equal(rreg(&r, ADS1256_STATUS), 0x31); /* a driver that polls the bit still learns it */
    assert_int_equal(r.a.n.gap_violations, 1);
    command(&r, 0xFC);
    assert_int_equal(r.a.n.refused, 1);
    ads1256_sync_pin(&r.a, false, r.s.now_ns);
    assert_int_equal(r.a.n.refused, 2);
    ads1256_sync_pin(&r.a, true, r.s.now_ns + 10000);
    near((double)await_fall(&r) * 1e-3, 596.0, 0.2); /* undisturbed */
}

/* The running period ends at its old length, the next one has the new length, and no calibration is made. */
static void unsynchronised_rate_change_takes_effect_at_the_next_word(void **state)
{
    (void)state;
    static const uint8_t codes[][2] = {{0x92, 0x82}, {0x82, 0x92}, {0x92, 0xF0}, {0xF0, 0x92}, {0xC0, 0xD0}};
    for (unsigned i = 0; i < COUNT(codes); i++) {
        struct rig r;
        rig_up(&r, &quiet);
        r.v[0] = 1.0;
        set_rate(&r, codes[i][0]);
        await_fall(&r);
        const int64_t from_ns = r.s.now_ns;
        wreg(&r, ADS1256_DRATE, codes[i][1]);
        const int64_t old_tau = ads1256_period_tau(ads1256_rate_of(codes[i][0]));
        const int64_t new_tau = ads1256_period_tau(ads1256_rate_of(codes[i][1]));
        near((double)(await_fall(&r) - from_ns), (double)tau_ns(old_tau), 1.0);
        near((double)(await_fall(&r) - from_ns), (double)tau_ns(old_tau + new_tau), 1.0);
        near((double)(await_fall(&r) - from_ns), (double)tau_ns(old_tau + 2 * new_tau), 1.0);
        const double alpha_ratio = (double)ads1256_rate_of(codes[i][1])->alpha / ads1256_rate_of(codes[i][0])->alpha;
        near(r.a.word, 1677721.6 * alpha_ratio, 4);
    }
}

static void multiplexer_codes_8_to_15_are_aincom(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    for (unsigned i = 0; i < 9; i++) r.v[i] = 0.25 * i;
    for (unsigned p = 0; p < 16; p++) {
        for (unsigned n = 0; n < 16; n++) {
            wreg(&r, ADS1256_MUX, (uint8_t)(p << 4 | n));
            command(&r, 0xFC);
            xfer(&r, 0x00);
            await_fall(&r);
            near(r.a.word, 0.05 * ((p < 8 ? p : 8) - (double)(n < 8 ? n : 8)) * 8388608, 4);
        }
    }
}

static void buffer_limits_the_inputs_to_avdd_less_2_v(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    r.v[0] = 3.5;
    r.v[1] = -0.5;
    set_rate(&r, 0x92);
    near(rdata(&r), 0.8 * 8388608, 4);
    assert_int_equal(r.a.n.buffer_clipped, 0);
    wreg(&r, ADS1256_STATUS, 0x02);
    await_fall(&r);
    await_fall(&r);
    near(rdata(&r), 0.6 * 8388608, 4); /* 3 V less 0 V */
    assert_true(r.a.n.buffer_clipped > 0);
}

/* Sample variance over 30 seeds of 40 words each: 1170 degrees of freedom, 5-sigma band of chi2; mean within 5 sigma. The table
 * itself is proved in test_ads1256_filter. */
static void noise_row(uint8_t drate, uint8_t pga, uint64_t seed)
{
    enum { SEEDS = 30, WORDS = 40 };
    const double lsb_v = 5.0 / 8388608 / (1 << pga);
    const double rms_lsb = ads1256_noise_v(ads1256_rate_of(drate), pga) / lsb_v;
    const double sigma_lsb = sqrt(rms_lsb * rms_lsb + 1.0 / 12.0); /* and rounding */
    double chi2 = 0.0;
    for (unsigned k = 0; k < SEEDS; k++) {
        struct ads1256_cfg cfg = quiet;
        cfg.noise_scale = 1.0;
        cfg.cells_max = 1;
        struct rig r;
        rig_up_seeded(&r, &cfg, seed + k);
        r.v[0] = 0.02;
        wreg(&r, ADS1256_ADCON, 0x20 | pga);
        set_rate(&r, drate);
        double sum = 0.0;
        double squares = 0.0;
        for (unsigned w = 0; w < WORDS; w++) {
            await_fall(&r);
            sum += r.a.word;
            squares += (double)r.a.word * r.a.word;
        }
        chi2 += (squares - sum * sum / WORDS) / (sigma_lsb * sigma_lsb);
        /* The offset calibration leaves its own draw in OFC: sqrt(1 + 1/WORDS) sigma about the true mean. */
        near(sum / WORDS, 0.004 * (1 << pga) * 8388608, 5.5 * sigma_lsb + 2.0);
    }
    const double freedom = SEEDS * (WORDS - 1);
    if (fabs(chi2 - freedom) > 5.0 * sqrt(2.0 * freedom))
        fail_msg("%02X, gain %d: chi2 %.0f of %.0f", drate, 1 << pga, chi2, freedom);
}

static void noise_is_the_published_one(void **state)
{
    (void)state;
    const uint64_t seed = rig_seed(1);
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        for (uint8_t pga = 0; pga < ADS1256_GAINS; pga++) noise_row(ads1256_rates[i].code, pga, seed);
    }
}

/* FNV-1a of words and DRDY edges of a noisy run: any compiler, any level of optimisation, any machine. */
static void same_seed_same_bytes_everywhere(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.noise_scale = 1.0;
    cfg.offset_v = 1.7e-3;
    cfg.gain_error = 3e-3;
    struct rig r;
    rig_up_seeded(&r, &cfg, 2026);
    uint64_t hash = UINT64_C(0xCBF29CE484222325);
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        r.v[0] = 0.1 * i - 0.7;
        set_rate(&r, ads1256_rates[i].code);
        for (unsigned w = 0; w < 5; w++) {
            const int64_t t_ns = await_fall(&r);
            hash = (hash ^ (uint64_t)r.a.word) * UINT64_C(0x100000001B3);
            hash = (hash ^ (uint64_t)t_ns) * UINT64_C(0x100000001B3);
        }
        hash = (hash ^ r.a.value[ADS1256_OFC0]) * UINT64_C(0x100000001B3);
    }
    assert_int_equal(hash, UINT64_C(0xE160496CC142746A));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unsynchronised_rate_change_takes_effect_at_the_next_word),
        cmocka_unit_test(multiplexer_codes_8_to_15_are_aincom),
        cmocka_unit_test(first_word_after_t18_then_periodic_at_every_rate),
        cmocka_unit_test(unread_words_give_a_pulse_of_16_tau),
        cmocka_unit_test(sync_command_restarts_at_the_first_edge_of_wakeup),
        cmocka_unit_test(drdy_between_sync_and_wakeup_goes_on_unless_sync_halts),
        cmocka_unit_test(a_wakeup_slower_than_the_settling_time_restarts_at_its_end),
        cmocka_unit_test(word_after_a_synchronised_channel_change_is_settled),
        cmocka_unit_test(unsynchronised_channel_change_mixes_the_running_word),
        cmocka_unit_test(undefined_rate_codes_are_stored_and_keep_the_rate),
        cmocka_unit_test(codes_follow_the_formula_at_every_gain),
        cmocka_unit_test(codes_scale_with_the_reference),
        cmocka_unit_test(fsc_kept_from_another_rate_is_a_gross_gain_error),
        cmocka_unit_test(self_calibration_takes_away_offset_and_gain_error),
        cmocka_unit_test(offset_and_gain_calibrations_touch_their_own_registers_only),
        cmocka_unit_test(calibrations_last_as_printed),
        cmocka_unit_test(commands_during_a_calibration_are_counted),
        cmocka_unit_test(buffer_limits_the_inputs_to_avdd_less_2_v),
        cmocka_unit_test(noise_is_the_published_one),
        cmocka_unit_test(same_seed_same_bytes_everywhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

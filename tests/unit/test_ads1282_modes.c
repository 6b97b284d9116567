/* ADS1281/ADS1282 beside plain FIR words: sinc only, modulator output, high-pass, continuous synchronisation, calibration,
 * STANDBY, power-up, PWDN, MFLAG and pin mode (sources 1.1, 1.6, 1.7). */
#include "ads1282_rig.h"

#include "base/bits.h"

/* ---- Sinc only ---- */

/* Sources 1.6 (M60) and 1.8; the data period is 4 N tCLK. */
static const struct {
    uint8_t dr;
    unsigned n;
    int64_t settle_tclk;
    int hz;
} sinc_rates[] = {
    {0, 128, 2824, 8000}, {1, 64, 1672, 16000}, {2, 32, 968, 32000}, {3, 16, 616, 64000}, {4, 8, 440, 128000}};

static void sinc_words_come_after_their_settling_time_then_every_4n_tclk(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(sinc_rates); k++) {
        for (int chain = ADS1282_CHAIN_EXACT; chain <= ADS1282_CHAIN_DIRECT; chain++) {
            struct rig r;
            struct ads1282_cfg cfg = quiet;
            cfg.chain = (enum ads1282_chain)chain;
            powered(&r, &cfg);
            wreg(&r, 1, (uint8_t)(0x41 | sinc_rates[k].dr << 3));
            int64_t from = r.tclk;
            for (int sync = 0; sync < 2; sync++) {
                for (int m = 0; m < 40; m++)
                    assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, from + sinc_rates[k].settle_tclk +
                                                                          m * 4 * (int64_t)sinc_rates[k].n));
                from = r.tclk + 5;
                ads1282_sync_pin(&r.a, false, r.s.now_ns);
                ads1282_sync_pin(&r.a, true, at_tclk(&r, from));
                assert_true(ads1282_drdy(&r.a));
            }
            assert_int_equal(ads1282_settle_ns(&r.a), clk_edge_ns(&r.clk, sinc_rates[k].settle_tclk));
            assert_int_equal(ads1282_period_ns(&r.a), NS_PER_S / sinc_rates[k].hz);
        }
    }
}

/* Sources 1.7: right-justified, half scale, not clipped; up to where the modulator saturates. */
static const struct {
    double fs;
    uint32_t word;
} sinc_words[] = {
    {0.0, 0x00000000},   {0x1p-30, 0x00000001},       {-0x1p-30, 0xFFFFFFFF}, {1.0 - 0x1p-30, 0x3FFFFFFF},
    {-1.0, 0xC0000000},  {1.0 + 0x1p-30, 0x40000001}, {0.5, 0x20000000},      {1.05, 0x43333333},
    {-1.05, 0xBCCCCCCD}, {2.0, 0x43D70A3D},           {-2.0, 0xBC28F5C3},
};

static void sinc_words_are_right_justified_and_not_clipped(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(sinc_words); k++) {
        struct rig r;
        powered(&r, &quiet);
        r.v = 2.5 * sinc_words[k].fs;
        wreg(&r, ADS1282_OFC1, 0x12); /* OFC and FSC stand behind the FIR */
        wreg(&r, ADS1282_FSC2, 0x20);
        wreg(&r, 1, 0x41);
        to_fall(&r);
        r.gap_tclk = 4;
        hex_is(read_bytes(&r, 4), sinc_words[k].word);
        assert_int_equal(r.a.count.clipped, 0);
    }
}

/* A step between two blocks runs through the sinc: with everything before it 0, word m is its step response after m + 1
 * blocks, whole after five. */
static void a_step_passes_the_sinc_in_five_words(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(sinc_rates); k++) {
        struct rig r;
        powered(&r, &quiet);
        wreg(&r, 1, (uint8_t)(0x41 | sinc_rates[k].dr << 3));
        for (int i = 0; i < 10; i++) to_fall(&r);
        const int64_t step = 4 * (int64_t)sinc_rates[k].n;
        const int64_t latency = 264 % step; /* words come 264 tCLK behind their last block */
        at_tclk(&r, r.tclk + step - latency);
        ads1282_sample_until(&r.a, r.s.now_ns);
        r.v = 1.25;
        int32_t tap[ADS1282_SINC_TAPS];
        ads1282_sinc_taps(sinc_rates[k].n, tap);
        int64_t sum = 0;
        const double n4 = pow(sinc_rates[k].n, 4);
        for (int m = -1 - (int)(264 / step); m < 8; m++) {
            to_fall(&r);
            if (m >= 0 && m < ADS1282_SINC_TAPS) sum += tap[m];
            hex_is((uint32_t)(r.a.out >> 32), (uint32_t)llround(0x1p29 * (double)sum / n4));
        }
        near((double)sum, n4, 0.0);
    }
}

/* ---- Modulator output ---- */

struct bits {
    struct rig r;
    uint8_t m0[4096], m1[4096];
    int64_t first_ns, last_ns;
    unsigned n;
};

static void on_bits(void *ctx, bool m0, bool m1, int64_t t_ns)
{
    struct bits *b = ctx; /* r is its first member */
    assert_int_equal(t_ns, b->r.s.now_ns);
    if (b->n == 0) b->first_ns = t_ns;
    b->last_ns = t_ns;
    if (b->n < sizeof b->m0) {
        b->m0[b->n] = m0;
        b->m1[b->n] = m1;
    }
    b->n++;
}

static void modulator_bits_come_each_4_tclk_and_without_drdy(void **state)
{
    (void)state;
    for (int chain = ADS1282_CHAIN_EXACT; chain <= ADS1282_CHAIN_DIRECT; chain++) {
        static struct bits b;
        memset(&b, 0, sizeof b);
        struct ads1282_cfg cfg = quiet;
        cfg.chain = (enum ads1282_chain)chain;
        wired(&b.r, &cfg, 1, (struct ads1282_io){.modulator = on_bits});
        ads1282_power_up(&b.r.a, 0);
        b.r.v = 0.5;
        to_fall(&b.r);
        assert_int_equal(b.n, 0); /* M0, M1 rest in the other modes */
        wreg(&b.r, 1, 0x50);
        const int64_t from = b.r.tclk;
        b.r.falls = 0;
        at_tclk(&b.r, from + 4 * 4000);
        assert_int_equal(b.n, 4000);
        assert_int_equal(b.first_ns, clk_edge_ns(&b.r.clk, from + 4));
        assert_int_equal(b.last_ns, clk_edge_ns(&b.r.clk, from + 4 * 4000));
        assert_int_equal(b.r.falls, 0);
        assert_true(ads1282_drdy(&b.r.a));
        assert_true(ads1282_running(&b.r.a));
        assert_int_equal(ads1282_period_ns(&b.r.a), 0);
    }
}

/* The published formula, here in its own words: y[n] = 3 M0[n-2] - 6 M0[n-3] + 4 M0[n-4] + 9 (M1[n] - 2 M1[n-1] + M1[n-2]). */
static double decoded(const struct bits *b, unsigned n)
{
    double m0[5];
    double m1[5];
    for (unsigned i = 0; i < 5; i++) {
        m0[i] = b->m0[n - i] ? 1.0 : -1.0;
        m1[i] = b->m1[n - i] ? 1.0 : -1.0;
    }
    return 3 * m0[2] - 6 * m0[3] + 4 * m0[4] + 9 * (m1[0] - 2 * m1[1] + m1[2]);
}

/* Four running means of 64 leave only the input: full scale stands for 2/3 of the bits' range. */
static void the_published_formula_recovers_the_input_from_the_bits(void **state)
{
    (void)state;
    static const double volts[] = {0.0, 1.0, -1.0, 2.4, -2.5, 2.6};
    for (unsigned k = 0; k < COUNT(volts); k++) {
        static struct bits b;
        memset(&b, 0, sizeof b);
        wired(&b.r, &quiet, 1, (struct ads1282_io){.modulator = on_bits});
        ads1282_power_up(&b.r.a, 0);
        b.r.v = volts[k];
        wreg(&b.r, 1, 0x50);
        at_tclk(&b.r, b.r.tclk + 4 * 4096);
        static double y[4096];
        for (unsigned n = 0; n < 4096; n++) y[n] = n < 5 ? 0.0 : decoded(&b, n);
        for (int stage = 0; stage < 5; stage++)
            for (unsigned n = 4095; n >= 63; n--) {
                double sum = 0.0;
                for (unsigned i = 0; i < 64; i++) sum += y[n - i];
                y[n] = sum / 64.0;
            }
        near(1.5 * 2.5 * y[4095], volts[k], 2e-5);
    }
}

/* The rate is the filter's: reserved codes of it do not stop the modulator. */
static void modulator_output_needs_no_rate(void **state)
{
    (void)state;
    for (unsigned dr = 0; dr < 8; dr++) {
        static struct bits b;
        memset(&b, 0, sizeof b);
        wired(&b.r, &quiet, 1, (struct ads1282_io){.modulator = on_bits});
        ads1282_power_up(&b.r.a, 0);
        wreg(&b.r, 1, (uint8_t)(0x40 | dr << 3));
        at_tclk(&b.r, b.r.tclk + 400);
        assert_int_equal(b.n, 100);
        assert_int_equal(b.r.a.count.refused, 0);
    }
}

static void nobody_looking_no_bits_are_computed(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    wreg(&r, 1, 0x50);
    const unsigned samples = r.samples;
    at_tclk(&r, r.tclk + 1000000);
    assert_int_equal(r.samples, samples);
    wreg(&r, 1, 0x52); /* and the converter comes back */
    const int64_t edge = r.tclk;
    assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, edge + T_DR_1000));
}

/* ---- High-pass at the chip ---- */

/* Sources 1.7: a unit at its reset value (E2E 146898) gave 147410, 145582, 143770, 141990 in a row: mean ratio 0.98759. */
static void the_high_pass_at_reset_decays_like_the_measured_unit(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 1.0;
    wreg(&r, 1, 0x53);
    const double first = fraction((to_fall(&r), read_bytes(&r, 4)));
    double before = first;
    for (int i = 0; i < 3; i++) {
        const double word = fraction((to_fall(&r), read_bytes(&r, 4)));
        near(word / before, 0.987596, 1e-6);
        before = word;
    }
    near(pow(before / first, 1.0 / 3.0), pow(141990.0 / 147410.0, 1.0 / 3.0), 1e-4);
    for (int i = 0; i < 2000; i++) to_fall(&r);
    hex_is(read_bytes(&r, 4), 0); /* no DC, no limit cycle */
}

static void a_new_high_pass_coefficient_acts_at_once_and_a_restart_forgets(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 1.0;
    wreg(&r, 1, 0x53);
    to_fall(&r);
    double before = fraction(read_bytes(&r, 4));
    SEND(&r, 0x43, 0x01, 0x00, 0x40); /* a = 1/4: b = (1 + 9/16)/2 */
    for (int i = 0; i < 3; i++) {
        const double word = fraction((to_fall(&r), read_bytes(&r, 4)));
        near(word / before, 25.0 / 32.0, 1e-7);
        before = word;
    }
    assert_int_equal(r.a.count.restarts, 1);
    SEND(&r, 0x43, 0x01, 0x00, 0x00); /* a = 0: what is left stays */
    to_fall(&r);
    near(fraction(read_bytes(&r, 4)), before, 1e-9);
    ads1282_sync_pin(&r.a, true, r.s.now_ns);
    to_fall(&r);
    near(fraction(read_bytes(&r, 4)), 0.4 * 1.0000287, 1e-6); /* all of the step since the restart */
}

/* Through the high-pass the first words after a restart depend on all that came before them. */
static void a_restart_forgets_everything_in_every_chain(void **state)
{
    (void)state;
    for (int chain = ADS1282_CHAIN_EXACT; chain <= ADS1282_CHAIN_DIRECT; chain++) {
        struct rig r;
        struct ads1282_cfg cfg = quiet;
        cfg.chain = (enum ads1282_chain)chain;
        powered(&r, &cfg);
        r.v = 1.7;
        wreg(&r, 1, 0x63);
        uint32_t word[2][20];
        for (int again = 0; again < 2; again++) {
            for (unsigned i = 0; i < COUNT(word[0]); i++) {
                to_fall(&r);
                word[again][i] = read_bytes(&r, 4);
            }
            ads1282_sync_pin(&r.a, true, r.s.now_ns);
        }
        assert_memory_equal(word[0], word[1], sizeof word[0]);
    }
}

/* ---- Continuous synchronisation ---- */

static void continuous_sync_pulses_drdy_with_zeros_until_settled(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 1.0;
    wreg(&r, 1, 0xD2);
    ads1282_sync_pin(&r.a, true, at_tclk(&r, r.tclk + 100));
    const int64_t from = r.tclk;
    for (int p = 0; p < 65; p++) {
        assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, from + T_DR_1000 + (p - 62) * 4096));
        const uint32_t word = read_bytes(&r, 4);
        assert_int_equal(word != 0, p >= 62);
    }
    assert_int_equal(r.a.count.conversions, 3);
}

/* Sources 1.6: a periodic SYNC of a whole number of data periods within one CLK does not restart; any other does. */
static void only_a_sync_out_of_step_restarts(void **state)
{
    (void)state;
    static const struct {
        int64_t periods, off_tclk;
        bool restarts;
    } rows[] = {{1, 0, false},  {1, 1, false}, {1, -1, false}, {1, 2, true},    {1, -2, true},  {7, 0, false},
                {70, 1, false}, {70, 2, true}, {0, 1, false},  {0, 2000, true}, {3, 2048, true}};
    for (unsigned k = 0; k < COUNT(rows); k++) {
        struct rig r;
        powered(&r, &quiet);
        wreg(&r, 1, 0xD2);
        ads1282_sync_pin(&r.a, true, at_tclk(&r, r.tclk + 4096)); /* the first one always restarts */
        const int64_t from = r.tclk;
        assert_int_equal(r.a.count.restarts, 2);
        ads1282_sync_pin(&r.a, false, r.s.now_ns);
        ads1282_sync_pin(&r.a, true, at_tclk(&r, from + rows[k].periods * 4096 + rows[k].off_tclk));
        if (r.a.count.restarts != 2u + rows[k].restarts)
            fail_msg("%d periods and %d tCLK", (int)rows[k].periods, (int)rows[k].off_tclk);
    }
}

/* E2E 621415: C2h, 250 words/s, and 250 Hz from another clock: DOUT stays 0 for ever. 20 ppm off here. */
static void a_sync_that_drifts_keeps_dout_at_zero_for_ever(void **state)
{
    (void)state;
    for (int locked = 0; locked < 2; locked++) {
        struct rig r;
        powered(&r, &quiet);
        r.v = 1.0;
        wreg(&r, 1, 0xC2);
        unsigned settled = 0;
        const int64_t from_ns = r.s.now_ns + 1000;
        for (int64_t i = 0; i < 200; i++) {
            const int64_t t_ns = from_ns + i * (locked ? 4000000 : 4000080);
            sched_run_until(&r.s, t_ns);
            ads1282_sync_pin(&r.a, true, t_ns);
            sched_run_until(&r.s, t_ns + 2000000);
            ads1282_sync_pin(&r.a, false, t_ns + 2000000);
            settled += r.a.out >> 32 != 0;
        }
        assert_in_range(settled, locked ? 130 : 0, locked ? 140 : 0);
        assert_in_range(r.a.count.restarts, locked ? 2 : 30, locked ? 2 : 200);
        assert_true(r.falls > 100); /* DRDY goes on; a restart just before a fall skips it */
    }
}

/* ---- Calibration ---- */

static void offset_is(struct rig *r, int32_t want)
{
    const uint32_t ofc =
        (uint32_t)r->a.reg_value[5] | (uint32_t)r->a.reg_value[6] << 8 | (uint32_t)r->a.reg_value[7] << 16;
    hex_is(ofc, (uint32_t)want & 0xFFFFFF);
}

static uint32_t gain_of(const struct rig *r)
{
    return (uint32_t)r->a.reg_value[8] | (uint32_t)r->a.reg_value[9] << 8 | (uint32_t)r->a.reg_value[10] << 16;
}

/* The sequence of TI's support: SDATAC, SYNC, RDATAC, DRDY, SDATAC, OFSCAL or GANCAL, RDATAC, DRDY. */
static void calibrate(struct rig *r, uint8_t opcode)
{
    SEND(r, 0x11, 0x04, 0x10);
    to_fall(r);
    const int64_t settled_ns = r->fall_ns;
    const unsigned falls = r->falls;
    at_tclk(r, r->tclk + 100);
    SEND(r, 0x11, opcode, 0x10);
    assert_true(ads1282_drdy(&r->a));
    to_fall(r);
    assert_int_equal(r->falls, falls + 1); /* no pulses meanwhile */
    assert_int_equal(r->fall_ns, settled_ns + 16 * 1000000);
}

static void calibration_makes_offset_zero_and_full_scale_full(void **state)
{
    (void)state;
    static const struct {
        double offset_v, span_v;
    } rows[] = {{0.0, 2.4}, {0.01, 2.3}, {-0.25, 1.25}, {1.0, 1.4}, {0.001, 0.7}};
    for (unsigned k = 0; k < COUNT(rows); k++) {
        struct rig r;
        powered(&r, &quiet);
        r.v = rows[k].offset_v;
        calibrate(&r, 0x60);
        near(fraction(read_bytes(&r, 4)), 0.0, 0x1p-24); /* half a count of OFC */
        const double dc = 1.0000287402267158;
        offset_is(&r, (int32_t)lround(0x1p23 * dc * rows[k].offset_v / 2.5));
        ads1282_sample_until(&r.a, r.s.now_ns);
        r.v = rows[k].offset_v + rows[k].span_v;
        calibrate(&r, 0x61);
        const double want = 0x1p22 * 2.5 / (dc * rows[k].span_v);
        near(gain_of(&r), want, 1.0 + want * 0x1p-24 * 2.5 / rows[k].span_v); /* half a count of OFC is in it */
        near(fraction(read_bytes(&r, 4)), 1.0, 2.5e-7);                       /* a count of FSC */
        assert_int_equal(r.a.count.calibrations, 2);
    }
}

/* In SDATAC SCLK does not raise DRDY: the opcode does, and the fall says that it is done. */
static void a_calibration_raises_drdy_until_it_is_done(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    SEND(&r, 0x11);
    const int64_t fall_ns = to_fall(&r);
    byte(&r, 0x00);
    assert_false(ads1282_drdy(&r.a));
    byte(&r, 0x60);
    assert_true(ads1282_drdy(&r.a));
    assert_int_equal(to_fall(&r), fall_ns + 16 * 1000000);
    assert_int_equal(r.a.count.conversions, 1 + 1); /* the readings between are no words */
}

/* A word that nobody has read when a calibration begins is gone. */
static void a_calibration_forgets_the_word(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 1.0;
    to_fall(&r);
    byte(&r, 0x60); /* shifts out its first byte */
    hex_is(read_bytes(&r, 4), 0);
    assert_int_equal(r.a.count.overruns, 0);
}

/* In SDATAC SCLK raises DRDY for the word of an RDATA, read whole or in part, and for no other. */
static void sclk_raises_drdy_for_the_word_asked_for_only(void **state)
{
    (void)state;
    for (unsigned bytes = 3; bytes <= 4; bytes++) {
        struct rig r;
        powered(&r, &quiet);
        SEND(&r, 0x11, 0x12);
        to_fall(&r);
        to_fall(&r); /* still there */
        (void)byte(&r, 0);
        assert_true(ads1282_drdy(&r.a));
        read_bytes(&r, bytes - 1);
        to_fall(&r);
        (void)byte(&r, 0);
        assert_false(ads1282_drdy(&r.a));
    }
}

/* Whether OFC and FSC act while calibrating is not known: both readings, after a first calibration of the same input. */
static void a_second_calibration_shows_whether_registers_act(void **state)
{
    (void)state;
    for (int corrected = 0; corrected < 2; corrected++) {
        struct rig r;
        struct ads1282_cfg cfg = quiet;
        cfg.cal_corrected = corrected;
        powered(&r, &cfg);
        r.v = 0.5;
        calibrate(&r, 0x60);
        const int32_t ofc = (int32_t)lround(0x1p23 * 0.2 * 1.0000287402267158);
        offset_is(&r, ofc);
        calibrate(&r, 0x60);
        offset_is(&r, corrected ? 0 : ofc);
    }
}

static void calibration_limits(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 2.7; /* saturates at 106 %: beyond what OFC holds */
    calibrate(&r, 0x60);
    offset_is(&r, 0x7FFFFF);
    ads1282_sample_until(&r.a, r.s.now_ns);
    r.v = 0.1; /* below the offset */
    calibrate(&r, 0x61);
    hex_is(gain_of(&r), 0xFFFFFF);
    SEND(&r, 0x11, 0x41, 0x00, 0x51, 0x60); /* no calibration of the sinc's words */
    assert_int_equal(r.a.count.refused, 1);
    assert_int_equal(r.a.cal.kind, ADS1282_CAL_NONE);
}

/* Sixteen readings: their mean is four times quieter than one (less a little, neighbours are not independent). */
static void calibration_averages_sixteen_readings(void **state)
{
    (void)state;
    const uint64_t first = rig_seed(300);
    double power = 0.0;
    enum { SEEDS = 60 };
    for (unsigned seed = 0; seed < SEEDS; seed++) {
        struct rig r;
        struct ads1282_cfg cfg = quiet;
        cfg.noise_scale = 100.0; /* so that a count of OFC is fine */
        unpowered(&r, &cfg, first + seed);
        ads1282_power_up(&r.a, 0);
        calibrate(&r, 0x60);
        const double ofc = (double)bits_sign_extend(
            (uint32_t)r.a.reg_value[5] | (uint32_t)r.a.reg_value[6] << 8 | (uint32_t)r.a.reg_value[7] << 16, 24);
        power += pow(ofc * 0x1p-23, 2) / SEEDS;
    }
    const double one = 100.0 * sqrt(0.5) * pow(10.0, -124.0 / 20.0);
    near(power * 16.0 / (one * one), 1.0, 5.0 * sqrt(2.0 / SEEDS) + 0.2);
}

/* ---- STANDBY ---- */

static void standby_keeps_registers_and_wakeup_settles_in_t_dr(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    wreg(&r, ADS1282_OFC0, 0x33);
    to_fall(&r);
    SEND(&r, 0x11, 0x02);
    assert_false(ads1282_running(&r.a));
    const unsigned samples = r.samples;
    assert_int_equal(to_fall(&r), 0);
    assert_int_equal(r.samples, samples);
    assert_true(ads1282_drdy(&r.a));
    hex_is(rreg(&r, ADS1282_OFC0), 0x33); /* its third byte, 00h, is a register's clock, no WAKEUP */
    assert_true(r.a.standby);
    ads1282_sync_pin(&r.a, true, r.s.now_ns);
    assert_int_equal(to_fall(&r), 0);
    SEND(&r, 0x10, 0x00);
    const int64_t edge = r.tclk;
    assert_true(ads1282_running(&r.a));
    assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, edge + T_DR_1000));
    hex_is(read_bytes(&r, 4), 0xFFFFCD01); /* OFC is still there */
}

static void wakeup_while_running_changes_nothing(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    SEND(&r, 0x00, 0x01);
    assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, T_DR_1000));
}

/* ---- Power-up and PWDN ---- */

static void power_up_takes_65536_tclk_before_t_dr(void **state)
{
    (void)state;
    struct ads1282_cfg cfg = quiet;
    cfg.power_up_tclk = 65536;
    struct rig r;
    powered(&r, &cfg);
    at_tclk(&r, 65535);
    wreg(&r, 1, 0x56); /* the 8th rise comes 2 bytes later: after the internal reset, which ate the first ones */
    powered(&r, &cfg);
    at_tclk(&r, 65000);
    wreg(&r, 1, 0x56);
    hex_is(reg_peek(&r.a.regs, 1), 0x52);
    ads1282_reset_pin(&r.a, false, r.s.now_ns);
    ads1282_reset_pin(&r.a, true, r.s.now_ns + 1000);
    assert_false(ads1282_running(&r.a));
    assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, 65536 + T_DR_1000));
}

static void reset_held_beyond_power_up_counts_from_its_rise(void **state)
{
    (void)state;
    struct ads1282_cfg cfg = quiet;
    cfg.power_up_tclk = 65536;
    struct rig r;
    unpowered(&r, &cfg, 1);
    ads1282_reset_pin(&r.a, false, 0);
    ads1282_power_up(&r.a, 0);
    ads1282_reset_pin(&r.a, true, at_tclk(&r, 70000));
    assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, 70000 + T_DR_1000));
}

static void pwdn_forgets_everything_and_its_rise_is_a_power_up(void **state)
{
    (void)state;
    for (int64_t wake = 0; wake <= 65536; wake += 65536) {
        struct ads1282_cfg cfg = quiet;
        cfg.power_up_tclk = (uint32_t)wake;
        struct rig r;
        powered(&r, &cfg);
        to_fall(&r);
        SEND(&r, 0x11, 0x41, 0x00, 0x56);
        to_fall(&r);
        ads1282_pwdn_pin(&r.a, false, at_tclk(&r, r.tclk + 100));
        assert_true(ads1282_drdy(&r.a));
        assert_false(ads1282_running(&r.a));
        const unsigned samples = r.samples;
        wreg(&r, ADS1282_OFC0, 0x33);
        ads1282_sync_pin(&r.a, true, r.s.now_ns);
        assert_int_equal(to_fall(&r), 0);
        assert_int_equal(r.samples, samples);
        ads1282_pwdn_pin(&r.a, true, at_tclk(&r, clk_count_at(&r.clk, r.s.now_ns)));
        hex_is(reg_peek(&r.a.regs, 1), 0x52);
        hex_is(reg_peek(&r.a.regs, ADS1282_OFC0), 0);
        assert_true(r.a.rdatac);
        const int64_t from = r.tclk;
        assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, from + wake + T_DR_1000));
    }
}

/* ---- MFLAG ---- */

/* Blocks of 128 tCLK at 1000 words/s, sampled at their middles, from tCLK 112 on. */
static void mflag_is_high_while_the_newest_sample_is_at_full_scale(void **state)
{
    (void)state;
    static const struct {
        double v;
        bool want;
    } rows[] = {{0.0, false}, {2.4999999, false},  {2.5, true},  {2.6, true},
                {9.0, true},  {-2.4999999, false}, {-2.5, true}, {-3.0, true}};
    for (unsigned k = 0; k < COUNT(rows); k++) {
        for (int chain = ADS1282_CHAIN_EXACT; chain <= ADS1282_CHAIN_DIRECT; chain++) {
            struct rig r;
            struct ads1282_cfg cfg = quiet;
            cfg.chain = (enum ads1282_chain)chain;
            wired(&r, &cfg, 1, (struct ads1282_io){.mflag = mflag});
            ads1282_power_up(&r.a, 0);
            at_tclk(&r, 300000);
            r.v = rows[k].v;
            at_tclk(&r, 305000);
            assert_int_equal(r.mflag, rows[k].want);
            assert_int_equal(ads1282_mflag(&r.a), rows[k].want);
            r.v = 0.0;
            at_tclk(&r, 310000);
            assert_int_equal(r.mflags, rows[k].want ? 2 : 0);
        }
    }
}

static void mflag_moves_at_the_sample_that_sees_it(void **state)
{
    (void)state;
    struct rig r;
    wired(&r, &quiet, 1, (struct ads1282_io){.mflag = mflag});
    ads1282_power_up(&r.a, 0);
    at_tclk(&r, 112 + 128 * 50);
    r.v = 3.0;
    at_tclk(&r, 112 + 128 * 51 - 1);
    assert_int_equal(r.mflags, 0);
    at_tclk(&r, 112 + 128 * 51 + 1);
    assert_int_equal(r.mflag_ns, clk_edge_ns(&r.clk, 112 + 128 * 51));
    SEND(&r, 0x02); /* STANDBY: nothing compares any more */
    assert_false(r.mflag);
    assert_false(ads1282_mflag(&r.a));
    r.v = 0.0;
    SEND(&r, 0x00);
    at_tclk(&r, r.tclk + 1000);
    assert_int_equal(r.mflags, 2);
}

static void watching_mflag_changes_no_word(void **state)
{
    (void)state;
    struct rig r[2];
    struct ads1282_cfg cfg = quiet;
    cfg.noise_scale = 1.0;
    for (int watched = 0; watched < 2; watched++) {
        wired(&r[watched], &cfg, 9, (struct ads1282_io){.mflag = watched ? mflag : NULL});
        ads1282_power_up(&r[watched].a, 0);
        r[watched].ramp_v_per_s = 10.0;
    }
    for (int i = 0; i < 300; i++) {
        assert_int_equal(to_fall(&r[0]), to_fall(&r[1]));
        hex_is(read_bytes(&r[0], 4), read_bytes(&r[1], 4));
    }
    assert_int_equal(r[1].mflags, 1);
}

/* ---- Pin mode ---- */

static void mode_pins_choose_rate_phase_and_high_pass(void **state)
{
    (void)state;
    for (unsigned code = 0; code < 16; code++) {
        const struct ads1282_mode_pins pins = {(uint8_t)(code & 3), code & 4, code & 8, false};
        struct ads1282_cfg cfg = quiet;
        cfg.part = ADS1282_PART_1281;
        cfg.pin_mode = true;
        struct rig r;
        powered(&r, &cfg);
        r.v = 1.0;
        ads1282_mode_pins(&r.a, &pins, at_tclk(&r, 1000));
        const int64_t n = 128 >> pins.dr;
        const bool changed = code != 0;
        assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, 1000 * changed + 8061 * n + n / 2 + 468));
        const double first = fraction(read_bytes(&r, 4));
        assert_int_equal(to_fall(&r) - clk_edge_ns(&r.clk, 1000 * changed + 8061 * n + n / 2 + 468 + 128 * n), 0);
        const double next = fraction(read_bytes(&r, 4));
        near(next / first, pins.high_pass ? 0.987596 : 1.0, 1e-6);
        const double dc = pins.minimum_phase ? 1.000169 : 1.0000287;
        if (!pins.high_pass) near(first, 0.4 * dc, 1e-7);
        assert_int_equal(r.a.count.restarts, changed);
    }
}

static void in_pin_mode_commands_do_nothing_and_words_come_always(void **state)
{
    (void)state;
    struct ads1282_cfg cfg = quiet;
    cfg.part = ADS1282_PART_1281;
    cfg.pin_mode = true;
    struct rig r;
    powered(&r, &cfg);
    r.bus = PINS;
    r.v = -1.5;
    const uint32_t word = settled_word(&r);
    for (unsigned code = 0; code < 256; code += 4) {
        to_fall(&r);
        uint32_t got = 0;
        for (unsigned i = 0; i < 4; i++) got = got << 8 | byte(&r, (uint8_t)(code + i));
        hex_is(got, word);
    }
    assert_int_equal(r.a.count.restarts + r.a.count.refused + r.a.count.bad_opcodes + r.a.count.gap_violations, 0);
    const uint8_t reset[ADS1282_REGS] = {0x00, 0x52, 0x08, 0x32, 0x03, 0, 0, 0, 0, 0, 0x40};
    assert_memory_equal(r.a.reg_value, reset, sizeof reset);
}

static void continuous_sync_by_its_mode_pin(void **state)
{
    (void)state;
    struct ads1282_cfg cfg = quiet;
    cfg.part = ADS1282_PART_1281;
    cfg.pin_mode = true;
    struct rig r;
    powered(&r, &cfg);
    const struct ads1282_mode_pins pins = {2, false, false, true};
    ads1282_mode_pins(&r.a, &pins, at_tclk(&r, 1000));
    assert_int_equal(to_fall(&r),
                     clk_edge_ns(&r.clk, 1000 + T_DR_1000 - 62 * 4096)); /* DRDY toggles from the first period */
    ads1282_mode_pins(&r.a, &pins, r.s.now_ns);
    assert_int_equal(r.a.count.restarts, 1); /* the same again is no change */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sinc_words_come_after_their_settling_time_then_every_4n_tclk),
        cmocka_unit_test(sinc_words_are_right_justified_and_not_clipped),
        cmocka_unit_test(a_step_passes_the_sinc_in_five_words),
        cmocka_unit_test(modulator_bits_come_each_4_tclk_and_without_drdy),
        cmocka_unit_test(the_published_formula_recovers_the_input_from_the_bits),
        cmocka_unit_test(modulator_output_needs_no_rate),
        cmocka_unit_test(nobody_looking_no_bits_are_computed),
        cmocka_unit_test(the_high_pass_at_reset_decays_like_the_measured_unit),
        cmocka_unit_test(a_new_high_pass_coefficient_acts_at_once_and_a_restart_forgets),
        cmocka_unit_test(a_restart_forgets_everything_in_every_chain),
        cmocka_unit_test(continuous_sync_pulses_drdy_with_zeros_until_settled),
        cmocka_unit_test(only_a_sync_out_of_step_restarts),
        cmocka_unit_test(a_sync_that_drifts_keeps_dout_at_zero_for_ever),
        cmocka_unit_test(calibration_makes_offset_zero_and_full_scale_full),
        cmocka_unit_test(a_calibration_raises_drdy_until_it_is_done),
        cmocka_unit_test(a_calibration_forgets_the_word),
        cmocka_unit_test(sclk_raises_drdy_for_the_word_asked_for_only),
        cmocka_unit_test(a_second_calibration_shows_whether_registers_act),
        cmocka_unit_test(calibration_limits),
        cmocka_unit_test(calibration_averages_sixteen_readings),
        cmocka_unit_test(standby_keeps_registers_and_wakeup_settles_in_t_dr),
        cmocka_unit_test(wakeup_while_running_changes_nothing),
        cmocka_unit_test(power_up_takes_65536_tclk_before_t_dr),
        cmocka_unit_test(reset_held_beyond_power_up_counts_from_its_rise),
        cmocka_unit_test(pwdn_forgets_everything_and_its_rise_is_a_power_up),
        cmocka_unit_test(mflag_is_high_while_the_newest_sample_is_at_full_scale),
        cmocka_unit_test(mflag_moves_at_the_sample_that_sees_it),
        cmocka_unit_test(watching_mflag_changes_no_word),
        cmocka_unit_test(mode_pins_choose_rate_phase_and_high_pass),
        cmocka_unit_test(in_pin_mode_commands_do_nothing_and_words_come_always),
        cmocka_unit_test(continuous_sync_by_its_mode_pin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

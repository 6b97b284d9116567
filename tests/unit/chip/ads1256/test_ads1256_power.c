/* What stops and starts the ADS1256: power, RESET, SYNC/PDWN, STANDBY, and calibrations asked for meanwhile (sources 2.4,
 * 2.6). */
#include "ads1256_pins_rig.h"

#define T18_TAU(navg) (1382 + 256 * (navg))

/* Power to DRDY: the start of the clock, then the self-calibration of the default settings (596 us). */
static void power_up_takes_the_time_of_its_clock(void **state)
{
    (void)state;
    static const struct {
        enum ads1256_start start;
        uint32_t clkin_hz;
        double start_us;
    } rows[] = {
        {ADS1256_START_AT_ONCE, 7680000, 0.0},     {ADS1256_START_CLOCK, 7680000, 8192 / 7.68},
        {ADS1256_START_CLOCK, 4096000, 2000.0},    {ADS1256_START_CRYSTAL, 7680000, 30000.0},
        {ADS1256_START_CRYSTAL, 4096000, 30000.0},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct ads1256_cfg cfg = quiet;
        cfg.start = rows[i].start;
        cfg.clkin_hz = rows[i].clkin_hz;
        struct rig r;
        power_up(&r, &cfg, 1);
        const double cal_us = 596.0 * 7680000 / rows[i].clkin_hz;
        near((double)await_fall(&r) * 1e-3, rows[i].start_us + cal_us, 0.5);
        assert_int_equal(r.a.n.calibrations, 1);
    }
}

static void nothing_is_heard_while_the_clock_starts(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.start = ADS1256_START_CRYSTAL;
    struct rig r;
    power_up(&r, &cfg, 1);
    wreg(&r, ADS1256_MUX, 0x23);
    assert_int_equal(ads1256_clkout_hz(&r.a), 0);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_MUX), 0x01);
    ads1256_reset_pin(&r.a, false, r.s.now_ns);
    wait_ns(&r, 40000000); /* RESET low beyond the start: it is what counts */
    assert_int_equal(r.a.mode, ADS1256_IN_RESET);
    assert_int_equal(ads1256_clkout_hz(&r.a), 7680000);
    ads1256_reset_pin(&r.a, true, r.s.now_ns);
    const int64_t from_ns = r.s.now_ns;
    near((double)(await_fall(&r) - from_ns) * 1e-3, 596.0, 0.2);
    power_up(&r, &cfg, 1);
    wait_ns(&r, 1000000);
    ads1256_reset_pin(&r.a, false, r.s.now_ns); /* a pulse before the clock is there changes nothing */
    ads1256_reset_pin(&r.a, true, r.s.now_ns + 10000);
    near((double)await_fall(&r) * 1e-3, 30596.0, 0.2);
}

/* RESET low at power-up: the calibration begins with its rise. */
static void power_up_in_reset_waits_for_the_pin(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    ads1256_reset_pin(&r.a, false, r.s.now_ns);
    ads1256_power_up(&r.a, r.s.now_ns);
    wait_ns(&r, 5000000);
    assert_int_equal(sched_next_ns(&r.s), SCHED_NEVER);
    ads1256_reset_pin(&r.a, true, r.s.now_ns);
    const int64_t from_ns = r.s.now_ns;
    near((double)(await_fall(&r) - from_ns) * 1e-3, 596.0, 0.2);
}

/* All three kinds of reset: every register to its default, CLKOUT survives the command only, then 596 us. */
static void every_kind_of_reset(void **state)
{
    (void)state;
    static const uint8_t defaults[ADS1256_REGS] = {0x31, 0x01, 0x20, 0xF0, 0xE0};
    for (unsigned kind = 0; kind < 3; kind++) {
        struct rig r;
        rig_up(&r, &quiet);
        static const uint8_t values[] = {0x0A, 0x23, 0x4B, 0x92, 0x5A, 1, 2, 3, 4, 5, 6};
        for (uint8_t addr = 0; addr < ADS1256_REGS; addr++) wreg(&r, addr, values[addr]);
        xfer(&r, 0x03);
        wait_ns(&r, T6_NS);
        if (kind == 0) ads1256_reset_pin(&r.a, false, r.s.now_ns);
        if (kind == 1) xfer(&r, 0xFE);
        for (unsigned k = 0; kind == 2 && k < 3; k++) {
            ads1256_sclk_pin(&r.a, true, r.s.now_ns);
            wait_ns(&r, tau_ns((int64_t[]){400, 650, 1150}[k]));
            ads1256_sclk_pin(&r.a, false, r.s.now_ns);
            wait_ns(&r, k < 2 ? tau_ns(10) : 0);
        }
        for (uint8_t addr = 0; addr < ADS1256_OFC0; addr++) {
            const uint8_t want = addr == ADS1256_ADCON && kind == 1 ? 0x40 : defaults[addr];
            assert_int_equal(reg_peek(&r.a.regs, addr), want);
        }
        assert_true(ads1256_drdy(&r.a));
        assert_false(r.a.rdatac);
        if (kind == 0) ads1256_reset_pin(&r.a, true, r.s.now_ns + tau_ns(4) + 1);
        const int64_t from_ns = r.s.now_ns;
        near((double)(await_fall(&r) - from_ns) * 1e-3, 596.0, 1.0);
        assert_int_equal(r.a.n.gap_violations, 0);
    }
}

static void pulses_shorter_than_t16_are_counted(void **state)
{
    (void)state;
    for (unsigned pin = 0; pin < 2; pin++) {
        for (unsigned early = 0; early < 2; early++) {
            struct rig r;
            rig_up(&r, &quiet);
            void (*const set)(struct ads1256 *, bool, int64_t) = pin ? ads1256_reset_pin : ads1256_sync_pin;
            set(&r.a, false, r.s.now_ns);
            wait_ns(&r, tau_ns(4) - early);
            set(&r.a, true, r.s.now_ns);
            assert_int_equal(r.a.n.gap_violations, early);
        }
    }
}

/* The word that is ready stays readable, no new one comes, registers answer, CLKOUT runs. */
static void standby_stops_after_the_present_drdy(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    r.v[0] = 1.0;
    set_rate(&r, 0x92);
    command(&r, 0xFD);
    assert_int_equal(r.a.mode, ADS1256_STANDBY);
    assert_int_equal(sched_next_ns(&r.s), SCHED_NEVER);
    assert_false(ads1256_drdy(&r.a));
    const uint32_t conversions = r.a.n.conversions;
    const uint32_t overruns = r.a.n.overruns;
    wait_ns(&r, 20000000);
    assert_int_equal(rdata(&r), 1677721);
    assert_true(ads1256_drdy(&r.a));
    assert_int_equal(r.a.n.conversions, conversions);
    assert_int_equal(ads1256_clkout_hz(&r.a), 7680000);
    assert_int_equal(rreg(&r, ADS1256_DRATE), 0x92);
    assert_int_equal(r.a.n.overruns, overruns);
}

/* WAKEUP to DRDY: t18 and 256 tau for the modulator, at every rate; then a normal run. SBAS288 p. 22. */
static void one_shot_takes_t18_and_256_tau(void **state)
{
    (void)state;
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        struct ads1256_cfg cfg = quiet;
        cfg.cells_max = 1;
        struct rig r;
        rig_up(&r, &cfg);
        set_rate(&r, ads1256_rates[i].code);
        command(&r, 0xFD);
        r.v[0] = -2.0;
        wait_ns(&r, 1000000);
        const int64_t first_edge_ns = r.s.now_ns + FIRST_NS;
        xfer(&r, i & 1 ? 0xFF : 0x00);
        assert_true(ads1256_drdy(&r.a));
        const int64_t k = clk_count_at(&r.a.clkin, first_edge_ns) + T18_TAU(ads1256_rates[i].navg) + 256;
        assert_int_equal(await_fall(&r), clk_edge_ns(&r.a.clkin, k));
        near(r.a.word, -0.4 * 8388608, 4); /* settled at once */
        assert_int_equal(await_fall(&r), clk_edge_ns(&r.a.clkin, k + 256 * (int64_t)ads1256_rates[i].navg));
        assert_int_equal(r.a.n.gap_violations, 0);
    }
}

static void commands_before_the_drdy_after_standby_are_counted(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    set_rate(&r, 0x92);
    command(&r, 0xFD);
    command(&r, 0x00);
    rreg(&r, ADS1256_STATUS);
    assert_int_equal(r.a.n.gap_violations, 1);
    await_fall(&r);
    rreg(&r, ADS1256_STATUS);
    assert_int_equal(r.a.n.gap_violations, 1);
}

static void standby_and_sync_where_there_is_nothing_to_stop(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet, 1);
    xfer(&r, 0xFD); /* the calibration of the reset goes on */
    assert_int_equal(r.a.n.refused, 1);
    assert_int_equal(r.a.refused_opcode, 0xFD);
    near((double)await_fall(&r) * 1e-3, 596.0, 0.2);
    command(&r, 0xFD);
    command(&r, 0xFC);
    assert_int_equal(r.a.refused_opcode, 0xFC);
    ads1256_sync_pin(&r.a, false, r.s.now_ns); /* the pin does not wake it */
    ads1256_sync_pin(&r.a, true, r.s.now_ns + 10000);
    wait_ns(&r, 10000000);
    assert_int_equal(r.a.mode, ADS1256_STANDBY);
    command(&r, 0x00);
    await_fall(&r);
    command(&r, 0xFC); /* from the wait of SYNC, too */
    command(&r, 0xFD);
    assert_int_equal(r.a.mode, ADS1256_STANDBY);
    assert_int_equal(r.a.n.refused, 2);
}

/* Strict: any SCLK activity with CS low interrupts standby, as the data sheet warns. */
static void sclk_interrupts_standby_when_strict(void **state)
{
    (void)state;
    for (unsigned strict = 0; strict < 2; strict++) {
        struct ads1256_cfg cfg = quiet;
        cfg.strict_bus = strict;
        struct rig r;
        rig_up(&r, &cfg);
        command(&r, 0xFD);
        ads1256_cs_pin(&r.a, true, r.s.now_ns);
        xfer(&r, 0x10);
        assert_int_equal(r.a.mode, ADS1256_STANDBY);
        ads1256_cs_pin(&r.a, false, r.s.now_ns);
        xfer(&r, 0x10);
        assert_int_equal(r.a.mode, strict ? ADS1256_RUNNING : ADS1256_STANDBY);
    }
}

/* The byte that ends standby is not too early for itself, the next one is. */
static void wakeup_from_standby_is_no_early_command(void **state)
{
    (void)state;
    for (unsigned strict = 0; strict < 2; strict++) {
        struct ads1256_cfg cfg = quiet;
        cfg.strict_bus = strict;
        struct rig r;
        rig_up(&r, &cfg);
        command(&r, 0xFD);
        const uint32_t restarts = r.a.n.restarts;
        command(&r, 0x00);
        assert_int_equal(r.a.mode, ADS1256_RUNNING);
        assert_int_equal(r.a.n.restarts, restarts + 1);
        assert_int_equal(r.a.n.gap_violations, 0);
        assert_int_equal(r.a.n.dropped, 0);
        command(&r, 0x01);
        assert_int_equal(r.a.n.gap_violations, 1);
        assert_int_equal(r.a.n.dropped, strict);
    }
}

/* More than 20 periods low: all stops, registers and GPIO outputs stay; after the rise the clock starts, then t18. */
static void power_down_keeps_the_registers(void **state)
{
    (void)state;
    for (unsigned start = 0; start < 3; start++) {
        struct ads1256_cfg cfg = quiet;
        cfg.start = (enum ads1256_start)start;
        struct rig r;
        power_up_all(&r, &cfg);
        await_fall(&r);
        wreg(&r, ADS1256_IO, 0xD2); /* D1 is an output, high */
        wreg(&r, ADS1256_MUX, 0x23);
        set_rate(&r, 0xE0);
        xfer(&r, 0x03);
        ads1256_sync_pin(&r.a, false, r.s.now_ns);
        wait_ns(&r, tau_ns(20 * 512));
        assert_int_equal(ads1256_clkout_hz(&r.a), 7680000);
        wait_ns(&r, 1);
        assert_int_equal(r.a.mode, ADS1256_OFF);
        assert_int_equal(r.a.n.power_downs, 1);
        assert_int_equal(ads1256_clkout_hz(&r.a), 0);
        assert_true(ads1256_gpio(&r.a, 1) && r.gpio[1] && ads1256_drdy(&r.a));
        wreg(&r, ADS1256_MUX, 0x45); /* not heard */
        assert_int_equal(sched_next_ns(&r.s), SCHED_NEVER);
        ads1256_sync_pin(&r.a, true, r.s.now_ns);
        const int64_t up_ns = r.s.now_ns + (start == ADS1256_START_CRYSTAL ? 30000000 : tau_ns(8192));
        const int64_t k = clk_count_at(&r.a.clkin, up_ns);
        assert_int_equal(await_fall(&r), clk_edge_ns(&r.a.clkin, k + T18_TAU(2)));
        assert_int_equal(reg_peek(&r.a.regs, ADS1256_MUX), 0x23);
        assert_int_equal(reg_peek(&r.a.regs, ADS1256_IO), 0xD2);
        assert_false(r.a.rdatac);
        assert_int_equal(r.a.n.calibrations, 2); /* power-up and F0h */
    }
}

/* The supply goes and comes while SYNC/PDWN is low: nothing of the power-down is left. */
static void power_up_ends_a_power_down(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    wreg(&r, ADS1256_ADCON, 0x63);
    ads1256_sync_pin(&r.a, false, r.s.now_ns);
    wait_ns(&r, 1000000);
    assert_int_equal(r.a.mode, ADS1256_OFF);
    ads1256_power_up(&r.a, r.s.now_ns);
    assert_int_equal(r.a.mode, ADS1256_SYNC_LOW);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_ADCON), 0x20); /* CLK too */
    wait_ns(&r, 1000000);
    ads1256_sync_pin(&r.a, true, r.s.now_ns);
    const int64_t from_ns = r.s.now_ns;
    near((double)(await_fall(&r) - from_ns) * 1e-3, 596.0, 0.2);
    wait_ns(&r, 2000000); /* no clock starts a second time */
    assert_int_equal(r.a.n.restarts, 0);
}

static void power_down_from_anywhere_and_back(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    command(&r, 0xFD);
    ads1256_sync_pin(&r.a, false, r.s.now_ns); /* standby */
    wait_ns(&r, 1000000);
    assert_int_equal(r.a.mode, ADS1256_OFF);
    ads1256_sync_pin(&r.a, true, r.s.now_ns);
    wait_ns(&r, 500000);
    ads1256_sync_pin(&r.a, false, r.s.now_ns); /* while the clock starts: held, then down again */
    wait_ns(&r, 600000);
    assert_int_equal(r.a.mode, ADS1256_SYNC_LOW);
    wait_ns(&r, 600000);
    assert_int_equal(r.a.mode, ADS1256_OFF);
    ads1256_sync_pin(&r.a, true, r.s.now_ns);
    wait_ns(&r, 100000);
    ads1256_sync_pin(&r.a, false, r.s.now_ns); /* and sooner than the clock is there */
    wait_ns(&r, 1200000);
    assert_int_equal(r.a.mode, ADS1256_OFF);
    assert_int_equal(r.a.n.power_downs, 3);
    ads1256_reset_pin(&r.a, false, r.s.now_ns);
    ads1256_reset_pin(&r.a, true, r.s.now_ns + 10000); /* a reset without a clock: calibrates when it is back */
    ads1256_sync_pin(&r.a, true, r.s.now_ns);
    const int64_t from_ns = r.s.now_ns;
    near((double)(await_fall(&r) - from_ns) * 1e-3, 8192 / 7.68 + 596.0, 0.4);
    assert_int_equal(r.a.n.calibrations, 2);
}

/* What is asked for while SYNC/PDWN is low or in standby is done when the converter starts again (E0). */
static void calibrations_wait_for_the_converter(void **state)
{
    (void)state;
    for (unsigned standby = 0; standby < 2; standby++) {
        struct ads1256_cfg cfg = quiet;
        cfg.offset_v = 1e-3;
        struct rig r;
        rig_up(&r, &cfg);
        await_fall(&r);
        wreg(&r, ADS1256_OFC0, 0);
        if (standby) command(&r, 0xFD);
        else ads1256_sync_pin(&r.a, false, r.s.now_ns);
        command(&r, 0xF1);
        wait_ns(&r, 500000);
        assert_int_equal(r.a.n.calibrations, 1);
        assert_int_equal(reg_peek(&r.a.regs, ADS1256_OFC0), 0);
        const int64_t from_ns = r.s.now_ns + (standby ? FIRST_NS : 0);
        if (standby) xfer(&r, 0x00);
        else ads1256_sync_pin(&r.a, true, r.s.now_ns);
        near((double)(await_fall(&r) - from_ns) * 1e-3, 386.7, 0.2);
        assert_int_equal(r.a.n.calibrations, 2);
        assert_int_equal(reg_peek(&r.a.regs, ADS1256_OFC0), 839 & 0xFF); /* 400000h * 1 mV / 5 V */
    }
}

static void resets_while_sync_is_low_calibrate_at_its_rise(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    set_rate(&r, 0x92);
    xfer(&r, 0xF0);
    ads1256_sync_pin(&r.a, false, r.s.now_ns);
    command(&r, 0xFE); /* counted: it comes before the DRDY of F0h */
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_DRATE), 0xF0);
    rreg(&r, ADS1256_DRATE); /* not counted: that DRDY will not come */
    assert_int_equal(r.a.n.gap_violations, 1);
    wait_ns(&r, 100000);
    assert_int_equal(r.a.n.calibrations, 2);
    ads1256_sync_pin(&r.a, true, r.s.now_ns);
    const int64_t from_ns = r.s.now_ns;
    near((double)(await_fall(&r) - from_ns) * 1e-3, 596.0, 0.2);
}

/* SYNC/PDWN low when a calibration ends: its result is stored, the conversions wait for the rise. */
static void calibration_that_ends_while_sync_is_low(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet, 1);
    wait_ns(&r, 100000);
    ads1256_sync_pin(&r.a, false, r.s.now_ns);
    assert_int_equal(r.a.n.refused, 1);
    wait_ns(&r, 500000);
    assert_int_equal(r.a.n.calibrations, 1);
    assert_int_equal(r.a.mode, ADS1256_SYNC_LOW);
    ads1256_sync_pin(&r.a, true, r.s.now_ns);
    const int64_t k = clk_count_at(&r.a.clkin, r.s.now_ns);
    assert_int_equal(await_fall(&r), clk_edge_ns(&r.a.clkin, k + T18_TAU(1)));
}

static void calibration_between_sync_and_wakeup_ends_the_wait(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    command(&r, 0xFC);
    xfer(&r, 0xF1);
    const int64_t from_ns = r.s.now_ns;
    near((double)(await_fall(&r) - from_ns) * 1e-3, 386.7, 0.2);
    await_fall(&r);
}

static void early_commands_are_lost_when_strict(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.strict_bus = cfg.sync_halts = true;
    struct rig r;
    power_up(&r, &cfg, 1);
    xfer(&r, 0x51); /* while the calibration runs: an opcode and two bytes that are none */
    xfer(&r, 0x02);
    xfer(&r, 0x23);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_MUX), 0x01);
    assert_int_equal(r.a.n.dropped, 1);
    assert_int_equal(r.a.n.gap_violations, 1);
    assert_int_equal(r.a.n.bad_opcodes, 2);
    xfer(&r, 0xFE); /* RESET is heard */
    const int64_t from_ns = r.s.now_ns;
    near((double)(await_fall(&r) - from_ns) * 1e-3, 596.0, 0.2);
    set_rate(&r, 0x82);
    xfer(&r, 0x0F);
    spi_first(&r.a.spi, r.s.now_ns + tau_ns(24) - 1);
    wait_ns(&r, BYTE_NS);
    spi_byte(&r.a.spi, 0xFC, r.s.now_ns);
    assert_int_equal(r.a.mode, ADS1256_RUNNING);
    wait_ns(&r, T11_NS);
    command(&r, 0xFC);
    assert_int_equal(r.a.mode, ADS1256_SYNC_WAIT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(power_up_takes_the_time_of_its_clock),
        cmocka_unit_test(nothing_is_heard_while_the_clock_starts),
        cmocka_unit_test(power_up_in_reset_waits_for_the_pin),
        cmocka_unit_test(every_kind_of_reset),
        cmocka_unit_test(pulses_shorter_than_t16_are_counted),
        cmocka_unit_test(standby_stops_after_the_present_drdy),
        cmocka_unit_test(one_shot_takes_t18_and_256_tau),
        cmocka_unit_test(commands_before_the_drdy_after_standby_are_counted),
        cmocka_unit_test(standby_and_sync_where_there_is_nothing_to_stop),
        cmocka_unit_test(sclk_interrupts_standby_when_strict),
        cmocka_unit_test(wakeup_from_standby_is_no_early_command),
        cmocka_unit_test(power_down_keeps_the_registers),
        cmocka_unit_test(power_up_ends_a_power_down),
        cmocka_unit_test(power_down_from_anywhere_and_back),
        cmocka_unit_test(calibrations_wait_for_the_converter),
        cmocka_unit_test(resets_while_sync_is_low_calibrate_at_its_rise),
        cmocka_unit_test(calibration_that_ends_while_sync_is_low),
        cmocka_unit_test(calibration_between_sync_and_wakeup_ends_the_wait),
        cmocka_unit_test(early_commands_are_lost_when_strict),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

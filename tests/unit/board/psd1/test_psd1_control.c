/* PSD-1: control words, commands, the registers beside the three words. */
#include "psd1_rig.h"

#include <math.h>

static struct rig rig, other;

/* ---- control words ---- */

static void control_words_go_out_and_come_back(void **state)
{
    (void)state;
    struct psd1_request q;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    /* gain 2, AIN2, 500 Hz: full scale +-5 V */
    const uint32_t word = AD7712_CONTROL(AD7712_NORMAL, 1, 1, 0, 0, 39);
    assert_int_equal(command(&rig, &q, PSD1_CMD_UC2, word), BOARD_CYCLE_OK);
    assert_int_equal(rig.b.uc2, word);
    for (unsigned i = 0; i < 3; i++) {
        assert_int_equal(rig.b.adc[i].control, word);
        assert_int_equal(command(&rig, &q, (uint8_t)(PSD1_CMD_CONTROL + i), 0), BOARD_CYCLE_OK);
        assert_int_equal(q.word, word);
    }
    const unsigned before = rig.cycles;
    rig_run(&rig, 100 * 39 * 51200);
    assert_in_range(rig.cycles, before + 98, before + 101);
    assert_int_equal(rig.cycle[rig.cycles - 1].word[0], 49074); /* 32768 (1 + 2.4882 / 5), coefficients of gain 1 */
    assert_int_equal(rig.b.counters.commands, 4);
}

static void the_other_input_is_not_connected(void **state)
{
    (void)state;
    struct psd1_request q;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    assert_int_equal(command(&rig, &q, PSD1_CMD_UC2, AD7712_CONTROL(AD7712_NORMAL, 0, 0, 0, 0, 19)), BOARD_CYCLE_OK);
    rig_run(&rig, 10000000);
    for (unsigned i = 0; i < 3; i++) assert_int_equal(rig.cycle[rig.cycles - 1].word[i], 32768);
}

static void uc1_calibrates_anew(void **state)
{
    (void)state;
    struct psd1_request q;
    struct psd1_profile p = rig_exact();
    p.adc_offset_sd_v = 1e-2;
    rig_up(&rig, &p);
    const uint32_t zero = rig.b.zero[0];
    const uint32_t word = AD7712_CONTROL(AD7712_SELF_CAL, 2, 1, 0, 0, 19);
    assert_int_equal(command(&rig, &q, PSD1_CMD_UC1, word), BOARD_CYCLE_OK);
    assert_int_equal(rig.b.uc1, word);
    assert_int_equal(rig.b.adc[0].n.calibrations, 2);
    assert_true(rig.b.zero[0] != zero); /* the offset in the units of gain 4 */
    assert_int_equal(rig.b.zero[0], rig.b.adc[0].zero[1]);
    assert_int_equal(rig.b.full[2], rig.b.adc[2].full[1]);
    assert_int_equal(rig.b.adc[0].control, 0x020013); /* UC2 follows */
}

static void words_that_the_cycle_cannot_live_with_are_refused(void **state)
{
    (void)state;
    static const struct {
        uint8_t command;
        uint32_t word;
        bool good;
    } rows[] = {
        {PSD1_CMD_UC2, 0x020013, true},   {PSD1_CMD_UC2, 0x028013, false}, /* WL */
        {PSD1_CMD_UC2, 0x030013, false},                                   /* PD */
        {PSD1_CMD_UC2, 0x020012, false},                                   /* FS 18 */
        {PSD1_CMD_UC2, 0x0207D0, true},                                    /* FS 2000 */
        {PSD1_CMD_UC2, 0x0207D1, false},  {PSD1_CMD_UC2, 0xA20013, true},  /* background calibration */
        {PSD1_CMD_UC2, 0x220013, false},                                   /* a calibration */
        {PSD1_CMD_UC2, 0xC20013, false},                                   /* coefficient */
        {PSD1_CMD_UC1, 0x020013, false},                                   /* none */
        {PSD1_CMD_UC1, 0x820013, true},                                    /* system offset */
        {PSD1_CMD_UC1, 0xA20013, false},  {PSD1_CMD_UC1, 0x228013, false}, {PSD1_CMD_NONE, 0x020013, false},
        {PSD1_CMD_CONTROL + 3, 0, false}, {PSD1_CMD_SHOW_UC1, 0, false},
    };
    struct psd1_request q;
    for (size_t i = 0; i < COUNT(rows); i++) {
        const struct psd1_profile p = rig_exact();
        rig_up(&rig, &p);
        const enum board_cycle_result r = command(&rig, &q, rows[i].command, rows[i].word);
        if (r != (rows[i].good ? BOARD_CYCLE_OK : BOARD_CYCLE_BAD_VALUE)) fail_msg("row %zu: %d", i, (int)r);
    }
}

static void commands_come_one_after_the_other_and_between_cycles(void **state)
{
    (void)state;
    struct psd1_request q, second = {.command = PSD1_CMD_UC2, .word = 0x020013, .done = request_done, .ctx = &rig};
    const char *why = NULL;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    rig_await(&rig, PSD1_RF_RISE);
    q = (struct psd1_request){.command = PSD1_CMD_UC2, .word = 0x020013, .done = request_done, .ctx = &rig};
    const unsigned before = rig.cycles;
    assert_int_equal(psd1_request(&rig.b, &q, &why, rig.s.now_ns), BOARD_CYCLE_OK);
    assert_int_equal(psd1_request(&rig.b, &second, &why, rig.s.now_ns), BOARD_CYCLE_BUSY);
    rig_await(&rig, PSD1_TFS_FALL);
    assert_int_equal(rig.cycles, before + 1);
    assert_int_equal(rig.b.counters.cut, 0);
    psd1_reset(&rig.b, rig.s.now_ns);
    assert_int_equal(rig.result, BOARD_CYCLE_OFF);
    assert_int_equal(psd1_request(&rig.b, &q, &why, rig.s.now_ns), BOARD_CYCLE_OFF);
}

/* No one reads: after a millisecond the command cuts the cycle. */
static void a_command_does_not_wait_for_a_host_that_never_comes(void **state)
{
    (void)state;
    struct psd1_request q;
    const struct psd1_profile p = no_host();
    rig_up(&rig, &p);
    rig_await(&rig, PSD1_READY);
    const int64_t asked_ns = rig.s.now_ns;
    assert_int_equal(command(&rig, &q, PSD1_CMD_UC2, 0x020013), BOARD_CYCLE_OK);
    assert_int_equal(rig.b.counters.cut, 1);
    assert_in_range(rig.event_ns[PSD1_EV_UC] - asked_ns, 1000000, 1000800);
    assert_false(rig.b.fl2);
    assert_int_equal(take(&rig, 0), 40921);
}

/* While the word is being read, the cycle is not cut. */
static void a_command_waits_for_a_strobe(void **state)
{
    (void)state;
    struct psd1_request q = {.command = PSD1_CMD_UC2, .word = 0x020013, .done = request_done, .ctx = &rig};
    const char *why = NULL;
    const struct psd1_profile p = no_host();
    rig_up(&rig, &p);
    (void)take(&rig, 0);
    (void)take(&rig, 0);
    rig_await(&rig, PSD1_READY);
    assert_int_equal(psd1_request(&rig.b, &q, &why, rig.s.now_ns), BOARD_CYCLE_OK);
    assert_int_equal(rig_bus(&rig, false, 2, 0, 1500000), BOARD_CYCLE_OK);
    rig_await(&rig, PSD1_TFS_FALL);
    assert_int_equal(rig.b.counters.cut, 0);
    assert_int_equal(rig.cycles, 1);
}

/* A0 falls with the cut, at any instant: RFx for the control word leaves it the 2 tau that it needs. Found by fuzzing. */
static void a_control_word_is_read_after_a_cut(void **state)
{
    (void)state;
    for (int64_t before_ns = 0; before_ns < 400; before_ns += 133) {
        struct psd1_request q;
        struct psd1_profile p = no_host();
        p.adc_fs = 200; /* no word comes meanwhile */
        rig_up(&rig, &p);
        rig_await(&rig, PSD1_READY);
        rig_until(&rig, rig.b.fl2_ns + 799 - before_ns);
        assert_int_equal(command(&rig, &q, PSD1_CMD_CONTROL, 0), BOARD_CYCLE_OK);
        assert_int_equal(q.word, 0x0200C8);
        assert_int_equal(rig.b.counters.cut, 1);
        for (unsigned i = 0; i < 3; i++) assert_int_equal(rig.b.adc[i].n.a0_violations, 0);
    }
}

/* ---- registers ---- */

static void registers_of_control_words(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    rig_write(&rig, PSD1_REG_UC_HIGH, 0x02);
    rig_write(&rig, PSD1_REG_UC_LOW, 0x0027);
    assert_int_equal(rig_read(&rig, PSD1_REG_UC_HIGH), 0x02);
    assert_int_equal(rig_read(&rig, PSD1_REG_UC_LOW), 0x0027);
    rig_write(&rig, PSD1_REG_COMMAND, PSD1_CMD_UC2);
    assert_int_equal(rig_read(&rig, PSD1_REG_COMMAND), 0x8002);
    assert_int_equal(rig_read(&rig, PSD1_REG_STATUS) & PSD1_ST_COMMAND, PSD1_ST_COMMAND);
    assert_int_equal(rig_bus(&rig, true, PSD1_REG_COMMAND, PSD1_CMD_UC2, 0), BOARD_CYCLE_BUSY);
    rig_run(&rig, 20000000);
    assert_int_equal(rig_read(&rig, PSD1_REG_COMMAND), 0x0002);
    assert_int_equal(rig.b.adc[1].control, 0x020027);
    static const struct {
        uint16_t command;
        uint32_t word;
    } shown[] = {{3, 0x220013}, {4, 0x020027}, {0x10, 0x800000}, {0x12, 0x800000}, {0x20, 0x400000}, {0x22, 0x400000}};
    for (size_t i = 0; i < COUNT(shown); i++) {
        rig_write(&rig, PSD1_REG_COMMAND, shown[i].command);
        assert_int_equal(rig_read(&rig, PSD1_REG_UC_HIGH), shown[i].word >> 16);
        assert_int_equal(rig_read(&rig, PSD1_REG_UC_LOW), shown[i].word & 0xFFFF);
    }
    rig_write(&rig, PSD1_REG_UC_LOW, 0);
    rig_write(&rig, PSD1_REG_COMMAND, 0x31);
    rig_run(&rig, 1000000);
    assert_int_equal(rig_read(&rig, PSD1_REG_UC_LOW), 0x0027);
    assert_int_equal(rig_read(&rig, PSD1_REG_UC_HIGH), 0x02);
}

static void status_and_flags(void **state)
{
    (void)state;
    const struct psd1_profile p = no_host();
    rig_init(&rig, &p, 0.0);
    psd1_power_up(&rig.b, 0);
    rig_await(&rig, PSD1_TFS_FALL);
    assert_int_equal(rig_read(&rig, PSD1_REG_STATUS) & ~(unsigned)PSD1_ST_DR, PSD1_ST_COMMAND);
    rig_up(&rig, &p);
    const unsigned always = PSD1_ST_INT0 | PSD1_ST_FL1 | PSD1_ST_READY | PSD1_ST_COEF;
    for (unsigned axis = 0; axis < 3; axis++) {
        rig_await(&rig, PSD1_READY);
        assert_int_equal(rig_read(&rig, PSD1_REG_STATUS), always | PSD1_ST_CYCLE | PSD1_ST_FL2 | axis << 1);
        (void)rig_read(&rig, (uint8_t)axis);
        rig_await(&rig, axis < 2 ? PSD1_RF_RISE : PSD1_IDLE);
    }
    assert_int_equal(rig_read(&rig, PSD1_REG_STATUS), always);
    rig_write(&rig, PSD1_REG_FLAGS, 2);
    rig_run(&rig, 2000000);
    assert_int_equal(rig_read(&rig, PSD1_REG_STATUS), (always & ~(unsigned)PSD1_ST_INT0) | PSD1_ST_DR);
    assert_int_equal(rig_read(&rig, PSD1_REG_FLAGS), 2);
    rig_write(&rig, PSD1_REG_FLAGS, 3);
    rig_await(&rig, PSD1_READY);
    for (unsigned axis = 0; axis < 3; axis++) (void)take(&rig, 30000);
    rig_await(&rig, PSD1_IDLE);
    assert_int_equal(rig_read(&rig, PSD1_REG_STATUS), always | PSD1_ST_OVERRUN | PSD1_ST_LATE);
}

static void temperatures_and_service_signals(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    rig.degc[0] = -40.0;
    rig.degc[1] = 25.0;
    rig.degc[2] = 85.03; /* 1360.48 codes */
    rig.degc[3] = 200.0; /* beyond the code */
    static const uint16_t code[4] = {0xD80, 0x190, 0x550, 0x7FF};
    for (uint16_t i = 0; i < 4; i++) {
        rig_write(&rig, PSD1_REG_TEMP, i);
        assert_int_equal(rig_read(&rig, PSD1_REG_TEMP), i << 12 | code[i]);
    }
    rig.degc[3] = 30.0;
    static const uint16_t service[4] = {2500, 1250, 0x1E0, 0xA1F};
    for (uint16_t i = 0; i < 4; i++) {
        rig_write(&rig, PSD1_REG_SERVICE, i);
        assert_int_equal(rig_read(&rig, PSD1_REG_SERVICE), i << 12 | service[i]);
    }
}

/* 2 mV a code, 5 V at the nominal supply; 12 bits hold 8.19 V. The reference does not mind. */
static void the_supply_is_told_as_it_is(void **state)
{
    (void)state;
    static const struct {
        double ratio;
        uint16_t code;
    } rows[] = {{1.0, 2500}, {0.8, 2000}, {1.25, 3125}, {2.0, 4095}, {0.0, 0}};
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    for (size_t i = 0; i < COUNT(rows); i++) {
        rig.supply_ratio = rows[i].ratio;
        rig_write(&rig, PSD1_REG_SERVICE, 0);
        assert_int_equal(rig_read(&rig, PSD1_REG_SERVICE), rows[i].code);
        rig_write(&rig, PSD1_REG_SERVICE, 1);
        assert_int_equal(rig_read(&rig, PSD1_REG_SERVICE), 0x1000 | 1250);
    }
    rig.b.base.io.supply_ratio = NULL;
    rig_write(&rig, PSD1_REG_SERVICE, 0);
    assert_int_equal(rig_read(&rig, PSD1_REG_SERVICE), 2500);
}

/* 10 deg/s for a second are 36000 counts of 1", latched at A0, two's complement on the bus. */
static void gyros_count_what_they_turn(void **state)
{
    (void)state;
    struct psd1_profile p = rig_exact();
    rig_init(&rig, &p, 0.0);
    const double deg = 3.14159265358979323846 / 180.0;
    rig.w_radps[0] = 10.0 * deg;
    rig.w_radps[1] = -0.5 * deg;
    rig.w_radps[2] = 700.0 * deg;
    psd1_power_up(&rig.b, 0);
    rig_run(&rig, 1000000000);
    const struct psd1_cycle *c = &rig.cycle[rig.cycles - 1];
    const double s = 1e-9 * (double)c->t_a0_ns;
    assert_true(fabs(c->gyro[0] - 36000.0 * s) <= 1.0);
    assert_true(fabs(c->gyro[1] + 1800.0 * s) <= 1.0);
    assert_int_equal(c->gyro[1], (int32_t)floor(-1800.0 * s + 1e-9));
    assert_int_equal(c->rate[0], 500);
    assert_int_equal(c->rate[1], -25);
    assert_int_equal(c->rate[2], 32767);
    rig_await(&rig, PSD1_IDLE);
    for (unsigned i = 0; i < 3; i++) {
        assert_int_equal(rig_read(&rig, (uint8_t)(PSD1_REG_GYRO_X + i)), (uint16_t)rig.b.latest.gyro[i]);
        assert_int_equal(rig_read(&rig, (uint8_t)(PSD1_REG_RATE_X + i)), (uint16_t)rig.b.latest.rate[i]);
    }
}

/* A turn of 30 deg in steps that know nothing of the grid; looking at it changes nothing. */
static void abrupt_changes_of_the_rate_are_kept(void **state)
{
    (void)state;
    struct psd1_profile p = rig_exact();
    rig_init(&rig, &p, 0.0);
    psd1_power_up(&rig.b, 0);
    rig_until(&rig, 12345678);
    psd1_sample_until(&rig.b, rig.s.now_ns);
    rig.w_radps[2] = 0.5;
    rig_until(&rig, 1012445678);
    psd1_sample_until(&rig.b, rig.s.now_ns);
    rig.w_radps[2] = 0.0;
    rig_run(&rig, 10000000);
    assert_true(fabs(rig.b.gyros.axis[2].angle_rad - 0.50005) < 1e-9);
    const int32_t counts = rig.cycle[rig.cycles - 1].gyro[2];
    assert_true(fabs(counts - 0.50005 * 180.0 / 3.14159265358979 * 3600.0) < 1.01);
    /* a ramp: the trapezoid is exact */
    rig_init(&rig, &p, 0.0);
    rig.w_radps2 = 2.0;
    psd1_power_up(&rig.b, 0);
    rig_until(&rig, 1000000000);
    const struct psd1_cycle *c = &rig.cycle[rig.cycles - 1];
    const double s = 1e-9 * (double)c->t_a0_ns, angle_rad = s * s;
    assert_true(fabs(c->gyro[1] - angle_rad * 180.0 / 3.14159265358979 * 3600.0) < 1.01);
}

/* 1 deg/sqrt(h) in steps of eight points; after a power cycle it takes another way. */
static void the_walk_has_its_density_and_does_not_repeat(void **state)
{
    (void)state;
    enum { N = 1000 };
    static double step_rad[2][3 * N];
    struct psd1_profile p = rig_exact();
    p.gyro_arw_deg_rth = 1.0;
    const int64_t step_ns = 8 * (int64_t)p.gyro_grid_ns;
    const double rms_rad = 3.14159265358979 / 180.0 * sqrt(1e-9 * (double)step_ns / 3600.0);
    rig_init(&rig, &p, 1.0);
    for (unsigned life = 0; life < 2; life++) {
        double last_rad[3] = {0.0}, squares = 0.0;
        const int64_t from_ns = rig.s.now_ns;
        psd1_power_up(&rig.b, from_ns);
        for (unsigned k = 0; k < N; k++) {
            rig_until(&rig, from_ns + (k + 1) * step_ns);
            psd1_sample_until(&rig.b, rig.s.now_ns);
            for (unsigned i = 0; i < 3; i++) {
                const double angle_rad = rig.b.gyros.axis[i].angle_rad;
                step_rad[life][3 * k + i] = (angle_rad - last_rad[i]) / rms_rad;
                squares += pow(step_rad[life][3 * k + i], 2.0);
                last_rad[i] = angle_rad;
            }
        }
        assert_true(fabs(squares / (3.0 * N) - 1.0) < 4.0 * sqrt(2.0 / (3.0 * N)));
        psd1_power_down(&rig.b, rig.s.now_ns);
    }
    double sum = 0.0;
    for (unsigned k = 0; k < 3 * N; k++) sum += step_rad[0][k] * step_rad[1][k];
    assert_true(fabs(sum) < 5.0 * sqrt(3.0 * N));
}

static void specimens_differ_and_seeds_repeat(void **state)
{
    (void)state;
    struct psd1_profile p;
    fields_default(&psd1_fields, &p);
    for (unsigned k = 0; k < 2; k++) {
        struct rig *r = k ? &other : &rig;
        rig_init(r, &p, 1.0);
        psd1_power_up(&r->b, 0);
        rig_run(r, 500000000);
    }
    assert_int_equal(rig.cycles, other.cycles);
    unsigned same = 0;
    for (unsigned i = 1; i < rig.cycles; i++) {
        for (unsigned a = 0; a < 3; a++) assert_int_equal(rig.cycle[i].word[a], other.cycle[i].word[a]);
        same += rig.cycle[i].word[0] == rig.cycle[i - 1].word[0];
    }
    assert_true(same < rig.cycles / 2); /* the noise of 1028 Hz is tens of codes */
    assert_true(rig.b.vref_error != 0.0 && rig.b.gyros.axis[0].bias_radps != rig.b.gyros.axis[1].bias_radps);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(control_words_go_out_and_come_back),
        cmocka_unit_test(the_other_input_is_not_connected),
        cmocka_unit_test(uc1_calibrates_anew),
        cmocka_unit_test(words_that_the_cycle_cannot_live_with_are_refused),
        cmocka_unit_test(commands_come_one_after_the_other_and_between_cycles),
        cmocka_unit_test(a_command_does_not_wait_for_a_host_that_never_comes),
        cmocka_unit_test(a_command_waits_for_a_strobe),
        cmocka_unit_test(a_control_word_is_read_after_a_cut),
        cmocka_unit_test(registers_of_control_words),
        cmocka_unit_test(status_and_flags),
        cmocka_unit_test(temperatures_and_service_signals),
        cmocka_unit_test(the_supply_is_told_as_it_is),
        cmocka_unit_test(gyros_count_what_they_turn),
        cmocka_unit_test(abrupt_changes_of_the_rate_are_kept),
        cmocka_unit_test(the_walk_has_its_density_and_does_not_repeat),
        cmocka_unit_test(specimens_differ_and_seeds_repeat),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

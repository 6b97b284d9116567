/* PMKA: registers on the parallel bus, the ROM behind them, and what is refused. */
#include "pmka_rig.h"

enum { X, Y, Z, K, RESETS, ROTATION, SEQ, TEMPERATURE, STATUS, MODE, COMMAND, BEAT, ZERO, INDEX, DATA, NOTHING };

static struct rig rig;

static void up(void)
{
    const struct pmka_profile p = rig_profile();
    rig_up(&rig, &p);
    rig.input[0].mean_v = 7.0;
    rig.input[1].mean_v = -9.0;
    rig.degc = 31.5;
    rig_readings(&rig, 300);
}

static void registers_tell_the_latest_reading(void **state)
{
    (void)state;
    up();
    for (unsigned n = 0; n < 40; n++) {
        rig_readings(&rig, 301 + n);
        const struct pmka_reading *r = &rig.reading[rig.readings - 1];
        assert_int_equal(rig_read(&rig, STATUS) & 1, 1);
        for (unsigned i = 0; i < PMKA_INTS; i++) assert_int_equal((int16_t)rig_read(&rig, X + i), r->code[i]);
        const unsigned resets = rig_read(&rig, RESETS), rotation = rig_read(&rig, ROTATION);
        for (unsigned i = 0; i < PMKA_INTS; i++) {
            const int sign = (int)(resets >> (2 * i) & 3);
            assert_int_equal(sign == 3 ? -1 : sign, r->reset[i]);
            assert_int_equal(rotation >> (2 * i) & 3, r->serves[i]);
        }
        assert_int_equal(rotation >> 8 & 7, r->tau);
        assert_int_equal(rotation >> 12, r->cal);
        assert_int_equal(rig_read(&rig, SEQ), r->seq);
        assert_int_equal((int16_t)rig_read(&rig, TEMPERATURE), r->temp_code);
        assert_int_equal(rig_read(&rig, STATUS) & 3, 0);
    }
    assert_in_range(rig_read(&rig, TEMPERATURE), 31.2 * 128, 31.8 * 128);
}

static void a_reading_that_nobody_took_is_told(void **state)
{
    (void)state;
    up();
    (void)rig_read(&rig, K);
    assert_int_equal(rig_read(&rig, STATUS) & 3, 2); /* those before no one has taken */
    assert_int_equal(rig_read(&rig, STATUS) & 3, 0);
    rig_readings(&rig, 301);
    assert_int_equal(rig_read(&rig, STATUS) & 3, 1);
    rig_readings(&rig, 302);
    assert_int_equal(rig_read(&rig, STATUS) & 3, 3);
    assert_int_equal(rig_read(&rig, STATUS) & 3, 1);
    assert_int_equal(rig_read(&rig, STATUS) & 16, 16); /* autonomous */
}

static void numbers_of_resets(void **state)
{
    (void)state;
    up();
    unsigned count[8] = {0};
    for (unsigned k = 0; k < rig.readings; k++)
        for (unsigned i = 0; i < PMKA_INTS; i++)
            if (rig.reading[k].reset[i]) count[2 * i + (rig.reading[k].reset[i] < 0)]++;
    for (unsigned n = 0; n < 8; n++) {
        assert_int_equal(rig_write(&rig, INDEX, (uint16_t)n), BOARD_CYCLE_OK);
        assert_int_equal(rig_read(&rig, INDEX), n);
        assert_in_range(rig_read(&rig, DATA), count[n], count[n] + 1); /* one may have begun */
    }
    assert_true(count[0] > 100 && count[3] > 100);
}

static uint16_t rom_word(unsigned w)
{
    assert_int_equal(rig_write(&rig, INDEX, (uint16_t)(0x100 + w)), BOARD_CYCLE_OK);
    return rig_read(&rig, DATA);
}

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

/* Half a bit of each word, and of CT the error of the factory: 5 sigma of 0.2 ppm. */
static void the_rom_has_the_specimen(void **state)
{
    (void)state;
    up();
    uint16_t sum = 0;
    for (unsigned w = 0; w < PMKA_ROM_WORDS; w++) sum = (uint16_t)(sum + rom_word(w));
    assert_int_equal(sum, 0);
    assert_int_equal(PMKA_ROM_WORDS, 91);
    const uint16_t head[] = {1, 3, 7, (uint16_t)-40, 20, 4800};
    for (unsigned w = 0; w < COUNT(head); w++) assert_int_equal(rom_word(w), head[w]);
    for (unsigned i = 0; i < PMKA_INTS; i++) {
        for (unsigned p = 0; p < 7; p++) {
            const struct pmka_int_cfg *c = &rig.b.channel[i].integrator.cfg;
            const double degc = -40.0 + 20.0 * p, dt = degc - 25.0;
            const double uref = rig.b.specimen.uref_v + rig.b.specimen.uref_tc_v_per_k * dt;
            const double r_in = c->r_in_ohm * (1.0 + c->r_in_tc_per_k * dt);
            for (unsigned s = 0; s < 2; s++) {
                const double ct = uref / 10.0 * r_in / (2.0 * c->rr_ohm[s] * (1.0 + c->rr_tc_per_k[s] * dt));
                near(1.0 + (int16_t)rom_word(6 + 3 * (7 * i + p) + s) / 4194304.0, ct, 0.12e-6 + 1e-6);
            }
            const double zero_vs = (c->zero_v + c->zero_tc_v_per_k * dt) * 4.8e-3;
            near((int16_t)rom_word(6 + 3 * (7 * i + p) + 2) * 1e-10, zero_vs, 0.501e-10);
        }
    }
}

enum { SPECIMENS = 200 };

static void init_specimen(uint32_t serial, double rom_ct_sd_ppm)
{
    struct pmka_profile p = rig_profile();
    p.rom_ct_sd_ppm = rom_ct_sd_ppm;
    struct board_cfg cfg = rig_cfg();
    cfg.serial = serial;
    rig_init(&rig, &p);
    const struct board_io io = {.ctx = &rig, .accel = rig_accel_row, .temp_degc = rig_degc, .event = rig_event};
    pmka_board.init(&rig.b.base, &p, &cfg, &io, &rig.s);
}

/* Rr(-) over Rr(+) of 800 integrators: 200 ppm, and 100 ppm of each resistor. 5 sigma of the mean, and of the spread. */
static void resets_of_either_sign_differ_by_the_profile_s_asymmetry(void **state)
{
    (void)state;
    const unsigned n = SPECIMENS * PMKA_INTS;
    double sum = 0.0, sum2 = 0.0;
    for (uint32_t serial = 1; serial <= SPECIMENS; serial++) {
        init_specimen(serial, 0.2);
        for (unsigned i = 0; i < PMKA_INTS; i++) {
            const struct pmka_int_cfg *c = &rig.b.channel[i].integrator.cfg;
            const double ppm =
                1e6 *
                (pmka_int_ct(c, PMKA_PLUS, 10.0, 10.0, 25.0) / pmka_int_ct(c, PMKA_MINUS, 10.0, 10.0, 25.0) - 1.0);
            sum += ppm;
            sum2 += ppm * ppm;
        }
    }
    const double sd_ppm = sqrt(2.0) * 100.0, mean_ppm = sum / n;
    near(mean_ppm, 200.0, 5.0 * sd_ppm / sqrt(n));
    near(sqrt(sum2 / n - mean_ppm * mean_ppm), sd_ppm, 5.0 * sd_ppm / sqrt(2.0 * n));
}

/* Mean error of CT in the ROM of an integrator, relative; rounding hides in the mean of 14 words. */
static double ct_error(unsigned i)
{
    const struct pmka_int_cfg *c = &rig.b.channel[i].integrator.cfg;
    double sum = 0.0;
    for (unsigned p = 0; p < 7; p++) {
        const double degc = -40.0 + 20.0 * p, dt = degc - 25.0;
        const double uref = rig.b.specimen.uref_v + rig.b.specimen.uref_tc_v_per_k * dt;
        for (unsigned s = 0; s < 2; s++)
            sum += (int16_t)rig.b.rom[6 + 3 * (7 * i + p) + s] / 4194304.0 -
                   (pmka_int_ct(c, (enum pmka_sign)s, uref, 10.0, degc) - 1.0);
    }
    return sum / 14.0;
}

/* The factory measures CT with an error of the profile's size, another one in each integrator and specimen. */
static void the_rom_has_the_factory_s_error(void **state)
{
    (void)state;
    static const double sd_ppm[] = {0.2, 1.0, 0.0};
    for (unsigned k = 0; k < COUNT(sd_ppm); k++) {
        double sum = 0.0, sum2 = 0.0, product = 0.0;
        const unsigned specimens = SPECIMENS;
        for (uint32_t n = 0; n < specimens; n++) {
            init_specimen(n + 1, sd_ppm[k]);
            for (unsigned i = 0; i < PMKA_INTS; i++) {
                const double e = 1e6 * ct_error(i);
                sum += e;
                sum2 += e * e;
            }
            product += 1e12 * ct_error(0) * ct_error(1);
        }
        const double rms = sqrt(sum2 / (4.0 * specimens));
        near(rms, sd_ppm[k], k == 2 ? 0.03 : 0.12 * sd_ppm[k]); /* its own sd: 2.5 % */
        near(sum / (4.0 * specimens), 0.0, 4.0 * rms / sqrt(4.0 * specimens));
        near(product / specimens, 0.0, 4.0 * rms * rms / sqrt(specimens));
    }
}

static void what_is_refused(void **state)
{
    (void)state;
    up();
    const struct {
        bool write;
        unsigned address;
        uint16_t data;
        enum board_cycle_result want;
    } rows[] = {
        {false, NOTHING, 0, BOARD_CYCLE_NO_ADDRESS},
        {true, NOTHING, 0, BOARD_CYCLE_NO_ADDRESS},
        {false, 16, 0, BOARD_CYCLE_NO_ADDRESS},
        {true, 255, 0, BOARD_CYCLE_NO_ADDRESS},
        {true, X, 1, BOARD_CYCLE_READ_ONLY},
        {true, STATUS, 1, BOARD_CYCLE_READ_ONLY},
        {true, DATA, 1, BOARD_CYCLE_READ_ONLY},
        {false, COMMAND, 0, BOARD_CYCLE_WRITE_ONLY},
        {true, MODE, 2, BOARD_CYCLE_BAD_VALUE},
        {true, COMMAND, 2, BOARD_CYCLE_BAD_VALUE}, /* autonomous */
        {true, BEAT, 125, BOARD_CYCLE_BAD_VALUE},
        {true, BEAT, 126, BOARD_CYCLE_OK},
        {true, BEAT, 60001, BOARD_CYCLE_BAD_VALUE},
        {true, ZERO, 121, BOARD_CYCLE_BAD_VALUE},
        {true, ZERO, 0, BOARD_CYCLE_BAD_VALUE},
        {true, ZERO, 65535, BOARD_CYCLE_BAD_VALUE},
        {true, ZERO, 1, BOARD_CYCLE_OK},
        {true, INDEX, 8, BOARD_CYCLE_BAD_VALUE},
        {true, INDEX, 0xFF, BOARD_CYCLE_BAD_VALUE},
        {true, INDEX, 0x100 + 90, BOARD_CYCLE_OK},
        {true, INDEX, 0x100 + 91, BOARD_CYCLE_BAD_VALUE},
        {true, MODE, 0, BOARD_CYCLE_OK},
        {true, COMMAND, 6, BOARD_CYCLE_BAD_VALUE},
        {true, COMMAND, 0x32, BOARD_CYCLE_BAD_VALUE},
        {true, COMMAND, 0x42, BOARD_CYCLE_BAD_VALUE},
        {true, COMMAND, 8, BOARD_CYCLE_BAD_VALUE},
        {true, COMMAND, 0x25, BOARD_CYCLE_OK},
    };
    unsigned ok = 0;
    for (size_t k = 0; k < COUNT(rows); k++) {
        uint16_t data = rows[k].data;
        if (rig_cycle(&rig, rows[k].write, rows[k].address, &data) != rows[k].want) fail_msg("row %zu", k);
        ok += rows[k].want == BOARD_CYCLE_OK;
    }
    assert_int_equal(rig.b.counters.cycles, ok);
    assert_int_equal(rig.b.counters.cycles_refused, COUNT(rows) - ok);
    assert_int_equal(rig_read(&rig, BEAT), 126);
    assert_int_equal(rig_read(&rig, ZERO), 1);
    assert_int_equal(rig_read(&rig, MODE), 0);
    assert_int_equal(rig.b.rotation.asked_tau, 5);
    assert_int_equal(rig.b.rotation.asked_cal, PMKA_CAL_RESET);
    assert_null(board_bus_name(&pmka_bus, NOTHING));
    assert_string_equal(board_bus_name(&pmka_bus, ROTATION), "ROTATION");
    assert_int_equal(pmka_board.bus->addresses, 16);
}

static void strobes(void **state)
{
    (void)state;
    up();
    struct board_cycle c = {.address = Y, .strobe_ns = 199, .done = rig_done, .ctx = &rig}, other = c;
    assert_int_equal(pmka_bus.submit(&rig.b.base, &c, rig.s.now_ns), BOARD_CYCLE_TOO_SHORT);
    c.strobe_ns = 5000000; /* the register holds what it had at the strobe's beginning */
    const int16_t was = rig.reading[rig.readings - 1].code[1];
    const int64_t t_ns = rig.s.now_ns;
    rig.answered = false;
    assert_int_equal(pmka_bus.submit(&rig.b.base, &c, t_ns), BOARD_CYCLE_OK);
    other.strobe_ns = 200;
    assert_int_equal(pmka_bus.submit(&rig.b.base, &other, t_ns), BOARD_CYCLE_BUSY);
    sched_run_until(&rig.s, t_ns + 4999999);
    assert_false(rig.answered);
    sched_run_until(&rig.s, t_ns + 5000000);
    assert_true(rig.answered);
    assert_int_equal((int16_t)c.data, was);
    assert_int_not_equal(rig.reading[rig.readings - 1].code[1], was);
    assert_int_equal(pmka_bus.submit(&rig.b.base, &other, rig.s.now_ns), BOARD_CYCLE_OK);
}

/* What is written comes into force when the strobe ends. */
static void a_write_acts_at_the_end_of_its_strobe(void **state)
{
    (void)state;
    up();
    struct board_cycle c = {
        .write = true, .address = BEAT, .data = 500, .strobe_ns = 1000, .done = rig_done, .ctx = &rig};
    assert_int_equal(pmka_bus.submit(&rig.b.base, &c, rig.s.now_ns), BOARD_CYCLE_OK);
    sched_run_until(&rig.s, rig.s.now_ns + 999);
    assert_int_equal(rig.b.rotation.beat_periods, 200);
    sched_run_until(&rig.s, rig.s.now_ns + 1);
    assert_int_equal(rig.b.rotation.beat_periods, 500);
    assert_int_equal(rig.result, BOARD_CYCLE_OK);
}

static void too_early_without_power_and_cut(void **state)
{
    (void)state;
    const struct pmka_profile p = rig_profile();
    uint16_t data = 0;
    rig_init(&rig, &p);
    assert_int_equal(rig_cycle(&rig, false, STATUS, &data), BOARD_CYCLE_OFF);
    pmka_board.power_up(&rig.b.base, 0);
    const unsigned of_reading[] = {X, Y, Z, K, RESETS, ROTATION, SEQ, TEMPERATURE};
    for (size_t k = 0; k < COUNT(of_reading); k++)
        assert_int_equal(rig_cycle(&rig, false, of_reading[k], &data), BOARD_CYCLE_NOT_READY);
    assert_int_equal(rig_read(&rig, STATUS), 16);
    rig_readings(&rig, 1);
    (void)rig_read(&rig, X);
    struct board_cycle c = {.address = X, .strobe_ns = 1000, .done = rig_done, .ctx = &rig};
    assert_int_equal(pmka_bus.submit(&rig.b.base, &c, rig.s.now_ns), BOARD_CYCLE_OK);
    rig.answered = false;
    pmka_board.reset(&rig.b.base, rig.s.now_ns);
    assert_true(rig.answered);
    assert_int_equal(rig.result, BOARD_CYCLE_OFF);
    assert_int_equal(rig_cycle(&rig, false, X, &data), BOARD_CYCLE_NOT_READY);
    c.address = STATUS;
    assert_int_equal(pmka_bus.submit(&rig.b.base, &c, rig.s.now_ns), BOARD_CYCLE_OK);
    pmka_board.power_down(&rig.b.base, rig.s.now_ns);
    assert_int_equal(rig.result, BOARD_CYCLE_OFF);
    assert_int_equal(pmka_bus.submit(&rig.b.base, &c, rig.s.now_ns), BOARD_CYCLE_OFF);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(registers_tell_the_latest_reading),
        cmocka_unit_test(a_reading_that_nobody_took_is_told),
        cmocka_unit_test(numbers_of_resets),
        cmocka_unit_test(the_rom_has_the_specimen),
        cmocka_unit_test(resets_of_either_sign_differ_by_the_profile_s_asymmetry),
        cmocka_unit_test(the_rom_has_the_factory_s_error),
        cmocka_unit_test(what_is_refused),
        cmocka_unit_test(strobes),
        cmocka_unit_test(a_write_acts_at_the_end_of_its_strobe),
        cmocka_unit_test(too_early_without_power_and_cut),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

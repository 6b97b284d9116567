/* PMKA: what goes wrong and shows; power, Res, the ends of amplifier and converter, what a digest and the truth tell. */
#include "pmka_rig.h"

static struct rig rig, other;

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

static struct pmka_profile short_beats(void)
{
    struct pmka_profile p = rig_ideal();
    p.beat_periods = 12;
    p.zero_periods = 5;
    return p;
}

static void up(struct rig *r, const struct pmka_profile *p, double volts)
{
    rig_init(r, p);
    for (unsigned a = 0; a < 3; a++) r->input[a].mean_v = volts;
    pmka_board.power_up(&r->b.base, 0);
}

/* Charge stays, so that the code of X jumps by 1 / 0.7, and its slope and its resets grow alike; none of the others. */
static void a_capacitor_that_has_lost_some(void **state)
{
    (void)state;
    struct pmka_profile p = short_beats();
    p.rotation = PMKA_PROGRAM;
    up(&rig, &p, 0.8);
    rig_readings(&rig, 6);
    pmka_set_faults(&rig.b, PMKA_FAULT_CAPACITOR);
    rig_readings(&rig, 30);
    const struct pmka_reading *r = rig.reading;
    near(r[6].code[0] * 0.7, r[6].code[1] - 0.8e-4 / 20e3 / 0.47e-6 * 3276.8, 2.0); /* Y is sampled 0.1 ms later */
    near((r[9].code[0] - r[8].code[0]) * 0.7, r[9].code[1] - r[8].code[1], 2.0);
    pmka_set_faults(&rig.b, 0);
    rig_readings(&rig, 32);
    near(r[31].code[0] - r[30].code[0], r[31].code[1] - r[30].code[1], 1.0);
}

/* It draws 10 V without an end against any input: down to the limit, and the reading says so. */
static void a_reset_that_sticks(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats();
    up(&rig, &p, 2.0);
    rig_readings(&rig, 5);
    assert_int_equal(rig.b.counters.saturations, 0);
    pmka_set_faults(&rig.b, PMKA_FAULT_STUCK_RESET);
    rig_readings(&rig, 20);
    assert_int_equal(rig.reading[15].code[0], -32768);
    assert_true(rig.reading[15].saturated[0] && rig.reading[15].clipped[0]);
    assert_false(rig.reading[15].saturated[1] || rig.reading[15].clipped[1]);
    assert_int_equal(rig.reading[15].reset[0], -1); /* in vain */
    pmka_set_faults(&rig.b, 0);
    rig_readings(&rig, 60);
    assert_false(rig.reading[59].saturated[0]);
}

/* The controller says that K serves X; nothing comes. */
static void a_key_that_sticks(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats();
    up(&rig, &p, 2.0);
    pmka_set_faults(&rig.b, PMKA_FAULT_STUCK_KEY);
    rig_readings(&rig, 40);
    unsigned served = 0;
    for (unsigned k = 15; k < 40; k++) {
        const struct pmka_reading *r = &rig.reading[k];
        if (r->serves[3] == 0 || rig.reading[k - 1].serves[3] == 0) continue;
        served++;
        assert_in_range(r->code[3] - rig.reading[k - 1].code[3] + 1, 0, 2);
    }
    assert_true(served > 15);
    assert_false(rig.b.base.trace.level >> PMKA_LINE_KL4 & 1);
    for (unsigned k = 15; k < 40; k++) { /* X back at work does not get what was lost */
        const struct pmka_reading *r = &rig.reading[k];
        if (r->serves[0] == 0 || r->reset[0] != 0) continue;
        assert_in_range(r->code[0] - rig.reading[k - 1].code[0], 0, 3347);
    }
    while (rig.b.channel[3].said_axis < 0) rig_run(&rig, 1000000);
    pmka_set_faults(&rig.b, 0); /* closes again, if K is to have an axis */
    assert_true(rig.b.base.trace.level >> PMKA_LINE_KL4 & 1);
    assert_int_equal(rig.b.channel[3].axis, rig.b.channel[3].said_axis);
    pmka_set_faults(&rig.b, PMKA_FAULT_STUCK_KEY);
    assert_int_equal(rig.b.channel[3].axis, -1);
}

static void words_that_freeze(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats();
    up(&rig, &p, 3.0);
    rig_readings(&rig, 10);
    pmka_set_faults(&rig.b, PMKA_FAULT_FROZEN_WORDS);
    rig_readings(&rig, 20);
    for (unsigned k = 10; k < 20; k++) {
        assert_memory_equal(rig.reading[k].code, rig.reading[9].code, 8);
        assert_int_equal(rig.reading[k].seq, k);
    }
    pmka_set_faults(&rig.b, 0);
    rig_readings(&rig, 21);
    assert_memory_not_equal(rig.reading[20].code, rig.reading[9].code, 8);
}

static const struct board_part *part(const char *name, unsigned *number)
{
    for (*number = 0; *number < pmka_board.part_count; (*number)++)
        if (strcmp(pmka_board.parts[*number].name, name) == 0) return &pmka_board.parts[*number];
    fail_msg("no part %s", name);
    return NULL;
}

static void data_of_the_converter_that_stick(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats();
    unsigned number;
    up(&rig, &p, 3.0);
    rig_readings(&rig, 10);
    const struct board_part *adc = part("adc", &number);
    assert_int_equal(adc->faults, BOARD_FAULT_DOUT);
    for (int level = 0; level <= 1; level++) {
        adc->fault(&rig.b.base, number, &(struct chip_fault){.dout = level ? CHIP_STUCK_HIGH : CHIP_STUCK_LOW},
                   rig.s.now_ns);
        rig_readings(&rig, 20 + 10 * (unsigned)level);
        for (unsigned i = 0; i < 4; i++) assert_int_equal(rig.reading[rig.readings - 1].code[i], -level);
    }
    adc->fault(&rig.b.base, number, &(struct chip_fault){.dout = CHIP_FREE}, rig.s.now_ns);
    rig_readings(&rig, 40);
    assert_true(rig.reading[39].code[1] != -1 && rig.reading[39].code[1] != 0);
}

static void a_bit_of_the_rom(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats();
    unsigned number;
    up(&rig, &p, 0.0);
    const struct board_part *rom = part("rom", &number);
    assert_int_equal(rom->registers, 2 * PMKA_ROM_WORDS);
    const uint16_t w5 = rig.b.rom[5];
    assert_true(rom->flip(&rig.b.base, number, 11, 0x81, 0));
    assert_int_equal(rig.b.rom[5], w5 ^ 0x8100);
    assert_true(rom->flip(&rig.b.base, number, 10, 0x02, 0));
    assert_int_equal(rig.b.rom[5], w5 ^ 0x8102);
    pmka_board.power_down(&rig.b.base, 0);
    pmka_board.power_up(&rig.b.base, 0);
    assert_int_equal(rig.b.rom[5], w5 ^ 0x8102);
}

/* Res: the integrators go on with what they have, all else begins again. */
static void res(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats();
    up(&rig, &p, 1.0);
    rig_readings(&rig, 40);
    while (rig.b.channel[3].axis < 0) rig_run(&rig, 1000000);
    const int64_t t_ns = rig.s.now_ns;
    const unsigned before = rig.readings;
    const double charge_c = rig.b.channel[1].integrator.charge_c;
    assert_true(fabs(charge_c) > 1e-8);
    pmka_board.reset(&rig.b.base, t_ns);
    assert_false(pmka_board.ready(&rig.b.base));
    assert_int_equal(rig.events[PMKA_EV_RES], 1);
    assert_int_equal(rig.b.counters.res, 1);
    for (unsigned i = 0; i < 3; i++) assert_int_equal(rig.b.channel[i].axis, i);
    assert_int_equal(rig.b.channel[3].axis, -1);
    rig_readings(&rig, before + 1);
    const struct pmka_reading *r = &rig.reading[before];
    assert_int_equal(r->seq, 0);
    assert_int_equal(r->t_ns, t_ns + 10000000);
    assert_int_equal(r->tau, 0);
    near(r->code[1], (charge_c + 1.0 * 10.1e-3 / 20e3) / 0.47e-6 * 3276.8, 0.3 / 20e3 / 0.47 * 3276.8 + 2000.0);
    for (unsigned i = 0; i < 4; i++) assert_int_equal(r->reset[i] + r->serves[i], 0);
}

/* A precision reset that Res meets ends there: what it has drawn it has drawn. */
static void res_cuts_a_reset(void **state)
{
    (void)state;
    struct pmka_profile p = rig_ideal();
    p.rotation = PMKA_PROGRAM;
    up(&rig, &p, 1.0);
    while (!rig.b.channel[0].resetting) rig_run(&rig, 100000);
    const int16_t was = rig.b.next.code[0];
    const int64_t t_ns = rig.b.channel[0].reset_from_ns + 1200000;
    rig_run(&rig, t_ns - rig.s.now_ns);
    assert_true(rig.b.base.trace.level >> PMKA_LINE_RP1 & 1);
    assert_true(rig.b.channel[0].count[0] > 0);
    const unsigned before = rig.readings;
    pmka_board.reset(&rig.b.base, t_ns);
    assert_false(rig.b.base.trace.level >> PMKA_LINE_RP1 & 1);
    assert_int_equal(rig.b.channel[0].count[0], 0);
    rig_readings(&rig, before + 2);
    const struct pmka_reading *r = &rig.reading[rig.readings - 2];
    assert_int_equal(r->seq, 0);
    near(r->code[0], was + (1.0 * 11.2 - 20.0 * 1.2) * 1e-3 / 20e3 / 0.47e-6 * 3276.8, 1.5);
    assert_int_equal(rig.reading[rig.readings - 1].reset[0], 0);
}

/* What goes wrong in the middle of a period goes wrong from there on. */
static void a_fault_has_its_instant(void **state)
{
    (void)state;
    struct pmka_profile p = rig_ideal();
    p.rotation = PMKA_PROGRAM;
    up(&rig, &p, 0.0);
    rig_readings(&rig, 3);
    sched_run_until(&rig.s, rig.reading[2].t_ns + 3600000);
    pmka_set_faults(&rig.b, PMKA_FAULT_STUCK_RESET);
    rig_readings(&rig, 4);
    near(rig.reading[3].code[0], -20.0 * 1.2e-3 / 20e3 / 0.47e-6 * 3276.8, 1.0);
}

/* The capacitors are empty and shorted until the first sampling instant. */
static void power(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats();
    up(&rig, &p, 5.0);
    rig_readings(&rig, 33);
    pmka_board.power_down(&rig.b.base, rig.s.now_ns);
    assert_int_equal(rig.events[PMKA_EV_POWER_DOWN], 1);
    rig_run(&rig, 50000000);
    assert_int_equal(rig.readings, 33);
    pmka_board.sample_until(&rig.b.base, rig.s.now_ns);
    pmka_board.reset(&rig.b.base, rig.s.now_ns); /* nothing */
    assert_int_equal(rig.b.counters.res, 0);
    pmka_board.power_up(&rig.b.base, rig.s.now_ns);
    pmka_board.power_up(&rig.b.base, rig.s.now_ns);
    assert_int_equal(rig.events[PMKA_EV_POWER_UP], 2);
    rig_readings(&rig, 35);
    assert_int_equal(rig.reading[33].seq, 0);
    assert_int_equal(rig.reading[33].code[0], 0);
    near(rig.reading[33].code[1], 5.0 * 1e-4 / 20e3 / 0.47e-6 * 3276.8, 1.0); /* 100 us after the first instant */
    near(rig.reading[34].code[0], 5.0 * 4.8e-3 / 20e3 / 0.47e-6 * 3276.8, 1.0);
}

/* More than 10 V for long: the resets do not follow, the amplifier ends at 12 V, the converter at 10 V. */
static void more_than_full_scale(void **state)
{
    (void)state;
    struct pmka_profile p = rig_ideal();
    p.rotation = PMKA_PROGRAM;
    for (int sign = -1; sign <= 1; sign += 2) {
        up(&rig, &p, 10.4 * sign);
        rig_readings(&rig, 22);
        assert_int_equal(rig.b.counters.clips + rig.b.counters.saturations, 0);
        rig_readings(&rig, 30);
        assert_true(rig.reading[29].clipped[1]);
        assert_false(rig.reading[29].saturated[1]);
        assert_int_equal(rig.reading[29].code[1], sign > 0 ? 32767 : -32768);
        rig_readings(&rig, 60);
        for (unsigned i = 0; i < 3; i++) assert_true(rig.reading[59].saturated[i] && rig.reading[59].clipped[i]);
        assert_false(rig.reading[59].saturated[3] || rig.reading[59].clipped[3]);
        for (unsigned a = 0; a < 3; a++) rig.input[a].mean_v = 0.0;
        rig_readings(&rig, 62);
        const double left_v = 12.0 - 2 * 5.1064; /* what was beyond the limit is gone: two resets lead back */
        near(rig.reading[61].code[1] * sign, left_v / 10 * 32768, 1.0);
    }
}

/* Who changes the physics says so before: up to then the old input counts, though no one has sampled. */
static void the_input_may_change_abruptly(void **state)
{
    (void)state;
    struct pmka_profile p = rig_ideal();
    p.rotation = PMKA_PROGRAM;
    up(&rig, &p, 1.0);
    rig_readings(&rig, 2);
    const int64_t t_ns = rig.reading[1].t_ns + 3456789;
    sched_run_until(&rig.s, t_ns);
    pmka_board.sample_until(&rig.b.base, t_ns);
    for (unsigned a = 0; a < 3; a++) rig.input[a].mean_v = -1.0;
    rig_readings(&rig, 3);
    const double want_vs = 3456.789e-6 - (4800e-6 - 3456.789e-6);
    near(rig.reading[2].code[0] - rig.reading[1].code[0], want_vs / 20e3 / 0.47e-6 * 3276.8, 1.0);
    near(rig.b.axis[0].integral_vs, 4.8e-3 + want_vs, 1e-9);
}

static void hex_of(const struct rig *r, char hex[SHA256_HEX])
{
    struct sha256 s;
    sha256_init(&s);
    pmka_board.digest(&r->b.base, &s);
    sha256_hex(&s, hex);
}

/* Anything that a later reading depends on shows in the digest. */
static void the_digest_sees_everything(void **state)
{
    (void)state;
    const struct pmka_profile p = rig_profile();
    char hex[2][SHA256_HEX];
    up(&rig, &p, 2.0);
    rig_readings(&rig, 300);
    hex_of(&rig, hex[0]);
    struct pmka *b = &rig.b;
#define SHOWS(change, back)                                                                                            \
    do {                                                                                                               \
        change;                                                                                                        \
        hex_of(&rig, hex[1]);                                                                                          \
        assert_string_not_equal(hex[0], hex[1]);                                                                       \
        back;                                                                                                          \
        hex_of(&rig, hex[1]);                                                                                          \
        assert_string_equal(hex[0], hex[1]);                                                                           \
    } while (0)
    const double charge_c = b->channel[3].integrator.charge_c;
    SHOWS(b->channel[3].integrator.charge_c = charge_c + 1e-20, b->channel[3].integrator.charge_c = charge_c);
    SHOWS(b->channel[2].at_ns++, b->channel[2].at_ns--);
    SHOWS(b->channel[0].count[0]++, b->channel[0].count[0]--);
    SHOWS(b->axis[1].at_ns++, b->axis[1].at_ns--);
    SHOWS(b->rotation.age++, b->rotation.age--);
    SHOWS(b->rotation.beat_periods++, b->rotation.beat_periods--);
    SHOWS(b->rom[40] ^= 1, b->rom[40] ^= 1);
    SHOWS(b->base.faults ^= 4, b->base.faults ^= 4);
    SHOWS(b->bus.index++, b->bus.index--);
    SHOWS(b->adc_noise.key++, b->adc_noise.key--);
    SHOWS(b->temp_noise.key++, b->temp_noise.key--);
    SHOWS(b->counters.handovers++, b->counters.handovers--);
    SHOWS(b->latest.code[2]++, b->latest.code[2]--);
    SHOWS(b->adc_stuck = true, b->adc_stuck = false);
}

static unsigned truths;
static double truth_of_uref, truth_of_integral, truth_of_ct;

static void on_truth(void *ctx, const char *name, double value)
{
    (void)ctx;
    truths++;
    if (strcmp(name, "uref_v") == 0) truth_of_uref = value;
    if (strcmp(name, "axis_y_integral_vs") == 0) truth_of_integral = value;
    if (strcmp(name, "integrator_k_ct_minus") == 0) truth_of_ct = value;
}

static void the_truth(void **state)
{
    (void)state;
    const struct pmka_profile p = rig_profile();
    up(&rig, &p, 2.0);
    rig_readings(&rig, 101);
    pmka_board.sample_until(&rig.b.base, rig.s.now_ns);
    pmka_board.truth(&rig.b.base, on_truth, NULL);
    assert_int_equal(truths, 5 + 4 * 9 + 3);
    near(truth_of_uref, rig.b.specimen.uref_v, 0.0);
    near(truth_of_integral, 2.0 * 1e-9 * (double)(rig.s.now_ns - 10000000), 1e-9);
    const struct pmka_int_cfg *k = &rig.b.channel[3].integrator.cfg;
    near(truth_of_ct, rig.b.specimen.uref_v / 10.0 * k->r_in_ohm / (2.0 * k->rr_ohm[PMKA_MINUS]), 1e-12);
}

/* Two specimens differ, the same seed and serial number give the same one. */
static void specimens(void **state)
{
    (void)state;
    const struct pmka_profile p = rig_profile();
    rig_init(&rig, &p);
    rig_init(&other, &p);
    assert_memory_equal(rig.b.rom, other.b.rom, sizeof rig.b.rom);
    struct board_cfg cfg = rig_cfg();
    const struct board_io io = {.ctx = &other, .accel = rig_accel_row, .temp_degc = rig_degc};
    cfg.serial++;
    pmka_board.init(&other.b.base, &p, &cfg, &io, &other.s);
    unsigned same = 0;
    for (unsigned w = 6; w < PMKA_ROM_WORDS; w++) same += rig.b.rom[w] == other.b.rom[w];
    assert_true(same < 8);
}

/* The zero of an integrator at work and at rest alike; by temperature. */
static void the_zero(void **state)
{
    (void)state;
    struct pmka_profile p = rig_ideal();
    p.zero_sd_v = 100e-6;
    p.zero_tc_sd_v_per_k = 1e-6;
    rig_init(&rig, &p);
    rig.degc = 65.0;
    pmka_board.power_up(&rig.b.base, 0);
    rig_readings(&rig, 1001);
    for (unsigned i = 0; i < 4; i++) {
        const struct pmka_int_cfg *c = &rig.b.channel[i].integrator.cfg;
        const double want_v = c->zero_v + 40.0 * c->zero_tc_v_per_k;
        double resets = 0;
        for (unsigned k = 1; k <= 1000; k++) resets += rig.reading[k].reset[i];
        const double codes = rig.reading[1000].code[i] - rig.reading[0].code[i] + resets * 16732.5957446809;
        near(codes, want_v * 4.8 / 20e3 / 0.47e-6 * 3276.8, 1.1);
        assert_true(fabs(want_v) > 5e-6);
    }
}

/* The capacitor at the temperature of the period: Nr follows. */
static void the_board_warms_up(void **state)
{
    (void)state;
    struct pmka_profile p = short_beats();
    p.cap_tc_ppm_per_k = -1000.0;
    rig_init(&rig, &p);
    rig.degc_per_s = 10.0;
    pmka_board.power_up(&rig.b.base, 0);
    rig_readings(&rig, 1000);
    for (unsigned k = 900; k < 1000; k++) {
        const struct pmka_reading *r = &rig.reading[k];
        if (r->cal != PMKA_CAL_RESET || r->serves[3] || r->tau == 5) continue;
        const double warmer_k = 10.0 * 1e-9 * (double)r->t_ns, nr = 16732.6 / (1.0 - 1e-3 * warmer_k);
        near(abs(r->code[3] - rig.reading[k - 1].code[3]), nr, 5.0);
    }
    near(rig.b.channel[1].integrator.cap_f, 0.47e-6 * (1.0 - 1e-2 * 1e-9 * (double)rig.reading[999].t_ns), 1e-12);
}

static void the_thermometer(void **state)
{
    (void)state;
    const struct pmka_profile p = rig_profile();
    rig_init(&rig, &p);
    rig.degc = -17.25;
    pmka_board.power_up(&rig.b.base, 0);
    rig_readings(&rig, 200);
    double sum = 0.0, square = 0.0;
    for (unsigned k = 0; k < 200; k++) {
        const double degc = rig.reading[k].temp_code / 128.0;
        sum += degc / 200;
        square += degc * degc / 200;
    }
    near(sum, -17.25 + rig.b.specimen.temp_offset_k, 0.005);
    near(sqrt(square - sum * sum), 0.02, 0.004);
    assert_true(fabs(rig.b.specimen.temp_offset_k) > 0.001);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_capacitor_that_has_lost_some),
        cmocka_unit_test(a_reset_that_sticks),
        cmocka_unit_test(a_key_that_sticks),
        cmocka_unit_test(words_that_freeze),
        cmocka_unit_test(data_of_the_converter_that_stick),
        cmocka_unit_test(a_bit_of_the_rom),
        cmocka_unit_test(res),
        cmocka_unit_test(res_cuts_a_reset),
        cmocka_unit_test(a_fault_has_its_instant),
        cmocka_unit_test(power),
        cmocka_unit_test(more_than_full_scale),
        cmocka_unit_test(the_input_may_change_abruptly),
        cmocka_unit_test(the_digest_sees_everything),
        cmocka_unit_test(the_truth),
        cmocka_unit_test(specimens),
        cmocka_unit_test(the_zero),
        cmocka_unit_test(the_thermometer),
        cmocka_unit_test(the_board_warms_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

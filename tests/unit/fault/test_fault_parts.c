/* The fault engine: what is accepted reaches the part it is for. */
#include "fault_rig.h"

#include "fault/scpi.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

/* 2.5 V at rest (the x axis is horizontal); a bias of 1 V makes 3.5 V: 10 V are 2^23 codes. */
static void a_bias_is_in_the_codes(void **state)
{
    (void)state;
    run_to(400 * MS);
    const double before_v = (double)r.frame.code[0] * 10.0 / 8388608.0;
    add("{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1}");
    run_to(600 * MS);
    const double after_v = (double)r.frame.code[0] * 10.0 / 8388608.0;
    if (fabs(after_v - before_v - 1.0) > 1e-3) fail_msg("%g V became %g V", before_v, after_v);
}

/* What the faults of X make of an output of 0. */
static double faulty_out(const struct unit *u, int64_t t_ns)
{
    double out = 0.0;
    sensor_fault_row(u->sensor_faults[0], &(struct looks){&t_ns, 1, 31250}, &out);
    return out;
}

/* Volts of the arguments are volts at the load. */
static void volts_of_a_current_sensor_are_those_at_its_load(void **state)
{
    (void)state;
    add("{'kind':'sensor.stuck','point':'b.sensor.x','out_v':5}");
    const double signal = faulty_out(&r.unit[1], 1);
    if (fabs(signal - 5e-3) > 1e-15) fail_msg("%g A", signal);
}

/* Each chip has its own faults; those of one add up, and the first to end leaves the other. */
static void faults_of_a_chip_add_up(void **state)
{
    (void)state;
    run_to(400 * MS);
    add("{'kind':'chip.dout_dead','point':'a.adc.x','level':'high','for_s':0.1}");
    add("{'kind':'chip.dout_dead','point':'a.adc.z','level':'low','for_s':0.2}");
    add("{'kind':'chip.lost_sync','point':'a.adc.x','at_s':0.41}");
    add("{'kind':'controller.frozen_words','point':'a.kpsa','at_s':0.45,'for_s':0.1}");
    run_to(440 * MS);
    assert_int_equal(r.frame.code[0], -1);
    assert_int_equal(r.frame.code[2], 0);
    run_to(540 * MS);
    assert_int_equal(r.frame.code[0], -1); /* frozen, though the pin is well again */
    assert_true(((struct psa2 *)r.unit[0].board)->adc[0].fault.lost_sync);
    run_to(590 * MS);
    assert_true(r.frame.code[0] > 2000000);
    assert_int_equal(r.changes, 6);
}

/* Two that begin together end apart; one for which the supply is too high by then does nothing, and says so. */
static void brownouts_are_those_that_were_asked_for(void **state)
{
    (void)state;
    add("{'kind':'supply.brownout','point':'supply','drop_v':5,'for_s':0.01,'at_s':0.1}");
    add("{'kind':'supply.brownout','point':'supply','drop_v':50,'for_s':0.1,'at_s':0.1}");
    const uint32_t late = add("{'kind':'supply.brownout','point':'supply','drop_v':4,'for_s':0.1,'at_s':0.3}");
    run_to(120 * MS);
    assert_true(supply_volts(&r.lab.supply, 120 * MS) == 0.0);
    run_to(201 * MS);
    assert_true(supply_volts(&r.lab.supply, 201 * MS) == 12.0);
    supply_set(&r.lab.supply, 15.0, 201 * MS);
    run_to(301 * MS);
    assert_change(4, late, FAULT_VOID, 300 * MS);
}

/* As many as there can be faults: none is accepted and then void for want of room. */
static void any_number_of_brownouts_may_be_under_way_at_once(void **state)
{
    (void)state;
    r.engine.changed = NULL;
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        assert_int_equal(add("{'kind':'supply.brownout','point':'supply','drop_v':5,'for_s':0.1,'at_s':0.1}"), i + 1);
    }
    run_to(150 * MS);
    for (uint32_t id = 1; id <= FAULTS_MAX; id++) {
        if (fault_find(&r.engine, id)->state != FAULT_ACTIVE) fail_msg("%u of them are under way", id - 1);
    }
    run_to(201 * MS);
    assert_true(supply_volts(&r.lab.supply, 201 * MS) == 12.0);
}

/* 1 K/s from 25 degC: two that halve it make a quarter, errors of the thermometer add up; then everything is as before. */
static void faults_of_the_chamber_add_up_and_end(void **state)
{
    (void)state;
    struct chamber_cfg cfg = chamber_default();
    cfg.present = true;
    cfg.heating_max_k_per_min = cfg.ramp_k_per_min = 60.0;
    chamber_init(&r.lab.chamber, &cfg);
    run_to(100 * MS);
    assert_int_equal(chamber_set(&r.lab.chamber, 85.0, 100 * MS), CHAMBER_OK);
    add("{'kind':'chamber.slow','point':'chamber','rate_part':0.5,'at_s':0.1,'for_s':0.4}");
    add("{'kind':'chamber.slow','point':'chamber','rate_part':0.5,'at_s':0.3,'for_s':0.2}");
    add("{'kind':'chamber.readout','point':'chamber','readout_k':3,'at_s':0.1,'for_s':0.4}");
    add("{'kind':'chamber.readout','point':'chamber','readout_k':-1,'at_s':0.3,'for_s':0.2}");
    static const struct {
        int64_t t_ms;
        double air_degc, off_k;
    } rows[] = {{290, 25.095, 3}, {490, 25.1475, 2}, {600, 25.25, 0}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        const int64_t t_ns = rows[i].t_ms * MS;
        run_to(t_ns);
        const double air_degc = chamber_air_degc(&r.lab.chamber, t_ns);
        if (fabs(air_degc - rows[i].air_degc) > 1e-9) fail_msg("%.9g degC at %" PRId64 " ms", air_degc, rows[i].t_ms);
        assert_true(fabs(chamber_shown_degc(&r.lab.chamber, t_ns) - air_degc - rows[i].off_k) < 1e-9);
    }
}

/* 1 K/s and 1 V/K; the ramp is held in the midst of a reading whose inputs were, or were not, taken until then. Code of X after
 * it. */
static int32_t code_of_a_held_ramp(int64_t held_ns, bool taken)
{
    void *none = NULL;
    struct chamber_cfg cfg = chamber_default();
    fresh(&none);
    r.engine.changed = NULL;
    cfg.present = true;
    cfg.heating_max_k_per_min = cfg.ramp_k_per_min = 60.0;
    chamber_init(&r.lab.chamber, &cfg);
    chamber_put_in(&r.lab.chamber, &r.unit[0].body, 1e-3, 1e-3);
    r.unit[0].mems[0].cfg.u0_tc_v_per_k = 1.0;
    run_to(100 * MS);
    assert_int_equal(chamber_set(&r.lab.chamber, 85.0, 100 * MS), CHAMBER_OK);
    run_to(held_ns);
    if (taken) unit_sample_until(&r.unit[0], held_ns);
    assert_true(add("{'kind':'chamber.slow','point':'chamber','rate_part':1e-6}") != 0);
    run_to(held_ns + 36 * MS); /* the delay of the filter */
    return r.frame.code[0];
}

static void what_was_felt_before_a_fault_of_the_chamber_stays(void **state)
{
    (void)state;
    for (int64_t held_ns = 310 * MS + 50000; held_ns < 311 * MS; held_ns += 150000)
        assert_int_equal(code_of_a_held_ramp(held_ns, false), code_of_a_held_ramp(held_ns, true));
}

/* 1 K/s from 25 to 35 degC: 2 K and 1 K past it, then back; without them no farther. */
static void overshoots_of_the_chamber_add_up_and_end(void **state)
{
    (void)state;
    struct chamber_cfg cfg = chamber_default();
    cfg.present = true;
    cfg.heating_max_k_per_min = cfg.cooling_max_k_per_min = cfg.ramp_k_per_min = 6000.0;
    chamber_init(&r.lab.chamber, &cfg);
    run_to(100 * MS);
    add("{'kind':'chamber.overshoot','point':'chamber','overshoot_k':2,'for_s':0.3}");
    add("{'kind':'chamber.overshoot','point':'chamber','overshoot_k':1,'for_s':0.3}");
    assert_int_equal(chamber_set(&r.lab.chamber, 35.0, 100 * MS), CHAMBER_OK);
    static const struct {
        int64_t t_ms;
        double air_degc;
    } rows[] = {{200, 35}, {220, 37}, {230, 38}, {240, 37}, {260, 35}, {390, 35}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        run_to(rows[i].t_ms * MS);
        assert_true(fabs(chamber_air_degc(&r.lab.chamber, rows[i].t_ms * MS) - rows[i].air_degc) < 1e-9);
    }
    run_to(410 * MS);
    assert_int_equal(chamber_set(&r.lab.chamber, 25.0, 410 * MS), CHAMBER_OK);
    assert_true(fabs(chamber_air_degc(&r.lab.chamber, 515 * MS) - 25.0) < 1e-9);
}

static double true_deg(int64_t t_ms)
{
    return head_angle_rad(&r.lab.head, t_ms * MS) * 57.29577951308232;
}

/* In the middle of a turn, and for the next one; afterwards it turns again. The scale tells. */
static void a_head_that_sticks_stays_where_it_is(void **state)
{
    (void)state;
    r.lab.head.cfg.turn_s = 0.1;
    head_turn(&r.lab.head, 40.0, 0);
    run_to(50 * MS);
    add("{'kind':'head.stick','point':'head','for_s':0.3}");
    assert_true(fabs(true_deg(50) - 20.0) < 1e-9 && head_at_rest(&r.lab.head, 50 * MS));
    run_to(120 * MS);
    head_turn(&r.lab.head, 90.0, 120 * MS);
    assert_false(head_at_rest(&r.lab.head, 150 * MS));
    assert_true(fabs(true_deg(200) - 20.0) < 1e-9 && head_at_rest(&r.lab.head, 220 * MS));
    assert_true(fabs(head_read_deg(&r.lab.head, 230 * MS) - 20.0) < 1e-9);
    run_to(400 * MS);
    head_turn(&r.lab.head, 90.0, 400 * MS);
    assert_true(fabs(true_deg(500) - 90.0) < 1e-9);
    assert_true(fabs(head_read_deg(&r.lab.head, 500 * MS) - 90.0) < 1e-9);
}

/* 0.5 and 0.25 deg short of each turn, one after another, whichever way; the scale tells nothing. Then it is made good. */
static void a_head_that_slips_is_short_of_its_scale(void **state)
{
    (void)state;
    r.lab.head.cfg.turn_s = 0.01;
    add("{'kind':'head.slip','point':'head','slip_deg':0.5,'for_s':0.25}");
    add("{'kind':'head.slip','point':'head','slip_deg':0.25,'for_s':0.15}");
    static const struct {
        int64_t t_ms;
        double set_deg, is_deg;
    } rows[] = {{10, 90, 89.25}, {110, 180, 178.5}, {210, 170, 169.0}, {310, 90, 90}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        const int64_t t_ms = rows[i].t_ms;
        run_to(t_ms * MS);
        const double was_deg = true_deg(t_ms), shown_deg = head_read_deg(&r.lab.head, t_ms * MS);
        head_turn(&r.lab.head, rows[i].set_deg, t_ms * MS);
        assert_true(fabs(true_deg(t_ms) - was_deg) < 1e-9);
        assert_true(fabs(head_read_deg(&r.lab.head, t_ms * MS) - shown_deg) < 1e-9);
        if (fabs(true_deg(t_ms + 10) - rows[i].is_deg) > 1e-9) fail_msg("%zu: %.9g", i, true_deg(t_ms + 10));
        assert_true(fabs(head_read_deg(&r.lab.head, (t_ms + 10) * MS) - rows[i].set_deg) < 1e-9);
    }
}

/* Each link for itself; delays add up; of ten answers at 0.5 some are garbled and some are not, in one byte each. */
static void faults_of_a_link_are_those_of_its_instrument(void **state)
{
    (void)state;
    add("{'kind':'scpi.silent','point':'scpi.supply','at_s':0.1,'for_s':0.1}");
    add("{'kind':'scpi.late','point':'scpi.head','late_s':2}");
    add("{'kind':'scpi.late','point':'scpi.head','late_s':0.5}");
    add("{'kind':'scpi.garbled','point':'scpi.head','probability':0.5}");
    assert_false(fault_scpi_of(&r.engine, "supply").silent);
    run_to(150 * MS);
    const struct fault_scpi supply = fault_scpi_of(&r.engine, "supply"), head = fault_scpi_of(&r.engine, "head");
    assert_true(supply.silent && supply.late_ns == 0 && !supply.garbles);
    assert_true(!head.silent && head.late_ns == 2500 * MS && head.garbles);
    unsigned hit = 0;
    for (unsigned i = 0; i < 20; i++) {
        char text[] = "12.5", is[] = "12.5";
        fault_scpi_garble(&head, text, 4);
        unsigned bytes = 0;
        for (unsigned k = 0; k < 4; k++) bytes += text[k] != is[k] && (text[k] ^ is[k]) == (char)0x80;
        assert_true(bytes <= 1);
        hit += bytes;
        fault_scpi_garble(&supply, text, 4);
    }
    assert_in_range(hit, 3, 17);
    run_to(250 * MS);
    assert_false(fault_scpi_of(&r.engine, "supply").silent);
    assert_false(fault_scpi_of(NULL, "head").silent);
}

/* Two sines in the rate of one axis, one in another; angle and acceleration belong to the rate. */
static void ripples_of_a_table_add_up_and_end(void **state)
{
    (void)state;
    const double deg = 0.017453292519943295, pi2 = 6.283185307179586;
    const struct table_cfg cfg = table_default(2);
    table_init(&r.lab.table, &cfg, &r.lab.site, 1);
    run_to(100 * MS);
    add("{'kind':'table.ripple','point':'table.1','ripple_dps':2,'frequency_hz':4,'for_s':0.5}");
    add("{'kind':'table.ripple','point':'table.1','ripple_dps':1,'frequency_hz':10,'for_s':0.3}");
    add("{'kind':'table.ripple','point':'table.2','ripple_dps':3,'frequency_hz':1}");
    run_to(130 * MS);
    const struct motion_state s = table_axis(&r.lab.table, 0, 130 * MS), other = table_axis(&r.lab.table, 1, 130 * MS);
    const double a = pi2 * 4 * 0.03, b = pi2 * 10 * 0.03;
    assert_true(fabs(s.rate_radps / deg - 2 * sin(a) - sin(b)) < 1e-9);
    assert_true(fabs(s.angle_rad / deg - 2 * (1 - cos(a)) / (pi2 * 4) - (1 - cos(b)) / (pi2 * 10)) < 1e-9);
    assert_true(fabs(s.accel_radps2 / deg - 2 * pi2 * 4 * cos(a) - pi2 * 10 * cos(b)) < 1e-9);
    assert_true(fabs(other.rate_radps / deg - 3 * sin(pi2 * 0.03)) < 1e-9);
    assert_true(fabs(table_read(&r.lab.table, 0, 130 * MS).rate_dps - s.rate_radps / deg) < 1e-12);
    const struct pose p = *table_pose(&r.lab.table, 130 * MS);
    assert_true(fabs(p.w_ib_b_radps[1] - s.rate_radps) < 0.01 * fabs(s.rate_radps)); /* y carries z, which is near 0 */
    assert_int_equal(table_zero(&r.lab.table, 0, 30.0, 130 * MS), MOTION_OK);
    assert_true(fabs(table_read(&r.lab.table, 0, 130 * MS).angle_deg - 30.0) < 0.001); /* as without ripple */
    run_to(500 * MS);
    assert_true(fabs(table_axis(&r.lab.table, 0, 500 * MS).rate_radps / deg - 2 * sin(pi2 * 4 * 0.4)) < 1e-9);
    run_to(601 * MS);
    assert_true(table_axis(&r.lab.table, 0, 601 * MS).rate_radps == 0.0);
    assert_true(table_axis(&r.lab.table, 1, 601 * MS).rate_radps != 0.0);
}

/* Registers without power hold nothing. */
static void a_flip_in_a_board_without_power_is_void(void **state)
{
    static const char *const args[] = {"{'kind':'chip.flip','point':'b.adc.z','register':2,'mask':1}",
                                       "{'kind':'chip.flip','point':'b.tadc','register':2,'mask':1}"};
    (void)state;
    run_to(400 * MS);
    psa2_power_down(&r.unit[1].store.psa2, r.s.now_ns);
    for (size_t i = 0; i < COUNT(args); i++) {
        const uint32_t id = add(args[i]);
        assert_true(id != 0);
        assert_int_equal(fault_find(&r.engine, id)->state, FAULT_VOID);
    }
}

/* Two microvolts at the load are more than a code of 1.19 uV: of all codes of a quiet channel none stays. */
static void the_least_bias_is_seen(void **state)
{
    (void)state;
    run_to(400 * MS);
    const int32_t before = r.frame.code[0];
    assert_true(add("{'kind':'sensor.bias','point':'a.sensor.x','bias_v':2e-6}") != 0);
    run_to(600 * MS);
    assert_true(r.frame.code[0] > before);
    assert_true(r.frame.code[0] <= before + 2);
}

static void what_is_over_at_once_needs_no_lifting(void **state)
{
    (void)state;
    run_to(400 * MS);
    const uint32_t flip = add("{'kind':'chip.flip','point':'a.adc.y','register':2,'mask':1}");
    const uint32_t glitch = add("{'kind':'line.glitch','point':'a.line.Int','width_ns':100,'at_s':0.41}");
    run_to(420 * MS);
    assert_change(0, flip, FAULT_ACTIVE, 400 * MS);
    assert_change(1, flip, FAULT_OVER, 400 * MS);
    assert_change(2, glitch, FAULT_ACTIVE, 410 * MS);
    assert_change(3, glitch, FAULT_OVER, 410 * MS);
}

/* Same number, same noise; another number, another one. */
static void random_faults_are_seeded_by_their_number(void **state)
{
    double out[3];
    for (int i = 0; i < 3; i++) {
        fresh(state);
        if (i == 2) add("{'kind':'controller.frozen_words','point':'b.kpsa'}");
        assert_int_equal(add("{'kind':'sensor.noise','point':'a.sensor.x','rms_v':0.1}"), i == 2 ? 2 : 1);
        out[i] = faulty_out(&r.unit[0], 1);
    }
    assert_true(out[0] == out[1]);
    assert_true(out[0] != out[2]);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup(name, fresh)
    const struct CMUnitTest tests[] = {
        TEST(any_number_of_brownouts_may_be_under_way_at_once),
        TEST(a_flip_in_a_board_without_power_is_void),
        TEST(the_least_bias_is_seen),
        TEST(brownouts_are_those_that_were_asked_for),
        TEST(a_bias_is_in_the_codes),
        TEST(faults_of_the_chamber_add_up_and_end),
        TEST(what_was_felt_before_a_fault_of_the_chamber_stays),
        TEST(ripples_of_a_table_add_up_and_end),
        TEST(volts_of_a_current_sensor_are_those_at_its_load),
        TEST(faults_of_a_chip_add_up),
        TEST(what_is_over_at_once_needs_no_lifting),
        TEST(random_faults_are_seeded_by_their_number),
        TEST(overshoots_of_the_chamber_add_up_and_end),
        TEST(a_head_that_sticks_stays_where_it_is),
        TEST(a_head_that_slips_is_short_of_its_scale),
        TEST(faults_of_a_link_are_those_of_its_instrument),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

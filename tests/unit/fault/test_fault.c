/* The fault engine: when faults begin and end, and what is refused. */
#include "fault_rig.h"

#include <math.h>
#include <string.h>

/* ---- when */

static void a_trigger_counts_anew_from_each_event_it_counts_from(void **state)
{
    (void)state;
    const struct {
        int after, since;
        unsigned count;
        const char *events; /* a letter each, a = 0 */
        int at;             /* index of the one that it is; -1: none */
    } rows[] = {
        {1, FAULT_NO_EVENT, 1, "aab", 2},  {1, FAULT_NO_EVENT, 3, "babab", 4},
        {1, FAULT_NO_EVENT, 3, "bab", -1}, {1, 0, 1, "bbab", 3},
        {1, 0, 3, "bbbabb", -1},           {1, 0, 3, "abbabbb", 6},
        {1, 0, 2, "abcabcbcbb", 6},        {0, FAULT_NO_EVENT, 2, "cbaca", 4},
    };
    for (size_t k = 0; k < COUNT(rows); k++) {
        struct fault_trigger t = fault_trigger(rows[k].after, rows[k].since, rows[k].count);
        int at = -1;
        for (int i = 0; at < 0 && rows[k].events[i]; i++) {
            if (fault_trigger_event(&t, rows[k].events[i] - 'a')) at = i;
        }
        if (at != rows[k].at) fail_msg("row %zu: at %d, want %d", k, at, rows[k].at);
    }
}

static void a_fault_begins_and_ends_at_its_instants(void **state)
{
    (void)state;
    const uint32_t id = add("{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'at_s':0.25,'for_s':0.05}");
    run_to(400 * MS);
    assert_int_equal(id, 1);
    assert_int_equal(r.changes, 2);
    assert_change(0, id, FAULT_ACTIVE, 250 * MS);
    assert_change(1, id, FAULT_OVER, 300 * MS);
    assert_null(r.unit[0].sensor_faults[0]);
}

static void without_an_instant_it_begins_now_and_lasts_until_it_is_cleared(void **state)
{
    (void)state;
    run_to(100 * MS);
    const uint32_t id = add("{'kind':'sensor.bias','point':'b.sensor.x','bias_v':1}");
    run_to(900 * MS);
    assert_change(0, id, FAULT_ACTIVE, 100 * MS);
    assert_non_null(r.unit[1].sensor_faults[0]);
    fault_clear(&r.engine, fault_find(&r.engine, id), r.s.now_ns);
    assert_change(1, id, FAULT_OVER, 900 * MS);
    assert_null(r.unit[1].sensor_faults[0]);
    assert_null(fault_find(&r.engine, id));
}

/* The article's set-up has one SYNC_A; the third DRD_A after it. */
static void a_fault_begins_with_the_event_it_waits_for(void **state)
{
    (void)state;
    const uint32_t now = add("{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'after':'DRD_A','count':3,"
                             "'since':'SYNC_A','for_s':0.01}");
    const uint32_t later =
        add("{'kind':'controller.frozen_words','point':'a.kpsa','after':'INT_FALL','delay_s':30e-6}");
    assert_true(now && later);
    run_to(400 * MS);
    const int64_t sync_ns = nth_ns(PSA2_EV_SYNC_A, 1, 0);
    const int64_t third_ns = nth_ns(PSA2_EV_DRD_A, 3, sync_ns);
    assert_change(0, later, FAULT_ACTIVE, nth_ns(PSA2_EV_INT_FALL, 1, 0) + 30000);
    assert_change(1, now, FAULT_ACTIVE, third_ns);
    assert_change(2, now, FAULT_OVER, third_ns + 10 * MS);
    assert_int_equal(r.changes, 3);
}

static void events_count_from_the_instant_on(void **state)
{
    (void)state;
    const uint32_t id =
        add("{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'at_s':0.3,'after':'DRD_A','count':2}");
    run_to(400 * MS);
    assert_change(0, id, FAULT_ACTIVE, nth_ns(PSA2_EV_DRD_A, 2, 300 * MS));
}

/* The events are those of the other unit, which is reset at 200 ms. */
static void events_may_be_those_of_another_unit(void **state)
{
    (void)state;
    const uint32_t id =
        add("{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'after':'RES','count':1,'unit':'b'}");
    run_to(200 * MS);
    assert_int_equal(r.changes, 0);
    psa2_reset(&r.unit[0].store.psa2, r.s.now_ns);
    run_to(201 * MS);
    assert_int_equal(r.changes, 0);
    psa2_reset(&r.unit[1].store.psa2, r.s.now_ns);
    run_to(202 * MS);
    assert_change(0, id, FAULT_ACTIVE, 201 * MS);
    assert_null(r.unit[1].observers);
}

/* What happens then, and to which unit, is not known before: none may sleep. */
static void while_a_fault_listens_someone_may_look_at_any_time(void **state)
{
    (void)state;
    const uint32_t id =
        add("{'kind':'sensor.bias','point':'b.sensor.x','bias_v':1,'at_s':0.1,'after':'RES','unit':'a'}");
    assert_int_equal(r.s.any_time, 0);
    run_to(200 * MS);
    assert_int_equal(r.s.any_time, 1);
    psa2_reset(&r.unit[0].store.psa2, r.s.now_ns);
    run_to(202 * MS);
    assert_change(0, id, FAULT_ACTIVE, 200 * MS);
    assert_int_equal(r.s.any_time, 0);
}

static void a_fault_that_waits_or_listens_can_be_cleared(void **state)
{
    (void)state;
    add("{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'at_s':0.3}");
    add("{'kind':'sensor.bias','point':'b.sensor.x','bias_v':1,'after':'DRD_A'}");
    assert_non_null(r.unit[1].observers);
    for (uint32_t id = 1; id <= 2; id++) fault_clear(&r.engine, fault_find(&r.engine, id), r.s.now_ns);
    assert_null(r.unit[1].observers);
    run_to(500 * MS);
    assert_int_equal(r.changes, 0);
}

static void places_are_used_again_but_not_those_of_living_faults(void **state)
{
    (void)state;
    for (unsigned i = 0; i < FAULTS_MAX; i++) { /* the third is over first */
        const char *args = i == 2 ? "{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'at_s':0.01,'for_s':0.005}"
                                  : "{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'at_s':0.01,'for_s':0.01}";
        assert_int_equal(add(args), i + 1);
    }
    assert_int_equal(add("{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1}"), 0);
    assert_non_null(strstr(r.control.error.why, "expected up to 64 faults, waiting or active"));
    r.engine.changed = NULL;
    run_to(30 * MS);
    assert_null(r.unit[0].sensor_faults[0]);
    assert_int_equal(add("{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1}"), FAULTS_MAX + 1);
    assert_null(fault_find(&r.engine, 3));
    assert_non_null(fault_find(&r.engine, 1));
}

/* The second program keeps its number, and its faults, when the first leaves. */
static void a_program_keeps_its_number_when_an_older_one_leaves(void **state)
{
    struct fault_point p;
    char name[FAULT_POINT_MAX];
    (void)state;
    can_attach(&r.bus, &r.program[1]);
    r.came[1] = 2;
    const uint32_t first = add("{'kind':'link.drop','point':'client.1','at_s':0.1}");
    const uint32_t second = add("{'kind':'link.drop','point':'client.2','at_s':0.1}");
    assert_true(first && second);
    can_detach(&r.bus, &r.program[0]);
    r.came[0] = 2;
    r.came[1] = 0;
    assert_true(fault_point_find(&r.view, "client.2", &p, name));
    assert_false(fault_point_find(&r.view, "client.1", &p, name));
    run_to(200 * MS);
    assert_int_equal(fault_find(&r.engine, first)->state, FAULT_VOID);
    assert_int_equal(fault_find(&r.engine, second)->state, FAULT_ACTIVE);
    assert_ptr_equal(fault_find(&r.engine, second)->as.can.to, &r.program[1]);
}

/* ---- what is refused */

static void what_does_not_fit_is_refused_with_the_reason(void **state)
{
    (void)state;
    const struct {
        const char *args, *why;
    } rows[] = {
        {"{'kind':'sensor.bia','point':'a.sensor.x'}", "expected one of sensor.stuck, sensor.bias"},
        {"{'kind':'bias','point':'a.sensor.x'}", "kind: expected a name that fault.kinds lists, got \"bias\""},
        {"{'kind':'sensor.bias','point':'c.sensor.x','bias_v':1}", "point: expected a name that fault.points lists"},
        {"{'kind':'sensor.bias','point':'a.line.INT','bias_v':1}",
         "sensor.bias: expected a point on UNIT.sensor.x|y|z, got a.line.Int, which is a line of a board"},
        {"{'kind':'sensor.bias','point':'a.sensor.x'}", "bias_v: expected a value"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':0}", "bias_v: expected a value other than 0, got 0"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':16}", "expected -15 to -2e-06 or 2e-06 to 15 V"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'rms_v':1}", "rms_v: not an argument of sensor.bias"},
        {"{'kind':'sensor.bias','point':'a.sensor.y','bias_v':1}", "a.sensor.y: the channel has no sensor"},
        {"{'kind':'sensor.saturation','point':'a.sensor.x'}", "expected low_v or high_v"},
        {"{'kind':'sensor.saturation','point':'a.sensor.x','low_v':2,'high_v':2}", "expected less than high_v"},
        {"{'kind':'analog.load_open','point':'a.afe.x'}", "no load resistor"},
        {"{'kind':'analog.reference','point':'a.afe.x'}", "expected reference_ppm other than 0, or drift_ppm_per_s"},
        {"{'kind':'chip.drdy_stuck','point':'a.adc.y','level':'low'}",
         "a.adc.y: DRD_A is the pin of converter X only, this pin is not connected; use adc.x"},
        {"{'kind':'chip.drdy_stuck','point':'a.adc.x','level':'middle'}", "expected one of low, high"},
        {"{'kind':'chip.flip','point':'a.adc.x','register':11,'mask':1}",
         "register: expected 0 to 10 for a.adc.x, got 11"},
        {"{'kind':'chip.flip','point':'a.adc.x','register':1,'mask':1,'for_s':1}", "is instantaneous"},
        {"{'kind':'line.missing_pulse','point':'a.line.Int','pulse':1}", "the line CLK does"},
        {"{'kind':'line.missing_pulse','point':'a.line.CLK','pulse':129}", "expected 1 to 128"},
        {"{'kind':'supply.brownout','point':'supply','drop_v':5}", "for_s: expected a value"},
        {"{'kind':'supply.brownout','point':'supply','drop_v':2,'for_s':1}",
         "not below the threshold of the boards, 9 V"},
        {"{'kind':'chip.clock','point':'a.adc.x','clock_ppm':0.4}", "expected whole ppm"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':-1e-6}",
         "bias_v: expected -15 to -2e-06 or 2e-06 to 15 V, got -1e-06"},
        {"{'kind':'sensor.drift','point':'a.sensor.x','drift_v_per_s':1e-6}",
         "expected -1000 to -2e-06 or 2e-06 to 1000 V/s"},
        {"{'kind':'sensor.drift','point':'a.sensor.x','drift_v_per_s':0.001,'for_s':0.001}",
         "in 0.001 s it comes to 1e-06 V, less than 2e-06 V"},
        {"{'kind':'sensor.scale','point':'a.sensor.x','scale_ppm':-0.9}", "expected -10000000 to -1 or 1 to 10000000"},
        {"{'kind':'sensor.noise','point':'a.sensor.x','rms_v':1e-6}", "expected 2e-06 to 10 V"},
        {"{'kind':'sensor.saturation','point':'a.sensor.x','high_v':10}",
         "high_v: expected a limit within -10 to 10 V"},
        {"{'kind':'sensor.saturation','point':'a.sensor.x','low_v':-12,'high_v':3}", "low_v: expected a limit within"},
        {"{'kind':'sensor.saturation','point':'b.sensor.x','high_v':6}", "high_v: expected a limit within -5 to 5 V"},
        {"{'kind':'analog.reference','point':'a.afe.x','reference_ppm':0.5}", "expected -500000 to -1 or 1 to 1000000"},
        {"{'kind':'analog.reference','point':'a.afe.x','drift_ppm_per_s':0.5}", "expected 1 to 1000000 ppm/s"},
        {"{'kind':'analog.reference','point':'a.afe.x','drift_ppm_per_s':5,'for_s':0.1}",
         "in 0.1 s it comes to 0.5 ppm, less than 1 ppm"},
        {"{'kind':'analog.ripple','point':'a.afe.x','amplitude_v':1e-6,'frequency_hz':1}", "expected 2e-06 to 10 V"},
        {"{'kind':'analog.ripple','point':'a.afe.x','amplitude_v':1,'frequency_hz':101}",
         "frequency_hz: expected 0.1 to 100 Hz (above: a unit with adc_chain: modulator), got 101"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'for_s':1e-10}",
         "for_s: expected 0 or at least 1e-9 s, got 1e-10"},
        {"{'kind':'link.delay','point':'bus.can0','hold_s':1e-10}", "hold_s: expected 0 or at least 1e-9 s, got 1e-10"},
        {"{'kind':'supply.brownout','point':'a.can','drop_v':5,'for_s':1}", "which is the CAN node of a board"},
        {"{'kind':'link.delay','point':'bus.can0'}", "hold_s: expected a value"},
        {"{'kind':'link.stall','point':'client.2'}", "point: expected a name that fault.points lists"},
        {"{'kind':'link.error_frame','point':'client.1'}", "expected a point on UNIT.can, bus.NAME"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'after':'DRDY'}",
         "expected an event of a, a PSA-2: RES, SETUP_DONE"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'count':2}", "count: requires after"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'after':'DRD_A','since':'DRD_A'}",
         "since: expected another event"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'at_s':0.001}",
         "at_s: expected at least 0.002 s (now), got 0.001"},
    };
    run_to(2 * MS);
    for (size_t k = 0; k < COUNT(rows); k++) {
        if (add(rows[k].args)) fail_msg("%s was accepted", rows[k].args);
        if (!strstr(r.control.error.why, rows[k].why)) fail_msg("%s: %s", rows[k].args, r.control.error.why);
    }
    assert_int_equal(r.engine.last_id, 0);
}

/* No kind at any point without either a fit or a sentence. */
static void every_kind_at_every_point_fits_or_says_why_not(void **state)
{
    (void)state;
    const struct fault_kind *kind;
    unsigned fit = 0, refused = 0;
    r.lab.chamber.cfg.present = true;
    r.lab.table.cfg.axes = 2;
    for (unsigned i = 0; (kind = fault_kind(i)) != NULL; i++) {
        struct fault f = {.kind = kind};
        unsigned of_kind = 0;
        for (unsigned a = 0; a < FAULT_ARGS; a++) {
            f.value[a] = a == FAULT_DROP_V ? 10.0 : 1.0;
            f.given |= kind->need & UINT64_C(1) << a;
        }
        for (struct fault_points at = {0}; fault_point_next(&r.view, &at, &f.point, f.name);) {
            char why[CONTROL_WHY_MAX] = "";
            if (fault_fits(&r.view, &f, why)) of_kind++;
            else if (strlen(why) < 20) fail_msg("%s at %s: \"%s\"", kind->name, f.name, why);
            else refused++;
        }
        fit += of_kind;
        const bool elsewhere = kind->places == FAULT_BIT(FAULT_AT_GYRO) || /* board/bins/test_bins_faults.c */
                               (kind->lacks && (strncmp(kind->name, "controller.", 11) == 0 || /* test_fault_board.c */
                                                strncmp(kind->name, "receiver.", 9) == 0)); /* test_fault_receiver.c */
        if (of_kind == 0 && !elsewhere && strcmp(kind->name, "sensor.saturation") != 0)
            fail_msg("%s fits nowhere", kind->name);
    }
    assert_true(fit > 40 && refused > 400);
}

static void points_have_names_of_their_own(void **state)
{
    (void)state;
    struct fault_point p;
    char name[FAULT_POINT_MAX], found[FAULT_POINT_MAX];
    unsigned n = 0;
    for (struct fault_points at = {0}; fault_point_next(&r.view, &at, &p, name); n++) {
        struct fault_point q;
        assert_true(fault_point_find(&r.view, name, &q, found));
        if (p.place != q.place || p.unit != q.unit || p.index != q.index) fail_msg("%s is %s", name, found);
    }
    assert_int_equal(n, UNITS * (9 + 16 + 3 + 4) + 1 + 1 + 1 + 3 + 1 +
                            2); /* bus, client, supply, platform, head, its link and the supply's */
    assert_true(fault_point_find(&r.view, "b.line.CLK", &p, name));
    assert_int_equal(p.unit, 1);
    assert_int_equal(p.index, PSA2_LINE_CLK);
    assert_true(fault_point_find(&r.view, "a.line.INT", &p, name));
    assert_string_equal(name, "a.line.Int");
    assert_false(fault_point_find(&r.view, "a.line.IN", &p, name));
    assert_false(fault_point_find(&r.view, "A.LINE.INT ", &p, name));
}

static void refused(const char *cmd, const char *args)
{
    cJSON *j = cJSON_Parse(args), *result = cJSON_CreateObject();
    assert_non_null(j);
    assert_int_equal(control_call(&r.control, cmd, j, result, r.s.now_ns), CONTROL_REJECTED);
    cJSON_Delete(result);
    cJSON_Delete(j);
}

/* When an input was last looked at decides about what its filter holds: what is refused must not look. */
static void a_refused_command_leaves_no_trace(void **state)
{
    (void)state;
    r.lab.chamber.cfg = chamber_default();
    r.lab.chamber.cfg.present = true;
    const struct table_cfg cfg = table_default(1);
    table_init(&r.lab.table, &cfg, &r.lab.site, 1);
    run_to(400 * MS + 12345);
    const int64_t looked_ns = r.unit[0].board->afe[0].t_ns;
    assert_true(looked_ns < r.s.now_ns);
    refused("table.sine", "{\"axis\":1,\"amplitude_deg\":100,\"frequency_hz\":10}");
    refused("table.profile", "{\"axis\":1,\"times_s\":[1,0],\"rates_dps\":[1,2]}");
    refused("chamber.ramp", "{\"ramp_k_per_min\":0.0001}");
    assert_int_equal(r.unit[0].board->afe[0].t_ns, looked_ns);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup(name, fresh)
    const struct CMUnitTest tests[] = {
        TEST(a_trigger_counts_anew_from_each_event_it_counts_from),
        TEST(a_fault_begins_and_ends_at_its_instants),
        TEST(without_an_instant_it_begins_now_and_lasts_until_it_is_cleared),
        TEST(a_fault_begins_with_the_event_it_waits_for),
        TEST(events_count_from_the_instant_on),
        TEST(events_may_be_those_of_another_unit),
        TEST(while_a_fault_listens_someone_may_look_at_any_time),
        TEST(a_fault_that_waits_or_listens_can_be_cleared),
        TEST(places_are_used_again_but_not_those_of_living_faults),
        TEST(a_program_keeps_its_number_when_an_older_one_leaves),
        TEST(what_does_not_fit_is_refused_with_the_reason),
        TEST(a_refused_command_leaves_no_trace),
        TEST(every_kind_at_every_point_fits_or_says_why_not),
        TEST(points_have_names_of_their_own),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

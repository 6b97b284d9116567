/* Faults, events, counters and truth of a board that is none of ours: all that the commands know of it is in its table. */
#include "fault_call.h"

#include "fake_board.h"

static struct {
    struct sched s;
    struct can_bus bus;
    struct lab lab;
    struct unit unit[2]; /* f is the fake, p a PSA-2 */
    struct fake_board board;
    struct control_bench view;
    struct fault_engine engine;
    struct control control, truth;
    char pushed[256]; /* the latest line */
} r;

static uint64_t on_can_rx(void *ctx)
{
    (void)ctx;
    return 0;
}

static bool on_run(void *ctx, int64_t for_ns, uint64_t after_tx, char *why)
{
    (void)ctx;
    (void)for_ns;
    (void)after_tx;
    (void)why;
    return true;
}

static void on_run_stop(void *ctx)
{
    (void)ctx;
}

static void on_push(void *ctx, void *client, const char *line)
{
    (void)ctx;
    (void)client;
    snprintf(r.pushed, sizeof r.pushed, "%s", line);
}

static int fresh(void **state)
{
    const struct lab_cfg lab = lab_default();
    (void)state;
    memset(&r, 0, sizeof r);
    sched_init(&r.s);
    can_bus_init(&r.bus, &(struct can_bus_cfg){.bitrate_hz = 1000000}, &r.s);
    lab_init(&r.lab, &lab, 1);
    fake_unit(&r.unit[0], &r.board, "f", &r.lab, &r.s);
    const struct unit_cfg psa2 = unit_default("p");
    unit_init(&r.unit[1], &psa2, &r.lab, &r.s);
    r.view = bench_of_two(r.unit, "f", "p", &r.bus, &r.s, &r.engine);
    r.view.sim.run = on_run;
    r.view.sim.run_stop = on_run_stop;
    r.view.process.push = on_push;
    r.view.clients.can_rx = on_can_rx;
    fault_init(&r.engine, &r.view, &r.s);
    control_init(&r.control, control_tables, &r.view);
    control_init(&r.truth, control_truth_tables, &r.view);
    return 0;
}

/* Single quotes for double ones. */
static const char *say(struct control *c, const char *line)
{
    char json[512];
    snprintf(json, sizeof json, "%s", line);
    for (char *s = json; *s; s++) *s = *s == '\'' ? '"' : *s;
    return control_line(c, json, r.s.now_ns);
}

static void assert_says(const char *line, const char *part)
{
    char want[512];
    const char *reply = say(strncmp(line, "{'cmd':'truth", 13) == 0 ? &r.truth : &r.control, line);
    snprintf(want, sizeof want, "%s", part);
    for (char *s = want; *s; s++) *s = *s == '\'' ? '"' : *s;
    assert_non_null(reply);
    if (!strstr(reply, want)) fail_msg("%s\n  gave %s\n  want %s", line, reply, want);
}

#define ADD(args) "{'cmd':'fault.add','args':{" args "}}"

static void its_points_are_those_of_its_table(void **state)
{
    static const char *const names[] = {
        "f.sensor.x", "f.sensor.y", "f.sensor.z", "f.afe.x",     "f.afe.y",   "f.afe.z",     "f.conv.a", "f.conv.b",
        "f.rom",      "f.lamp",     "f.ctl",      "f.line.BEAT", "f.line.CK", "f.line.MARK", "f.can",    "p.sensor.x"};
    struct fault_points at = {0};
    struct fault_point p;
    char name[FAULT_POINT_MAX];
    (void)state;
    for (unsigned n = 0; n < COUNT(names); n++) {
        assert_true(fault_point_next(&r.view, &at, &p, name));
        assert_string_equal(name, names[n]);
    }
    assert_true(fault_point_find(&r.view, "f.conv.b", &p, name));
    assert_true(p.place == FAULT_AT_CHIP && p.index == FAKE_CONV_B);
    assert_says("{'cmd':'fault.points','args':{'kind':'controller.frozen_words'}}", "'points':['f.ctl','p.kpsa']");
    assert_says(
        "{'cmd':'fault.kinds'}",
        "'points':['UNIT.conv.a|b','UNIT.rom','UNIT.lamp','UNIT.adc.x|y|z','UNIT.tadc'],'args':[{'name':'level'");
}

static void what_its_table_does_not_have_is_refused_with_the_reason(void **state)
{
    (void)state;
    const struct {
        const char *line, *why;
    } rows[] = {
        {ADD("'kind':'chip.lost_sync','point':'f.conv.a'"), "'point','text':'f.conv.a: it runs on its own'"},
        {ADD("'kind':'chip.drdy_stuck','point':'f.conv.b','level':'low'"), "f.conv.b: this chip has no data-ready pin"},
        {ADD("'kind':'chip.dout_dead','point':'f.rom','level':'low'"), "f.rom: this chip has no data pin"},
        {ADD("'kind':'chip.clock','point':'f.conv.b','clock_ppm':5"), "f.conv.b: this chip has no clock of its own"},
        {ADD("'kind':'chip.clock','point':'f.conv.a','clock_ppm':0.5"), "expected whole ppm"},
        {ADD("'kind':'chip.flip','point':'f.conv.b','register':0,'mask':1"), "f.conv.b: this chip has no registers"},
        {ADD("'kind':'chip.flip','point':'f.conv.a','register':3,'mask':1"), "expected 0 to 2 for f.conv.a"},
        {ADD("'kind':'controller.skip_sync_t','point':'f.ctl'"), "f.ctl: the controller of this board has no SYNC_T"},
        {ADD("'kind':'controller.setup_order','point':'f.ctl'"), "f.ctl: the controller of this board has no set-up"},
        {ADD("'kind':'chip.lost_sync','point':'f.ctl'"),
         "expected a point on UNIT.conv.a|b, UNIT.rom, UNIT.lamp, got f.ctl, which is the controller of a board"},
        {ADD("'kind':'chip.lost_sync','point':'p.kpsa'"), "expected a point on UNIT.adc.x|y|z, UNIT.tadc, got p.kpsa"},
        {ADD("'kind':'controller.frozen_words','point':'bus.can0'"),
         "expected a point on UNIT.ctl, UNIT.kpsa, got bus.can0"},
        {ADD("'kind':'line.missing_pulse','point':'f.line.BEAT','pulse':1"), "the line CK does"},
        {ADD("'kind':'line.missing_pulse','point':'f.line.MARK','pulse':1"), "the line CK does"},
        {ADD("'kind':'line.extra_pulse','point':'f.line.CK','pulse':9,'width_ns':1"), "pulse: expected 1 to 8"},
        {ADD("'kind':'sensor.bias','point':'f.sensor.x','bias_v':0.0009"),
         "expected at least 0.001 V, one code of this board"},
        {ADD("'kind':'sensor.noise','point':'f.sensor.x','rms_v':0.0009"), "rms_v: expected at least 0.001 V"},
        {ADD("'kind':'sensor.scale','point':'f.sensor.x','scale_ppm':-199"),
         "expected at least 200 ppm, one code of this board"},
        {ADD("'kind':'sensor.drift','point':'f.sensor.x','drift_v_per_s':0.009,'for_s':0.1"), "less than 0.001 V"},
        {ADD("'kind':'sensor.saturation','point':'f.sensor.x','high_v':5"), "expected a limit within -5 to 5 V"},
        {ADD("'kind':'analog.reference','point':'f.afe.x','reference_ppm':199"),
         "expected at least 200 ppm, one code of this board"},
        {ADD("'kind':'analog.reference','point':'f.afe.x','drift_ppm_per_s':199,'for_s':1"), "less than 200 ppm"},
        {ADD("'kind':'analog.ripple','point':'f.afe.x','amplitude_v':0.0009,'frequency_hz':1"),
         "amplitude_v: expected at least 0.001 V"},
        {ADD("'kind':'sensor.bias','point':'f.sensor.x','bias_v':1,'after':'DRD_A'"),
         "after: expected an event of f, a FAKE-1: TICK, TOCK, got \\'DRD_A\\'"},
        {ADD("'kind':'sensor.bias','point':'f.sensor.x','bias_v':1,'after':'TICK','since':'RES'"),
         "since: expected an event of f"},
        {ADD("'kind':'sensor.bias','point':'f.sensor.x','bias_v':1,'after':'TICK','unit':'p'"),
         "expected an event of p, a PSA-2"},
        {"{'cmd':'run.until','args':{'event':'INT_FALL'}}",
         "event: expected an event of f, a FAKE-1: TICK, TOCK, got \\'INT_FALL\\'"},
        {"{'cmd':'run.until','args':{'event':'TICK','unit':'p'}}", "expected an event of p, a PSA-2: RES"},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        assert_says(rows[i].line, "'ok':false");
        assert_says(rows[i].line, rows[i].why);
    }
    assert_int_equal(r.engine.last_id, 0);
}

/* What is just as much as a code is accepted. */
static void the_least_that_is_seen_is_accepted(void **state)
{
    static const char *const lines[] = {
        ADD("'kind':'sensor.bias','point':'f.sensor.x','bias_v':-0.001"),
        ADD("'kind':'sensor.noise','point':'f.sensor.y','rms_v':0.001"),
        ADD("'kind':'sensor.scale','point':'f.sensor.z','scale_ppm':200"),
        ADD("'kind':'sensor.drift','point':'f.sensor.x','drift_v_per_s':0.01,'for_s':0.1"),
        ADD("'kind':'analog.reference','point':'f.afe.x','reference_ppm':-200"),
        ADD("'kind':'analog.ripple','point':'f.afe.x','amplitude_v':0.001,'frequency_hz':1"),
        ADD("'kind':'line.missing_pulse','point':'f.line.CK','pulse':8"),
        ADD("'kind':'line.stuck','point':'f.line.BEAT','level':'low'"),
    };
    (void)state;
    sched_run_until(&r.s, 5);
    for (size_t i = 0; i < COUNT(lines); i++) assert_says(lines[i], "'ok':true");
    assert_int_equal(r.board.sampled_ns, 5);
    assert_non_null(r.unit[0].sensor_faults[1]);
    assert_non_null(r.board.base.afe[0].faults);
    assert_int_equal(r.board.base.line.slot[0].f.frame_line, fake_type.frame_line);
    assert_int_equal(r.board.base.line.slot[0].f.line, fake_type.pulse_line);
}

static void faults_reach_the_part_that_they_are_for(void **state)
{
    (void)state;
    const struct chip_fault *a = &r.board.chip[FAKE_CONV_A - 1].fault, *b = &r.board.chip[FAKE_CONV_B - 1].fault;
    assert_says(ADD("'kind':'chip.dout_dead','point':'f.conv.a','level':'high','for_s':0.1"), "'id':1");
    assert_says(ADD("'kind':'chip.clock','point':'f.conv.a','clock_ppm':-40"), "'id':2");
    assert_says(ADD("'kind':'chip.clock','point':'f.conv.a','clock_ppm':25,'for_s':0.2"), "'id':3");
    assert_says(ADD("'kind':'chip.dout_dead','point':'f.conv.b','level':'low'"), "'id':4");
    assert_true(a->dout == CHIP_STUCK_HIGH && a->clock_ppm == -15 && !a->drdy && !a->lost_sync);
    assert_true(b->dout == CHIP_STUCK_LOW && b->clock_ppm == 0);
    sched_run_until(&r.s, 150000000);
    assert_true(!a->dout && a->clock_ppm == -15);
    sched_run_until(&r.s, 250000000);
    assert_int_equal(a->clock_ppm, -40);
    assert_says(ADD("'kind':'chip.flip','point':'f.conv.a','register':2,'mask':5"), "'id':5");
    assert_int_equal(r.board.chip[FAKE_CONV_A - 1].flipped, 2 * 256 + 5);
    assert_says(ADD("'kind':'controller.frozen_words','point':'f.ctl'"), "'id':6");
    assert_int_equal(r.board.base.faults, FAKE_FAULT_FROZEN_WORDS);
    assert_says("{'cmd':'fault.clear'}", "'cleared':6");
    assert_int_equal(r.board.base.faults, 0);
    assert_true(!b->dout && a->clock_ppm == 0);
    r.board.on = false;
    assert_says(ADD("'kind':'chip.flip','point':'f.conv.a','register':0,'mask':1"), "'id':7");
    assert_int_equal(fault_find(&r.engine, 7)->state, FAULT_VOID);
}

static void tock(void)
{
    for (struct unit_observer *l = r.unit[0].observers, *next; l; l = next) {
        next = l->next;
        l->fn(l->ctx, 1, r.s.now_ns);
    }
}

static void its_events_bring_faults_about_and_end_runs(void **state)
{
    (void)state;
    assert_says(ADD("'kind':'sensor.bias','point':'f.sensor.x','bias_v':1,'after':'TOCK','count':2"), "'id':1");
    assert_true(r.board.base.observed);
    assert_says("{'cmd':'fault.list'}", "'after':'TOCK','count':2,'unit':'f','bias_v':1");
    tock();
    assert_int_equal(fault_find(&r.engine, 1)->state, FAULT_LISTENING);
    tock();
    sched_run_until(&r.s, 1);
    assert_int_equal(fault_find(&r.engine, 1)->state, FAULT_ACTIVE);
    assert_false(r.board.base.observed);
    assert_null(say(&r.control, "{'cmd':'run.until','args':{'event':'TOCK'}}"));
    tock();
    assert_non_null(strstr(control_run_done(&r.control, 1), "\"result\":{\"reached\":true,\"seen\":1}"));
}

/* ---- the boards there are */

/* A bench of one unit of this type, each channel with a sensor. */
static void bench_of(const struct board_type *type)
{
    struct unit_cfg cfg = unit_default("u");
    unit_cfg_type(&cfg, type);
    for (unsigned i = 0; i < UNIT_AXES; i++) cfg.axis[i].sensor = UNIT_MEMS;
    for (unsigned i = 0; i < UNIT_AXES; i++) cfg.board.afe[i].input = AFE_CURRENT;
    unit_init(&r.unit[1], &cfg, &r.lab, &r.s);
    r.view.units = 1;
    r.view.unit[0] = &r.unit[1];
    r.view.unit_name[0] = "u";
}

/* How many points of the bench a kind fits at; elsewhere it says why not. */
static unsigned points_for(const struct fault_kind *kind)
{
    struct fault f = {.kind = kind};
    unsigned fits = 0;
    for (unsigned a = 0; a < FAULT_ARGS; a++) f.value[a] = a == FAULT_SCALE_PPM || a == FAULT_REFERENCE_PPM ? 1e4 : 1.0;
    f.given = kind->need;
    if (strcmp(kind->name, "sensor.saturation") == 0) f.given |= UINT64_C(1) << FAULT_LOW_V;
    for (struct fault_points at = {0}; fault_point_next(&r.view, &at, &f.point, f.name);) {
        char why[CONTROL_WHY_MAX] = "";
        if (fault_fits(&r.view, &f, why)) fits++;
        else if (strlen(why) < 20) fail_msg("%s at %s: \"%s\"", kind->name, f.name, why);
    }
    return fits;
}

/* Of no board: what wants more of the bench than this one has, or bits of the bus, is in test_fault.c. */
static void every_kind_of_chips_lines_and_sensors_fits_a_board_and_every_part_has_a_kind(void **state)
{
    const struct fault_kind *kind;
    unsigned fits[64] = {0};
    for (const struct board_type *const *t = board_types; *t; t++) {
        fresh(state);
        bench_of(*t);
        for (unsigned i = 0; (kind = fault_kind(i)) != NULL; i++) {
            const unsigned here = points_for(kind);
            const bool any = kind->places & (UINT64_C(1) << FAULT_AT_SENSOR | UINT64_C(1) << FAULT_AT_AFE);
            if (any && here != ((*t)->analog ? UNIT_AXES : 0))
                fail_msg("%s fits %u axes of %s", kind->name, here, (*t)->title);
            if (strcmp(kind->name, "line.stuck") == 0) assert_int_equal(here, (*t)->line_count);
            if (strcmp(kind->name, "line.missing_pulse") == 0) assert_int_equal(here, (*t)->pulses ? 1 : 0);
            fits[i] += here;
        }
    }
    for (unsigned i = 0; (kind = fault_kind(i)) != NULL; i++) {
        const bool of_a_board = strncmp(kind->name, "supply", 6) != 0 && strncmp(kind->name, "platform", 8) != 0 &&
                                strncmp(kind->name, "chamber", 7) != 0 && strncmp(kind->name, "table", 5) != 0;
        if (!fits[i] && of_a_board && strcmp(kind->name, "link.stall") != 0) fail_msg("%s fits nowhere", kind->name);
    }
    const struct board_part *part;
    for (const struct board_type *const *t = board_types; *t; t++) {
        assert_true((*t)->controller_faults[0].kind && (*t)->parts[0].name);
        for (unsigned i = 1; i < (*t)->part_count; i++) {
            part = &(*t)->parts[i];
            if (!part->name) continue;
            assert_true((part->faults && part->fault) || (part->registers && part->flip));
            if (part->faults != 15 && !part->unless) fail_msg("%s of %s: why not?", part->name, (*t)->title);
        }
    }
}

static void subscribers_hear_its_events_by_their_names(void **state)
{
    int me;
    (void)state;
    r.control.client = &me;
    assert_says("{'cmd':'subscribe','args':{'what':'events'}}", "'ok':true");
    tock();
    assert_string_equal(r.pushed, "{\"event\":\"TOCK\",\"unit\":\"f\",\"t_ns\":0}");
}

static void it_tells_its_type_its_counters_its_lines_and_its_truth(void **state)
{
    (void)state;
    r.board.cycles = 3;
    r.board.chip[1].conversions = 17;
    r.board.chip[1].lost = 2;
    assert_says("{'cmd':'units'}",
                "{'name':'f','board':'fake','serial':1,'node':5,'profile':'usual','on':'head','ready':true,"
                "'eager':'a board of this type always does'}");
    assert_says(
        "{'cmd':'counters','args':{'unit':'f'}}",
        "'result':{'board':{'cycles':3},'conv_a':{'conversions':0,'lost':0},'conv_b':{'conversions':17,'lost':2},"
        "'memory':{'conversions':0,'lost':0},'lamp':{'conversions':0,'lost':0},'trace':{'late':0,'dropped':0}}");
    trace_set(&r.board.base.trace, 1, true, 0);
    assert_says("{'cmd':'lines','args':{'unit':'f'}}", "'lines':{'BEAT':1,'CK':1,'MARK':0}");
    assert_says("{'cmd':'truth'}", "'f':{'board':'fake','serial':1,");
    assert_says("{'cmd':'truth'}", "'specimen':{'capacitor_error_ppm':250}");
    assert_says("{'cmd':'truth'}", "'profile':'usual','adc_noise_scale':1,'specimen'"); /* and nothing of PSA-2's */
    assert_says("{'cmd':'truth'}", "'temp_noise_scale':1,'temp_adc_offset_v':0,'temp_adc_gain_error':0");
    assert_says("{'cmd':'unit.reset','args':{'unit':'f'}}", "'ok':true");
    assert_int_equal(r.board.resets, 1);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup(name, fresh)
    const struct CMUnitTest tests[] = {
        TEST(its_points_are_those_of_its_table),
        TEST(what_its_table_does_not_have_is_refused_with_the_reason),
        TEST(the_least_that_is_seen_is_accepted),
        TEST(faults_reach_the_part_that_they_are_for),
        TEST(its_events_bring_faults_about_and_end_runs),
        TEST(subscribers_hear_its_events_by_their_names),
        TEST(every_kind_of_chips_lines_and_sensors_fits_a_board_and_every_part_has_a_kind),
        TEST(it_tells_its_type_its_counters_its_lines_and_its_truth),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* The fault engine: when faults begin and end, what is refused, and that what is accepted reaches the part it is for. */
#include "rig.h"

#include "control/fault.h"

#include <math.h>
#include <string.h>

#define MS INT64_C(1000000)

enum { UNITS = 2, PROGRAMS = 2, EVENTS_MAX = 4096, CHANGES_MAX = 64 };

struct heard {
    enum psa2_event e;
    int64_t t_ns;
};

struct change {
    uint32_t id;
    enum fault_state state;
    int64_t t_ns;
};

static struct {
    struct sched s;
    struct can_bus bus;
    struct lab lab;
    struct unit unit[UNITS];
    struct can_node node[UNITS], program[PROGRAMS];
    uint32_t came[PROGRAMS + 1]; /* who is on the bus, up to 0 */
    struct control_bench view;
    struct fault_engine engine;
    struct control control;
    struct unit_listener listener;
    struct heard heard[EVENTS_MAX];
    unsigned events;
    struct change change[CHANGES_MAX];
    unsigned changes;
    struct psa2_frame frame; /* latest of unit a */
    unsigned frames;
} r;

static void on_event(void *ctx, enum psa2_event e, int64_t t_ns)
{
    (void)ctx;
    if (r.events < EVENTS_MAX) r.heard[r.events++] = (struct heard){e, t_ns};
}

static void on_change(void *ctx, const struct fault *f, int64_t t_ns)
{
    (void)ctx;
    assert_true(r.changes < CHANGES_MAX);
    r.change[r.changes++] = (struct change){f->id, f->state, t_ns};
}

static void on_frame(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    r.frame = *f;
    r.frames++;
}

static bool on_client(void *ctx, unsigned i, struct control_client *out)
{
    (void)ctx;
    *out = (struct control_client){.adapter = "socketcand", .name = "can0", .came = r.came[i], .place = r.came[i]};
    return r.came[i] != 0;
}

static struct can_node *on_client_node(void *ctx, uint32_t place)
{
    (void)ctx;
    for (unsigned i = 0; r.came[i]; i++) {
        if (r.came[i] == place) return &r.program[place - 1];
    }
    return NULL;
}

static void init_unit(unsigned i)
{
    static const char *const name[UNITS] = {"a", "b"};
    struct unit_cfg cfg = unit_default(name[i]);
    cfg.axis[0].sensor = UNIT_MEMS;
    cfg.axis[0].mems = (struct mems_g){.u0_v = 2.5, .kx_v_per_g = 1.0};
    cfg.board.adc_noise_scale = cfg.board.temp_noise_scale = 0.0;
    cfg.board.serial = i + 1;
    if (i == 1) cfg.board.afe[0] = afe_nominal(AFE_CURRENT);
    if (i == 1) cfg.board.afe[0].clip_v = 5.0;
    unit_init(&r.unit[i], &cfg, &r.lab, &r.s);
    r.node[i] = (struct can_node){.name = name[i]};
    can_attach(&r.bus, &r.node[i]);
    r.view.unit[i] = &r.unit[i];
    r.view.unit_name[i] = name[i];
    r.view.node[i] = &r.node[i];
}

static int fresh(void **state)
{
    struct lab_cfg lab = lab_default();
    lab.supply.present = true;
    lab.platform.present = true;
    (void)state;
    memset(&r, 0, sizeof r);
    sched_init(&r.s);
    can_bus_init(&r.bus, &(struct can_bus_cfg){.bitrate_hz = 1000000}, &r.s);
    lab_init(&r.lab, &lab, 1);
    r.view = (struct control_bench){.lab = &r.lab,
                                    .bus = {&r.bus},
                                    .bus_name = {"can0"},
                                    .buses = 1,
                                    .units = UNITS,
                                    .seed = 7,
                                    .faults = &r.engine,
                                    .client = on_client,
                                    .client_node = on_client_node};
    for (unsigned i = 0; i < UNITS; i++) init_unit(i);
    r.program[0].name = "program";
    can_attach(&r.bus, &r.program[0]);
    r.came[0] = 1;
    fault_init(&r.engine, &r.view, &r.s);
    r.engine.changed = on_change;
    control_init(&r.control, control_tables, &r.view);
    psa2_attach(r.unit[0].board, &(struct psa2_host){.frame = on_frame});
    r.listener.fn = on_event;
    unit_listen(&r.unit[0], &r.listener);
    for (unsigned i = 0; i < UNITS; i++) psa2_power_up(r.unit[i].board, 0);
    return 0;
}

static void run_to(int64_t t_ns)
{
    sched_run_until(&r.s, t_ns);
}

/* The number that fault.add gives; 0: refused, the reason stands in the control. Single quotes for double ones. */
static uint32_t add(const char *args)
{
    char json[512];
    snprintf(json, sizeof json, "%s", args);
    for (char *s = json; *s; s++) *s = *s == '\'' ? '"' : *s;
    cJSON *j = cJSON_Parse(json);
    cJSON *result = cJSON_CreateObject();
    assert_non_null(j);
    const enum control_outcome done = control_call(&r.control, "fault.add", j, result, r.s.now_ns);
    const uint32_t id =
        done == CONTROL_DONE ? (uint32_t)cJSON_GetObjectItemCaseSensitive(result, "id")->valuedouble : 0;
    cJSON_Delete(result);
    cJSON_Delete(j);
    return id;
}

/* The n-th event of a kind that comes after t_ns. */
static int64_t nth_ns(enum psa2_event e, unsigned n, int64_t after_ns)
{
    for (unsigned i = 0; i < r.events; i++) {
        if (r.heard[i].e == e && r.heard[i].t_ns > after_ns && --n == 0) return r.heard[i].t_ns;
    }
    fail_msg("no such event");
    return 0;
}

static void assert_change(unsigned i, uint32_t id, enum fault_state state, int64_t t_ns)
{
    assert_true(i < r.changes);
    assert_int_equal(r.change[i].id, id);
    assert_int_equal(r.change[i].state, state);
    assert_int_equal(r.change[i].t_ns, t_ns);
}

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
    psa2_reset(r.unit[0].board, r.s.now_ns);
    run_to(201 * MS);
    assert_int_equal(r.changes, 0);
    psa2_reset(r.unit[1].board, r.s.now_ns);
    run_to(202 * MS);
    assert_change(0, id, FAULT_ACTIVE, 201 * MS);
    assert_null(r.unit[1].listeners);
}

static void a_fault_that_waits_or_listens_can_be_cleared(void **state)
{
    (void)state;
    add("{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'at_s':0.3}");
    add("{'kind':'sensor.bias','point':'b.sensor.x','bias_v':1,'after':'DRD_A'}");
    assert_non_null(r.unit[1].listeners);
    for (uint32_t id = 1; id <= 2; id++) fault_clear(&r.engine, fault_find(&r.engine, id), r.s.now_ns);
    assert_null(r.unit[1].listeners);
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
    assert_non_null(strstr(r.control.refusal.why, "64 faults are waiting or active"));
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
        {"{'kind':'sensor.bia','point':'a.sensor.x'}", "there is sensor.stuck, sensor.bias"},
        {"{'kind':'bias','point':'a.sensor.x'}", "fault.kinds lists them"},
        {"{'kind':'sensor.bias','point':'c.sensor.x','bias_v':1}", "fault.points lists them"},
        {"{'kind':'sensor.bias','point':'a.line.INT','bias_v':1}",
         "not on a.line.Int, which is a line of a board; it works on UNIT.sensor.x|y|z"},
        {"{'kind':'sensor.bias','point':'a.sensor.x'}", "bias_v is missing"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':0}", "0 would change nothing"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':16}", "outside -15 ... -2e-06 and 2e-06 ... 15 V"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'rms_v':1}", "rms_v: sensor.bias takes no such value"},
        {"{'kind':'sensor.bias','point':'a.sensor.y','bias_v':1}", "a.sensor.y: the channel has no sensor"},
        {"{'kind':'sensor.saturation','point':'a.sensor.x'}", "low_v or high_v is missing"},
        {"{'kind':'sensor.saturation','point':'a.sensor.x','low_v':2,'high_v':2}", "is not below high_v"},
        {"{'kind':'analog.load_open','point':'a.afe.x'}", "no load resistor"},
        {"{'kind':'analog.reference','point':'a.afe.x'}", "reference_ppm or drift_ppm_per_s is missing"},
        {"{'kind':'chip.drdy_stuck','point':'a.adc.y','level':'low'}",
         "a.adc.y: DRD_A is the pin of converter X alone, nobody hears this one; adc.x has it"},
        {"{'kind':'chip.drdy_stuck','point':'a.adc.x','level':'middle'}", "none of low, high"},
        {"{'kind':'chip.flip','point':'a.adc.x','register':11,'mask':1}", "a.adc.x has 0 to 10"},
        {"{'kind':'chip.flip','point':'a.adc.x','register':1,'mask':1,'for_s':1}", "is over as soon as it is done"},
        {"{'kind':'line.missing_pulse','point':'a.line.Int','pulse':1}", "the line CLK does"},
        {"{'kind':'line.missing_pulse','point':'a.line.CLK','pulse':129}", "outside 1 ... 128"},
        {"{'kind':'supply.brownout','point':'supply','drop_v':5}", "for_s is missing"},
        {"{'kind':'supply.brownout','point':'supply','drop_v':2,'for_s':1}",
         "not below the threshold of the boards, 9 V"},
        {"{'kind':'chip.clock','point':'a.adc.x','clock_ppm':0.4}", "whole ppm"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':-1e-6}",
         "bias_v: -1e-06 is outside -15 ... -2e-06 and 2e-06 ... 15 V"},
        {"{'kind':'sensor.drift','point':'a.sensor.x','drift_v_per_s':1e-6}",
         "outside -1000 ... -2e-06 and 2e-06 ... 1000 V/s"},
        {"{'kind':'sensor.drift','point':'a.sensor.x','drift_v_per_s':0.001,'for_s':0.001}",
         "in 0.001 s it comes to 1e-06 V, less than 2e-06 V"},
        {"{'kind':'sensor.scale','point':'a.sensor.x','scale_ppm':-0.9}",
         "outside -10000000 ... -1 and 1 ... 10000000"},
        {"{'kind':'sensor.noise','point':'a.sensor.x','rms_v':1e-6}", "outside 2e-06 ... 10 V"},
        {"{'kind':'sensor.saturation','point':'a.sensor.x','high_v':10}", "high_v: 10: the chain passes -10 ... 10 V"},
        {"{'kind':'sensor.saturation','point':'a.sensor.x','low_v':-12,'high_v':3}", "low_v: -12: the chain passes"},
        {"{'kind':'sensor.saturation','point':'b.sensor.x','high_v':6}", "high_v: 6: the chain passes -5 ... 5 V"},
        {"{'kind':'analog.reference','point':'a.afe.x','reference_ppm':0.5}",
         "outside -500000 ... -1 and 1 ... 1000000"},
        {"{'kind':'analog.reference','point':'a.afe.x','drift_ppm_per_s':0.5}", "outside 1 ... 1000000 ppm/s"},
        {"{'kind':'analog.reference','point':'a.afe.x','drift_ppm_per_s':5,'for_s':0.1}",
         "in 0.1 s it comes to 0.5 ppm, less than 1 ppm"},
        {"{'kind':'analog.ripple','point':'a.afe.x','amplitude_v':1e-6,'frequency_hz':1}", "outside 2e-06 ... 10 V"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'for_s':1e-10}",
         "for_s: 1e-10: less than a nanosecond"},
        {"{'kind':'link.delay','point':'bus.can0','hold_s':1e-10}", "hold_s: 1e-10: less than a nanosecond"},
        {"{'kind':'supply.brownout','point':'a.can','drop_v':5,'for_s':1}", "which is the CAN node of a board"},
        {"{'kind':'link.delay','point':'bus.can0'}", "hold_s is missing"},
        {"{'kind':'link.stall','point':'client.2'}", "fault.points lists them"},
        {"{'kind':'link.error_frame','point':'client.1'}", "it works on UNIT.can, bus.NAME"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'after':'DRDY'}",
         "no event \"DRDY\" on a, a PSA-2; there is RES, SETUP_DONE"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'count':2}", "only with after"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'after':'DRD_A','since':'DRD_A'}", "is after itself"},
        {"{'kind':'sensor.bias','point':'a.sensor.x','bias_v':1,'at_s':0.001}",
         "at_s: 0.001 is over, it is 0.002 s now"},
    };
    run_to(2 * MS);
    for (size_t k = 0; k < COUNT(rows); k++) {
        if (add(rows[k].args)) fail_msg("%s was accepted", rows[k].args);
        if (!strstr(r.control.refusal.why, rows[k].why)) fail_msg("%s: %s", rows[k].args, r.control.refusal.why);
    }
    assert_int_equal(r.engine.last_id, 0);
}

/* No kind at any point without either a fit or a sentence. */
static void every_kind_at_every_point_fits_or_says_why_not(void **state)
{
    (void)state;
    const struct fault_kind *kind;
    unsigned fit = 0, refused = 0;
    for (unsigned i = 0; (kind = fault_kind(i)) != NULL; i++) {
        struct fault f = {.kind = kind};
        unsigned of_kind = 0;
        for (unsigned a = 0; a < FAULT_ARGS; a++) {
            f.value[a] = a == FAULT_DROP_V ? 10.0 : 1.0;
            f.given |= kind->need & UINT64_C(1) << a;
        }
        for (unsigned n = 0; fault_point(&r.view, n, &f.point, f.name); n++) {
            char why[CONTROL_WHY_MAX] = "";
            if (fault_fits(&r.view, &f, why)) of_kind++;
            else if (strlen(why) < 20) fail_msg("%s at %s: \"%s\"", kind->name, f.name, why);
            else refused++;
        }
        fit += of_kind;
        const bool elsewhere = kind->lacks && strncmp(kind->name, "controller.", 11) == 0; /* test_fault_board.c */
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
    for (; fault_point(&r.view, n, &p, name); n++) {
        struct fault_point q;
        assert_true(fault_point_find(&r.view, name, &q, found));
        if (p.place != q.place || p.unit != q.unit || p.index != q.index) fail_msg("%s is %s", name, found);
    }
    assert_int_equal(n, UNITS * (9 + 16 + 3) + 1 + 1 + 1 + 3); /* bus, client, supply, platform */
    assert_true(fault_point_find(&r.view, "b.line.CLK", &p, name));
    assert_int_equal(p.unit, 1);
    assert_int_equal(p.index, PSA2_LINE_CLK);
    assert_true(fault_point_find(&r.view, "a.line.INT", &p, name));
    assert_string_equal(name, "a.line.Int");
    assert_false(fault_point_find(&r.view, "a.line.IN", &p, name));
    assert_false(fault_point_find(&r.view, "A.LINE.INT ", &p, name));
}

/* ---- what reaches the parts */

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

/* Volts of the arguments are volts at the load. */
static void volts_of_a_current_sensor_are_those_at_its_load(void **state)
{
    (void)state;
    add("{'kind':'sensor.stuck','point':'b.sensor.x','out_v':5}");
    const double signal = sensor_fault_out(r.unit[1].sensor_faults[0], 0.0, 1);
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

/* Registers without power hold nothing. */
static void a_flip_in_a_board_without_power_is_void(void **state)
{
    static const char *const args[] = {"{'kind':'chip.flip','point':'b.adc.z','register':2,'mask':1}",
                                       "{'kind':'chip.flip','point':'b.tadc','register':2,'mask':1}"};
    (void)state;
    run_to(400 * MS);
    psa2_power_down(r.unit[1].board, r.s.now_ns);
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

static void refused(const char *cmd, const char *args)
{
    cJSON *j = cJSON_Parse(args), *result = cJSON_CreateObject();
    assert_non_null(j);
    assert_int_equal(control_call(&r.control, cmd, j, result, r.s.now_ns), CONTROL_REFUSED);
    cJSON_Delete(result);
    cJSON_Delete(j);
}

/* When a sensor was last looked at decides about its noise: what is refused must not look. */
static void a_refused_command_leaves_no_trace(void **state)
{
    (void)state;
    r.lab.chamber.cfg = chamber_default();
    r.lab.chamber.cfg.present = true;
    const struct table_cfg cfg = table_default(1);
    table_init(&r.lab.table, &cfg, &r.lab.site, 1);
    run_to(400 * MS + 12345);
    const int64_t looked_ns = r.unit[0].mems[0].t_ns;
    assert_true(looked_ns < r.s.now_ns);
    refused("table.sine", "{\"axis\":1,\"amplitude_deg\":100,\"frequency_hz\":10}");
    refused("table.profile", "{\"axis\":1,\"times_s\":[1,0],\"rates_dps\":[1,2]}");
    refused("chamber.ramp", "{\"ramp_k_per_min\":0.0001}");
    assert_int_equal(r.unit[0].mems[0].t_ns, looked_ns);
}

/* Same number, same noise; another number, another one. */
static void random_faults_are_seeded_by_their_number(void **state)
{
    double out[3];
    for (int i = 0; i < 3; i++) {
        fresh(state);
        if (i == 2) add("{'kind':'controller.frozen_words','point':'b.kpsa'}");
        assert_int_equal(add("{'kind':'sensor.noise','point':'a.sensor.x','rms_v':0.1}"), i == 2 ? 2 : 1);
        out[i] = sensor_fault_out(r.unit[0].sensor_faults[0], 0.0, 1);
    }
    assert_true(out[0] == out[1]);
    assert_true(out[0] != out[2]);
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
        TEST(a_fault_that_waits_or_listens_can_be_cleared),
        TEST(places_are_used_again_but_not_those_of_living_faults),
        TEST(a_program_keeps_its_number_when_an_older_one_leaves),
        TEST(any_number_of_brownouts_may_be_under_way_at_once),
        TEST(a_flip_in_a_board_without_power_is_void),
        TEST(the_least_bias_is_seen),
        TEST(what_does_not_fit_is_refused_with_the_reason),
        TEST(brownouts_are_those_that_were_asked_for),
        TEST(a_refused_command_leaves_no_trace),
        TEST(every_kind_at_every_point_fits_or_says_why_not),
        TEST(points_have_names_of_their_own),
        TEST(a_bias_is_in_the_codes),
        TEST(volts_of_a_current_sensor_are_those_at_its_load),
        TEST(faults_of_a_chip_add_up),
        TEST(what_is_over_at_once_needs_no_lifting),
        TEST(random_faults_are_seeded_by_their_number),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

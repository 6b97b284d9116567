/* Faults of a receiver: each kind of the table reaches it, those of a kind add up, and nothing is left when they are over. */
#include "fault_call.h"

#include "board/receiver/board.h"

#include <math.h>
#include <string.h>

#define MS INT64_C(1000000)

static struct {
    struct sched s;
    struct can_bus bus;
    struct lab lab;
    struct unit unit[2]; /* g is the receiver, p a PSA-2 */
    struct control_bench view;
    struct fault_engine engine;
    struct control control;
} r;

static int fresh(void **state)
{
    const struct lab_cfg lab = lab_default();
    struct unit_cfg receiver = unit_default("g");
    const struct unit_cfg psa2 = unit_default("p");
    (void)state;
    memset(&r, 0, sizeof r);
    sched_init(&r.s);
    can_bus_init(&r.bus, &(struct can_bus_cfg){.bitrate_hz = 1000000}, &r.s);
    lab_init(&r.lab, &lab, 1);
    unit_cfg_type(&receiver, &receiver_board);
    unit_init(&r.unit[0], &receiver, &r.lab, &r.s);
    unit_init(&r.unit[1], &psa2, &r.lab, &r.s);
    r.view = bench_of_two(r.unit, "g", "p", &r.bus, &r.s, &r.engine);
    fault_init(&r.engine, &r.view, &r.s);
    control_init(&r.control, control_tables, &r.view);
    unit_power_up(&r.unit[0], 0);
    return 0;
}

/* As add_fault(). */
static uint32_t add(const char *kind, const char *point, const char *values)
{
    char args[300];
    snprintf(args, sizeof args, "{'kind':'%s','point':'%s'%s%s}", kind, point, *values ? "," : "", values);
    return add_fault(&r.control, args, r.s.now_ns);
}

static uint32_t added(const char *kind, const char *values)
{
    const uint32_t id = add(kind, "g.solver", values);
    if (!id) fail_msg("%s: %s", kind, r.control.error.why);
    return id;
}

static void clear(uint32_t id)
{
    fault_clear(&r.engine, fault_find(&r.engine, id), r.s.now_ns);
}

static const struct board_receiver_faults *wrong(void)
{
    return &((const struct receiver *)r.unit[0].board)->wrong;
}

static void assert_wrong(const struct board_receiver_faults *due)
{
    const struct board_receiver_faults *is = wrong();
    assert_int_equal(is->outage, due->outage);
    assert_int_equal(is->frozen_time, due->frozen_time);
    assert_int_equal(is->weeks, due->weeks);
    assert_true(fabs(is->checksum_probability - due->checksum_probability) < 1e-12);
    for (unsigned i = 0; i < 2; i++) {
        assert_true(fabs(is->rate_mps[i] - due->rate_mps[i]) < 1e-12);
        assert_true(fabs(is->base_m[i] - due->base_m[i]) < 1e-9);
        assert_true(fabs(is->jump_m[i] - due->jump_m[i]) < 1e-9);
    }
}

static const struct board_receiver_faults none;

static const struct row {
    const char *kind, *values;
    struct board_receiver_faults due;
} rows[] = {
    {"receiver.outage", "", {.outage = true}},
    {"receiver.spoof", "'ramp_mps':5", {.rate_mps = {0.0, 5.0}}},
    {"receiver.jump", "'jump_m':30,'azimuth_deg':90", {.jump_m = {30.0, 0.0}}},
    {"receiver.frozen_time", "", {.frozen_time = true}},
    {"receiver.bad_checksum", "", {.checksum_probability = 1.0}},
    {"receiver.wrong_week", "'weeks':-1024", {.weeks = -1024}},
};

static bool is_of_receiver(const struct fault_kind *k)
{
    return strncmp(k->name, "receiver.", 9) == 0;
}

static void each_kind_reaches_the_receiver_and_leaves_it(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        const uint32_t id = added(rows[i].kind, rows[i].values);
        assert_wrong(&rows[i].due);
        clear(id);
        assert_wrong(&none);
    }
}

static void each_kind_of_the_table_has_a_row_here(void **state)
{
    const struct fault_kind *k;
    size_t kinds = 0;
    (void)state;
    for (unsigned i = 0; (k = fault_kind(i)) != NULL; i++) kinds += is_of_receiver(k);
    assert_int_equal(kinds, COUNT(rows));
}

static void they_fit_nowhere_else(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        unsigned fit = 0;
        struct fault f = {.kind = fault_kind_find(rows[i].kind)};
        f.value[FAULT_WEEKS] = 1.0;
        for (struct fault_points at = {0}; fault_point_next(&r.view, &at, &f.point, f.name);) {
            char why[CONTROL_WHY_MAX] = "";
            const bool fits = fault_fits(&r.view, &f, why);
            fit += fits;
            assert_true(!fits || strcmp(f.name, "g.solver") == 0);
        }
        assert_int_equal(fit, 1);
        assert_int_equal(add(rows[i].kind, "p.kpsa", rows[i].values), 0);
        assert_non_null(strstr(r.control.error.why, "p.kpsa: expected a satellite receiver, got a PSA-2"));
    }
}

static void weeks_are_whole(void **state)
{
    (void)state;
    assert_int_equal(add("receiver.wrong_week", "g.solver", "'weeks':1.5"), 0);
    assert_non_null(strstr(r.control.error.why, "weeks: expected whole weeks, got 1.5"));
}

/* Whatever is added later, a ramp goes on from where it began. */
static void those_of_a_kind_add_up(void **state)
{
    (void)state;
    const uint32_t ramp = added("receiver.spoof", "'ramp_mps':5");
    sched_run_until(&r.s, 2000 * MS);
    added("receiver.jump", "'jump_m':30");
    const uint32_t jump = added("receiver.jump", "'jump_m':-10,'azimuth_deg':90");
    const uint32_t back = added("receiver.jump", "'jump_m':3,'azimuth_deg':90");
    added("receiver.bad_checksum", "'probability':0.5");
    added("receiver.bad_checksum", "'probability':0.5");
    added("receiver.wrong_week", "'weeks':2");
    added("receiver.wrong_week", "'weeks':3");
    struct board_receiver_faults due = {.rate_mps = {0.0, 5.0},
                                        .base_m = {0.0, 10.0},
                                        .jump_m = {-7.0, 30.0},
                                        .checksum_probability = 0.75,
                                        .weeks = 5};
    assert_wrong(&due);
    clear(ramp);
    clear(jump);
    clear(back);
    due.rate_mps[1] = due.base_m[1] = due.jump_m[0] = 0.0;
    assert_wrong(&due);
}

/* Frozen words are a fault at the same point, of the table of controllers. */
static void faults_of_other_tables_at_its_point_are_none_of_its_own(void **state)
{
    (void)state;
    const uint32_t frozen = added("controller.frozen_words", "");
    const uint32_t jump = added("receiver.jump", "'jump_m':30");
    assert_wrong(&(struct board_receiver_faults){.jump_m = {0.0, 30.0}});
    assert_int_equal(r.unit[0].board->faults, RECEIVER_FAULT_FROZEN_WORDS);
    clear(frozen);
    assert_wrong(&(struct board_receiver_faults){.jump_m = {0.0, 30.0}});
    assert_int_equal(r.unit[0].board->faults, 0);
    clear(jump);
    assert_wrong(&none);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(each_kind_reaches_the_receiver_and_leaves_it, fresh),
        cmocka_unit_test_setup(each_kind_of_the_table_has_a_row_here, fresh),
        cmocka_unit_test_setup(they_fit_nowhere_else, fresh),
        cmocka_unit_test_setup(weeks_are_whole, fresh),
        cmocka_unit_test_setup(those_of_a_kind_add_up, fresh),
        cmocka_unit_test_setup(faults_of_other_tables_at_its_point_are_none_of_its_own, fresh),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* What every unit on CAN has: counters, identity, texts, resets. */
#include "node_rig.h"

/* ---- what every unit has ---- */

static void counters_of_the_board_are_found_by_their_names(void **state)
{
    (void)state;
    static const struct co_device *const devices[] = {&psd1_device, &pmka_device, &pik_device};
    for (unsigned k = 0; k < sizeof devices / sizeof devices[0]; k++) {
        struct rig *r = rig_of_device(devices[k], 1000000);
        const unsigned n = devices[k]->counter_count;
        for (unsigned i = 0; i < n; i++) r->board.counter[i] = 1000 + i;
        for (unsigned i = 0; i < n; i++)
            assert_int_equal(upload(r, PSD1_OD_COUNTERS, (uint8_t)(devices[k]->counter_sub + i)), 1000 + n - 1 - i);
        assert_int_equal(upload(r, PSD1_OD_COUNTERS, (uint8_t)(devices[k]->counter_sub + n)), CO_AB_NO_SUB);
        assert_int_equal(upload(r, PSD1_OD_COUNTERS, 0), devices[k]->counter_sub + n - 1);
    }
}

/* In whatever order the board has them. */
static void the_order_of_the_board_s_counters_does_not_matter(void **state)
{
    (void)state;
    static const char *const names[] = {"one", "two", "three"};
    static struct co_device d;
    d = psd1_device;
    d.counters = names;
    d.counter_count = 3;
    struct rig *r = rig_of_device(&d, 1000000);
    for (unsigned i = 0; i < 3; i++) r->board.counter[i] = 10 + i; /* three, two, one */
    for (unsigned i = 0; i < 3; i++) {
        const struct co_entry e = {.index = PSD1_OD_COUNTERS, .sub = (uint8_t)(d.counter_sub + i)};
        struct co_value v = {0};
        assert_int_equal(r->can.node.io.read(r->can.node.io.ctx, &e, &v, 0), CO_OK);
        assert_int_equal((int)v.number, 12 - (int)i);
    }
}

static void error_counters_read_255_at_most(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    r->can.node.services.tec = 300;
    r->can.node.services.rec = 17;
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, TEC), 255);
    r->can.node.services.rec = 17; /* a frame that passes counts it down */
    const uint32_t rec = upload(r, PSD1_OD_COUNTERS, REC);
    assert_in_range(rec, 16, 17);
}

/* The numbers that node.c knows are in every device's table. */
static void every_device_has_the_common_objects(void **state)
{
    (void)state;
    static const struct co_device *const devices[] = {&psd1_device, &pmka_device, &pik_device};
    for (unsigned k = 0; k < sizeof devices / sizeof devices[0]; k++) {
        struct rig *r = rig_of_device(devices[k], 1000000);
        assert_int_equal(upload(r, 0x1018, 4), 4711);
        r->board.accept = BOARD_CYCLE_NOT_READY;
        assert_int_equal(upload(r, 0x2002, 1), 0x08000022);
        assert_string_not_equal(upload_text(r, 0x2031), "");
        assert_int_equal(upload(r, 0x2051, 0), 0);
        write_u32(r, 0x2040, 0, 0x64636261);
        assert_false(aborted(r));
        assert_int_equal(upload(r, 0x2040, 0), 0x64636261);
    }
}

static void objects_of_the_board_s_own_go_to_its_handlers(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    r->board.counter[0] = 5;
    struct co_value v = {0};
    const struct co_entry e = {.index = OWN_OBJECT};
    assert_int_equal(r->can.node.io.read(r->can.node.io.ctx, &e, &v, 0), CO_OK);
    assert_int_equal((int)v.number, 40005);
    assert_int_equal(r->can.node.io.write(r->can.node.io.ctx, &e, &v, 0), CO_AB_NO_OBJECT);
    const struct co_entry missing = {.index = 0x5FFF};
    assert_int_equal(r->can.node.io.read(r->can.node.io.ctx, &missing, &v, 0), CO_AB_NO_OBJECT);
}

static void reset_node_resets_the_board_and_its_settings(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    const unsigned before = r->defaults;
    assert_int_equal(before, 1);
    write_u32(r, PSD1_OD_STROBE_NS, 0, 77);
    r->board.accept = BOARD_CYCLE_NOT_READY;
    assert_int_equal(upload(r, PSD1_OD_BUS, 1), 0x08000022);
    r->board.accept = BOARD_CYCLE_OK;
    ask(r, 0x40, PSD1_OD_BUS, 1, 0); /* a cycle is under way */
    nmt(r, 130);
    assert_int_equal(r->board.resets, 0);
    assert_int_equal(upload(r, PSD1_OD_STROBE_NS, 0), 77);
    assert_string_not_equal(upload_text(r, PSD1_OD_REFUSAL), "");
    nmt(r, 129);
    assert_int_equal(r->board.resets, 1);
    assert_int_equal(r->defaults, before + 1);
    assert_null(seen_id(r, 0x580 + NODE)); /* communication began again: no answer to what was asked before */
    assert_int_equal(upload(r, PSD1_OD_STROBE_NS, 0), 0);
    assert_string_equal(upload_text(r, PSD1_OD_REFUSAL), "");
}

static void power_forgets_the_remark(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    write_u32(r, PSD1_OD_REMARK, 0, 0x64636261);
    write_u32(r, PSD1_OD_STROBE_NS, 0, 77);
    board_node_power_down(&r->can);
    board_node_power_up(&r->can, r->s.now_ns);
    settle(r);
    assert_string_equal(r->can.remark, "");
    assert_int_equal(upload(r, PSD1_OD_STROBE_NS, 0), 0);
}

static void sync_and_start_reach_the_board(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    host_sends(r, 0x80, 0, NULL);
    assert_int_equal(r->syncs, 1);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, SYNCS), 1);
    assert_int_equal(r->starts, 0);
    nmt(r, 1);
    assert_int_equal(r->starts, 1);
}

static void cut_frames_are_counted_and_not_answered(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    r->count = 0;
    host_sends(r, 0x600 + NODE, 4, (const uint8_t[]){0x40, 0x02, 0x20, 0x01});
    assert_int_equal(r->count, 0);
    assert_int_equal(r->board.submits, 0);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, MALFORMED), 1);
}

static void a_board_says_in_words_why_it_refused_a_setting(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    board_node_reject_stream(&r->can, "refused: no such gain", r->s.now_ns);
    board_node_reject_stream(&r->can, "refused: no such gain", r->s.now_ns);
    assert_string_equal(upload_text(r, PSD1_OD_REFUSAL), "refused: no such gain");
    assert_string_equal(r->told, "unit refused: no such gain");
    assert_int_equal(r->refusals, 1);
    board_node_reject_stream(&r->can, "refused: no such rate", r->s.now_ns);
    assert_int_equal(r->refusals, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(counters_of_the_board_are_found_by_their_names),
        cmocka_unit_test(the_order_of_the_board_s_counters_does_not_matter),
        cmocka_unit_test(error_counters_read_255_at_most),
        cmocka_unit_test(every_device_has_the_common_objects),
        cmocka_unit_test(objects_of_the_board_s_own_go_to_its_handlers),
        cmocka_unit_test(reset_node_resets_the_board_and_its_settings),
        cmocka_unit_test(power_forgets_the_remark),
        cmocka_unit_test(sync_and_start_reach_the_board),
        cmocka_unit_test(cut_frames_are_counted_and_not_answered),
        cmocka_unit_test(a_board_says_in_words_why_it_refused_a_setting),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Readings of a board on CAN: what flows, what does not fit, what the bus does not take. */
#include "node_rig.h"

/* ---- stream ---- */

static void readings(struct rig *r, unsigned n)
{
    for (unsigned i = 0; i < n; i++) {
        struct can_msg m = {.len = 8, .data = {(uint8_t)i, 1, 2, 3}};
        board_node_stream(&r->can, PSD1_CYCLE_TPDO, &m, 1, r->s.now_ns);
        sched_run_until(&r->s, r->s.now_ns + r->board.period_ns);
    }
}

static unsigned count_id(const struct rig *r, uint32_t id)
{
    unsigned n = 0;
    for (unsigned i = 0; i < r->count; i++) n += r->seen[i].id == id;
    return n;
}

static void readings_flow_while_operational(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    readings(r, 2);
    nmt(r, 1);
    readings(r, 3);
    assert_int_equal(count_id(r, 0x180 + NODE), 3);
    assert_int_equal(r->seen[0].data[3], 3);
    nmt(r, 128);
    readings(r, 2);
    assert_int_equal(count_id(r, 0x180 + NODE), 0);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, READINGS), 7);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, DROPPED), 0);
}

/* 135 us a frame at 1 Mbit/s, 1080 us at 125 kbit/s: 1000 readings a second want 1000 us. */
static void a_stream_that_does_not_fit_stands_and_says_why(void **state)
{
    (void)state;
    struct rig *r = rig_of_device(&psd1_device, 125000);
    nmt(r, 1);
    assert_int_equal(r->refusals, 1);
    assert_string_equal(r->told,
                        "unit refused: a reading is 1 frame, at worst 1080.000 us at 125000 bit/s, and due every "
                        "1000.000 us (1000 /s): 108.0 % of the bus");
    assert_int_equal(bits_get_le(seen_id(r, 0x80 + NODE)->data, 2), PSD1_EMCY_STREAM_REFUSED);
    readings(r, 5);
    assert_int_equal(count_id(r, 0x180 + NODE), 0);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, DROPPED), 5);
    assert_string_equal(upload_text(r, PSD1_OD_REFUSAL), r->told + sizeof "unit " - 1);
    nmt(r, 130);
    nmt(r, 1); /* told again after a reset of communication */
    assert_int_equal(bits_get_le(seen_id(r, 0x80 + NODE)->data, 2), PSD1_EMCY_STREAM_REFUSED);
    assert_int_equal(r->refusals, 2);
    r->board.period_ns = 1080000;
    r->count = 0;
    readings(r, 3);
    settle(r);
    assert_int_equal(count_id(r, 0x180 + NODE), 3);
    assert_int_equal(bits_get_le(seen_id(r, 0x80 + NODE)->data, 2), 0);
    assert_string_equal(upload_text(r, PSD1_OD_REFUSAL), "");
    assert_int_equal(r->refusals, 2);
}

static void a_stream_at_the_pace_of_sync_is_not_judged(void **state)
{
    (void)state;
    struct rig *r = rig_of_device(&psd1_device, 125000);
    ask(r, 0x2F, 0x1800, 2, 1);
    assert_false(aborted(r));
    nmt(r, 1);
    assert_int_equal(r->refusals, 0);
    readings(r, 3);
    assert_int_equal(count_id(r, 0x180 + NODE), 0);
    host_sends(r, 0x80, 0, NULL);
    assert_int_equal(count_id(r, 0x180 + NODE), 1);
}

/* More than the backlog at once: dropped whole, counted, told once, and calm again after a second without a loss. */
static void what_the_bus_does_not_take_is_dropped_counted_and_told(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    nmt(r, 1);
    for (unsigned i = 0; i < CO_PDO_BACKLOG + 4; i++) {
        struct can_msg m = {.len = 8};
        board_node_stream(&r->can, PSD1_CYCLE_TPDO, &m, 1, r->s.now_ns);
    }
    settle(r);
    assert_int_equal(count_id(r, 0x180 + NODE), CO_PDO_BACKLOG);
    assert_int_equal(count_id(r, 0x80 + NODE), 1);
    assert_int_equal(bits_get_le(seen_id(r, 0x80 + NODE)->data, 2), PSD1_EMCY_CAN_OVERRUN);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, DROPPED), 4);
    r->count = 0;
    readings(r, 1);
    assert_int_equal(count_id(r, 0x80 + NODE), 0);
    sched_run_until(&r->s, r->s.now_ns + BOARD_NODE_CALM_NS);
    readings(r, 1);
    assert_int_equal(bits_get_le(seen_id(r, 0x80 + NODE)->data, 2), 0);
}

/* A device made here, with a second TPDO that is off. */
static void a_tpdo_that_is_off_flows_once_the_host_says_so(void **state)
{
    (void)state;
    static const uint8_t len[] = {8};
    static struct co_device d;
    d = psd1_device;
    d.tpdos = 1;
    d.tpdo_len = len;
    d.tpdo_off = 1;
    struct rig *r = rig_of_device(&d, 1000000);
    nmt(r, 1);
    readings(r, 2);
    assert_int_equal(count_id(r, 0x180 + NODE), 0);
    assert_int_equal(upload(r, 0x1800, 1), 0xC0000180 + NODE);
    write_u32(r, 0x1800, 1, 0x40000180 + NODE);
    assert_false(aborted(r));
    readings(r, 2);
    assert_int_equal(count_id(r, 0x180 + NODE), 2);
    nmt(r, 130);
    assert_int_equal(upload(r, 0x1800, 1), 0xC0000180 + NODE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(readings_flow_while_operational),
        cmocka_unit_test(a_stream_that_does_not_fit_stands_and_says_why),
        cmocka_unit_test(a_stream_at_the_pace_of_sync_is_not_judged),
        cmocka_unit_test(what_the_bus_does_not_take_is_dropped_counted_and_told),
        cmocka_unit_test(a_tpdo_that_is_off_flows_once_the_host_says_so),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* The UDS door of a board's node: frames on the bus, beside the SDO server. */
#include "node_rig.h"

#include "canopen/uds_door.h"
#include "gen/gyro_od.h"
#include "gen/psa2_od.h"
#include "gen/uds_dids.h"

enum { ECU = 1, REQUEST = 0x7E0, RESPONSE = 0x7E8, TO_ALL = 0x7DF };

static struct uds_door door;

static struct rig *door_up(uint32_t bitrate_hz)
{
    struct rig *r = rig_of_device(&psd1_device, bitrate_hz);
    uds_door_init(&door, ECU, &uds_dids, &r->can.node);
    return r;
}

/* A single frame with these bytes, each a character of text. */
static void put_single(struct rig *r, uint32_t id, uint8_t n, const char *text)
{
    uint8_t data[8] = {n};
    memcpy(&data[1], text, n);
    host_put(&r->bus, &r->host, id, (uint8_t)(n + 1), data);
}

static void say(struct rig *r, uint32_t id, uint8_t n, const char *text)
{
    r->count = 0;
    put_single(r, id, n, text);
    settle(r);
}

static unsigned seen_count(const struct rig *r, uint32_t id)
{
    unsigned n = 0;
    for (unsigned i = 0; i < r->count; i++) n += r->seen[i].id == id;
    return n;
}

static void expect(const struct rig *r, uint8_t n, const char *text)
{
    const struct can_msg *m = seen_id(r, RESPONSE);
    assert_non_null(m);
    if (!m) return;
    assert_int_equal(m->len, 8);
    assert_int_equal(m->data[0], n);
    assert_memory_equal(&m->data[1], text, n);
}

static void done(struct rig *r, uint16_t data)
{
    struct board_cycle *c = r->board.cycle;
    assert_non_null(c);
    r->board.cycle = NULL;
    c->data = data;
    c->done(c->ctx, c, BOARD_CYCLE_OK, r->s.now_ns);
    settle(r);
}

static void to_extended(struct rig *r)
{
    say(r, REQUEST, 2, "\x10\x03");
    expect(r, 6, "\x50\x03\x00\x32\x01\xF4");
}

/* 2002h:3 is DID 2083h: 2000h + 40h * 2 + 3. */
static void an_object_is_the_same_over_both_doors(void **state)
{
    (void)state;
    struct rig *r = door_up(1000000);
    say(r, REQUEST, 3, "\x22\xF1\x8C");
    expect(r, 7, "\x62\xF1\x8C\x67\x12\x00\x00");
    assert_int_equal(upload(r, 0x1018, 4), 4711);
    to_extended(r);
    say(r, REQUEST, 7, "\x2E\x34\x40\x40\x06\x00\x00"); /* 2051h:0 = 1600 */
    expect(r, 3, "\x6E\x34\x40");
    assert_int_equal(upload(r, PSD1_OD_STROBE_NS, 0), 1600);
    say(r, REQUEST, 5, "\x2E\x20\x83\xEF\xBE");
    assert_true(r->board.cycle->write);
    assert_int_equal(r->board.cycle->strobe_ns, 1600);
    assert_null(seen_id(r, RESPONSE));
    done(r, 0);
    expect(r, 3, "\x6E\x20\x83");
    say(r, REQUEST, 3, "\x22\x20\x83");
    done(r, 0xA55A);
    expect(r, 5, "\x62\x20\x83\x5A\xA5");
    assert_null(seen_id(r, 0x580 + NODE));
}

static void one_access_at_a_time_whichever_door(void **state)
{
    (void)state;
    struct rig *r = door_up(1000000);
    ask(r, 0x40, PSD1_OD_BUS, 3, 0); /* SDO has one under way */
    put_single(r, REQUEST, 3, "\x22\x20\x83");
    settle(r);
    expect(r, 3, "\x7F\x22\x22");
    done(r, 0x1111);
    assert_int_equal(answer(r) & 0xFFFF, 0x1111);
    assert_int_equal(seen_count(r, RESPONSE), 1);
    say(r, REQUEST, 3, "\x22\x20\x83"); /* UDS has one under way */
    ask(r, 0x40, PSD1_OD_BUS, 3, 0);
    assert_true(aborted(r));
    assert_int_equal(answer(r), CO_AB_STATE);
    assert_int_equal(upload(r, 0x1018, 4), 4711);
    r->count = 0;
    done(r, 0x2222);
    expect(r, 5, "\x62\x20\x83\x22\x22");
    assert_null(seen_id(r, 0x580 + NODE));
}

/* A segmented download waits for its last segment while UDS begins an access. */
static void an_answer_goes_to_the_door_that_asked(void **state)
{
    (void)state;
    struct rig *r = door_up(1000000);
    ask(r, 0x21, PSD1_OD_REMARK, 0, 9);
    say(r, REQUEST, 3, "\x22\x20\x83");
    host_sends(r, 0x600 + NODE, 8, (const uint8_t[]){0x00, 'a', 'b', 'c', 'd', 'e', 'f', 'g'});
    r->count = 0;
    host_sends(r, 0x600 + NODE, 8, (const uint8_t[8]){0x1B, 'h', 'i'});
    assert_int_equal(seen_id(r, 0x580 + NODE)->data[0], 0x30);
    assert_string_equal(upload_text(r, PSD1_OD_REMARK), "abcdefghi");
    r->count = 0;
    done(r, 0x3333);
    expect(r, 5, "\x62\x20\x83\x33\x33");
    assert_int_equal(r->count, 1);
}

static void a_given_up_access_disturbs_no_later_one(void **state)
{
    (void)state;
    struct rig *r = door_up(1000000);
    say(r, REQUEST, 3, "\x22\x20\x83");
    sched_run_until(&r->s, r->s.now_ns + UDS_ACCESS_NS);
    expect(r, 3, "\x7F\x22\x10");
    struct board_cycle *late = r->board.cycle;
    ask(r, 0x40, PSD1_OD_BUS, 3, 0);
    assert_int_equal(answer(r), CO_AB_STATE);
    r->count = 0;
    r->board.cycle = NULL;
    late->done(late->ctx, late, BOARD_CYCLE_OK, r->s.now_ns);
    settle(r);
    assert_int_equal(seen_count(r, RESPONSE) + seen_count(r, 0x580 + NODE), 0);
    assert_int_equal(upload(r, 0x1018, 4), 4711);
}

/* A ticket that comes round to 0 is not the door's, which has had none yet. */
static void an_sdo_access_is_never_taken_for_the_door_s(void **state)
{
    (void)state;
    struct rig *r = door_up(1000000);
    r->can.node.sdo.ticket = UINT32_MAX;
    ask(r, 0x40, PSD1_OD_BUS, 3, 0);
    assert_int_equal(r->can.ticket, door.ticket);
    done(r, 0x4444);
    assert_int_equal(answer(r) & 0xFFFF, 0x4444);
}

static void ecu_reset_is_a_reset_of_the_node_after_its_response(void **state)
{
    (void)state;
    struct rig *r = door_up(1000000);
    to_extended(r);
    say(r, REQUEST, 2, "\x11\x01");
    assert_int_equal(r->board.resets, 1);
    assert_int_equal(r->count, 2);
    assert_int_equal(r->seen[0].id, RESPONSE);
    assert_memory_equal(r->seen[0].data, "\x02\x51\x01", 3);
    assert_int_equal(r->seen[1].id, 0x700 + NODE); /* boot-up */
    assert_int_equal(r->seen[1].data[0], 0);
    say(r, REQUEST, 3, "\x22\xF1\x86");
    expect(r, 4, "\x62\xF1\x86\x01");
}

static void the_door_follows_the_node_s_state(void **state)
{
    (void)state;
    struct rig *r = door_up(1000000);
    to_extended(r);
    nmt(r, 1);
    say(r, REQUEST, 3, "\x22\xF1\x86"); /* start changes nothing */
    expect(r, 4, "\x62\xF1\x86\x03");
    nmt(r, 2);
    say(r, REQUEST, 2, "\x3E\x00");
    assert_null(seen_id(r, RESPONSE));
    nmt(r, 128);
    say(r, REQUEST, 3, "\x22\xF1\x86"); /* stop has ended the session */
    expect(r, 4, "\x62\xF1\x86\x01");
    say(r, REQUEST, 3, "\x22\x20\x83");
    nmt(r, 129);
    assert_null(seen_id(r, RESPONSE)); /* the access is dropped with the cycle */
    board_node_power_down(&r->can);
    settle(r);
    board_node_power_up(&r->can, r->s.now_ns);
    settle(r);
    say(r, REQUEST, 2, "\x3E\x00");
    expect(r, 2, "\x7E\x00");
}

static void requests_to_all_are_single_frames(void **state)
{
    (void)state;
    struct rig *r = door_up(1000000);
    say(r, TO_ALL, 2, "\x3E\x00");
    expect(r, 2, "\x7E\x00");
    say(r, TO_ALL, 2, "\x27\x01");
    assert_null(seen_id(r, RESPONSE));
    host_sends(r, TO_ALL, 8, (const uint8_t[]){0x10, 0x14, 0x22, 0xF1, 0x8C, 0xF1, 0x86, 0xF1});
    assert_null(seen_id(r, RESPONSE));
    assert_int_equal(door.refused, 1);
}

static void frames_that_are_not_for_the_door_pass_it(void **state)
{
    (void)state;
    static const struct {
        struct can_msg m;
        unsigned refused;
    } row[] = {
        {{.id = REQUEST, .len = 3, .data = {2, 0x3E, 0}, .flags = CAN_EXT}, 0},
        {{.id = REQUEST + 1, .len = 3, .data = {2, 0x3E, 0}}, 0}, /* ECU 2 */
        {{.id = RESPONSE, .len = 3, .data = {2, 0x3E, 0}}, 0},
        {{.id = REQUEST, .len = 3, .flags = CAN_RTR}, 1},
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct rig *r = door_up(1000000);
        r->count = 0;
        assert_int_equal(can_send(&r->bus, &r->host, &row[i].m, r->s.now_ns), CAN_OK);
        settle(r);
        assert_int_equal(r->count, 0);
        assert_int_equal(door.refused, row[i].refused);
        assert_int_equal(door.server.requests, 0);
    }
}

/* 62 bytes of a remark and its identifier, in blocks of two with 10 ms between frames. */
static void a_long_response_obeys_flow_control_on_the_bus(void **state)
{
    (void)state;
    struct rig *r = door_up(125000);
    memset(r->can.remark, 'x', 62);
    say(r, REQUEST, 3, "\x22\x30\x00");
    assert_memory_equal(seen_id(r, RESPONSE)->data, "\x10\x41\x62\x30\x00xxx", 8);
    for (unsigned block = 0; block < 4; block++) {
        r->count = 0;
        host_put(&r->bus, &r->host, REQUEST, 3, (const uint8_t[]){0x30, 2, 10});
        settle(r);
        assert_int_equal(seen_count(r, RESPONSE), 1);
        sched_run_until(&r->s, r->s.now_ns + 50 * 1000000);
        assert_int_equal(seen_count(r, RESPONSE), 2);
    }
    r->count = 0;
    host_put(&r->bus, &r->host, REQUEST, 3, (const uint8_t[]){0x30, 0, 0});
    settle(r);
    assert_int_equal(seen_count(r, RESPONSE), 1); /* 6 + 8 * 7 + 3 */
    assert_memory_equal(seen_id(r, RESPONSE)->data, "\x29xxx\xCC\xCC\xCC\xCC", 8);
    say(r, REQUEST, 2, "\x3E\x00");
    expect(r, 2, "\x7E\x00");
}

static void a_stop_ends_messages_both_ways(void **state)
{
    (void)state;
    struct rig *r = door_up(1000000);
    memset(r->can.remark, 'x', 62);
    say(r, REQUEST, 3, "\x22\x30\x00");
    nmt(r, 2);
    nmt(r, 128);
    host_sends(r, REQUEST, 3, (const uint8_t[]){0x30, 0, 0});
    assert_int_equal(seen_count(r, RESPONSE), 0);
    host_sends(r, REQUEST, 8, (const uint8_t[]){0x10, 8, 0x22, 0xF1, 0x86, 0xF1, 0x86, 0xF1});
    nmt(r, 2);
    nmt(r, 128);
    host_sends(r, REQUEST, 8, (const uint8_t[]){0x21, 0x86, 0x86, 0, 0, 0, 0, 0});
    assert_int_equal(seen_count(r, RESPONSE), 0);
}

static void a_message_that_fails_leaves_the_door_open(void **state)
{
    (void)state;
    struct rig *r = door_up(1000000);
    memset(r->can.remark, 'x', 62);
    say(r, REQUEST, 3, "\x22\x30\x00");
    sched_run_until(&r->s, r->s.now_ns + ISOTP_TIMEOUT_NS); /* no flow control */
    assert_int_equal(door.transport.failed[ISOTP_TIMEOUT_BS], 1);
    say(r, REQUEST, 2, "\x3E\x00");
    expect(r, 2, "\x7E\x00");
    to_extended(r);
    host_sends(r, REQUEST, 8, (const uint8_t[]){0x10, 0x14, 0x2E, 0x30, 0x00, 'a', 'b', 'c'});
    host_sends(r, REQUEST, 8, (const uint8_t[]){0x22, 'd', 'e', 'f', 'g', 'h', 'i', 'j'});
    assert_int_equal(door.transport.failed[ISOTP_WRONG_SN], 1);
    sched_run_until(&r->s, r->s.now_ns + UDS_S3_NS);
    assert_int_equal(door.server.session, UDS_SESSION_DEFAULT);
}

static void trouble_codes_are_the_node_s_errors(void **state)
{
    (void)state;
    struct rig *r = door_up(1000000);
    co_node_error(&r->can.node, 0x8120, 0x11, 3, r->s.now_ns);
    co_node_error(&r->can.node, 0x8140, 0x11, 3, r->s.now_ns);
    co_node_error_end(&r->can.node, 0x8140, r->s.now_ns);
    say(r, REQUEST, 3, "\x19\x01\xFF");
    expect(r, 6, "\x59\x01\x09\x01\x00\x02");
    say(r, REQUEST, 3, "\x19\x02\x01");
    expect(r, 7, "\x59\x02\x09\x81\x20\x00\x09");
    say(r, REQUEST, 4, "\x14\xFF\xFF\xFF");
    expect(r, 1, "\x54");
    assert_int_equal(upload(r, 0x1003, 0), 0);
    say(r, REQUEST, 3, "\x19\x02\xFF"); /* still failed */
    expect(r, 7, "\x59\x02\x09\x81\x20\x00\x01");
}

/* From identifier to entry there is one rule, so as many identifiers as entries mean one each. */
static void each_object_of_each_board_has_one_identifier_by_the_rule(void **state)
{
    (void)state;
    static const struct co_od *const od[] = {&psa2_od, &psd1_od, &pmka_od, &pik_od, &gyro_od};
    for (size_t i = 0; i < COUNT(od); i++) {
        unsigned found = 0, again = 0;
        for (unsigned did = 0; did <= 0xFFFF; did++) {
            const struct co_entry *e = uds_did_entry(&uds_dids, od[i], (uint16_t)did);
            if (did < 0xF000) found += e != NULL;
            else again += e != NULL;
            if (e && did >= 0x2000 && did < 0x4000)
                assert_int_equal(did, 0x2000 + 0x40 * (e->index - 0x2000u) + e->sub);
        }
        assert_int_equal(found, od[i]->count);
        assert_int_equal(again, 6);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_object_is_the_same_over_both_doors),
        cmocka_unit_test(one_access_at_a_time_whichever_door),
        cmocka_unit_test(an_answer_goes_to_the_door_that_asked),
        cmocka_unit_test(a_given_up_access_disturbs_no_later_one),
        cmocka_unit_test(an_sdo_access_is_never_taken_for_the_door_s),
        cmocka_unit_test(ecu_reset_is_a_reset_of_the_node_after_its_response),
        cmocka_unit_test(the_door_follows_the_node_s_state),
        cmocka_unit_test(requests_to_all_are_single_frames),
        cmocka_unit_test(frames_that_are_not_for_the_door_pass_it),
        cmocka_unit_test(a_long_response_obeys_flow_control_on_the_bus),
        cmocka_unit_test(a_stop_ends_messages_both_ways),
        cmocka_unit_test(a_message_that_fails_leaves_the_door_open),
        cmocka_unit_test(trouble_codes_are_the_node_s_errors),
        cmocka_unit_test(each_object_of_each_board_has_one_identifier_by_the_rule),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* PSA-2 on CAN: what the bus can carry is taken or refused, and what it does not take is counted (sources can 3.1). */
#include "psa2_can_rig.h"

static const char *refusal(struct rig *r)
{
    static char text[256];
    size_t at = 0;
    ask(r, 0x40, PSA2_OD_REFUSAL, 0, 0);
    for (uint8_t toggle = 0; at + 7 < sizeof text; toggle ^= 0x10) {
        ask(r, (uint8_t)(0x60 | toggle), 0, 0, 0);
        const struct can_msg *m = seen_id(r, 0x580 + NODE);
        assert_non_null(m);
        if (!m) break;
        memcpy(&text[at], &m->data[1], 7);
        at += 7u - (m->data[0] >> 1 & 7u);
        if (m->data[0] & 1) break;
    }
    text[at] = '\0';
    return text;
}

/* ---- what the bus can carry: sources can 3.1 ---- */

static void forms_are_taken_or_refused_by_the_worst_case(void **state)
{
    (void)state;
    static const struct {
        uint32_t bitrate_hz, data_bitrate_hz, data_hz;
        uint8_t form;
        uint32_t want;
    } row[] = {
        {1000000, 0, 2000, PSA2_FORM_PAIR, 0},                 /* 54 % */
        {1000000, 0, 4000, PSA2_FORM_PAIR, CO_AB_STATE},       /* 108 % */
        {1000000, 0, 4000, PSA2_FORM_FAST, 0},                 /* 54 % */
        {500000, 0, 4000, PSA2_FORM_FAST, CO_AB_STATE},        /* 108 % */
        {500000, 0, 2000, PSA2_FORM_PAIR, CO_AB_STATE},        /* 108 % */
        {500000, 0, 1000, PSA2_FORM_PAIR, 0},                  /* 54 % */
        {125000, 0, 250, PSA2_FORM_PAIR, 0},                   /* 54 % */
        {125000, 0, 500, PSA2_FORM_PAIR, CO_AB_STATE},         /* 108 % */
        {1000000, 0, 250, PSA2_FORM_FRAME, CO_AB_STATE},       /* no FD */
        {1000000, 0, 250, PSA2_FORM_BLOCK, CO_AB_STATE},       /* no FD */
        {1000000, 5000000, 4000, PSA2_FORM_FRAME, 0},          /* 29 % */
        {1000000, 5000000, 4000, PSA2_FORM_BLOCK, 0},          /* 14 % */
        {1000000, 5000000, 4000, PSA2_FORM_PAIR, CO_AB_STATE}, /* as on a classic bus */
        {125000, 500000, 4000, PSA2_FORM_FRAME, CO_AB_STATE},  /* 263 % */
        {0, 0, 4000, PSA2_FORM_PAIR, 0},                       /* ideal bus */
        {0, 0, 4000, PSA2_FORM_FRAME, CO_AB_STATE},            /* ideal, but classic */
        {0, 1, 4000, PSA2_FORM_FRAME, 0},                      /* ideal and FD */
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct rig *r = rig_up(row[i].bitrate_hz, row[i].data_bitrate_hz, row[i].data_hz);
        /* from a form or rate that fits for sure */
        r->info.period_ns = NS_PER_S;
        assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FAST), 0);
        r->info.period_ns = NS_PER_S / row[i].data_hz;
        assert_int_equal(write_u8(r, 0x2020, 0, row[i].form), row[i].want);
        const bool refused = row[i].want != 0;
        assert_int_equal(upload(r, 0x2020, 0) & 0xFF, refused ? PSA2_FORM_FAST : row[i].form);
        assert_int_equal(strncmp(refusal(r), "refused: ", 9) == 0, refused);
    }
}

static void a_refusal_shows_its_arithmetic_and_ends_with_a_form_that_fits(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 4000);
    assert_string_equal(refusal(r), "refused: form 0 (pair) is 2 frames, at worst 270.000 us at 1000000 bit/s, and due "
                                    "every 250.000 us (4000 /s): 108.0 % of the bus");
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FRAME), CO_AB_STATE);
    assert_string_equal(refusal(r), "refused: form 2 (frame) needs FD frames, this bus has no data bit rate");
    assert_int_equal(upload(r, 0x1001, 0) & 0xFF, 0x81);
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FAST), 0);
    const struct can_msg *m = seen_id(r, 0x085);
    assert_non_null(m);
    assert_int_equal(bits_get_le(m->data, 2), 0);
    assert_string_equal(refusal(r), "");
    assert_int_equal(upload(r, 0x1001, 0) & 0xFF, 0);
}

static void a_refusal_is_told_to_the_listener_once_for_each_reason(void **state)
{
    (void)state;
    struct rig *r = rig_up(125000, 0, 1000);
    assert_int_equal(r->refusals, 1);
    assert_string_equal(r->told,
                        "unit refused: form 0 (pair) is 2 frames, at worst 2160.000 us at 125000 bit/s, and due "
                        "every 1000.000 us (1000 /s): 216.0 % of the bus");
    board_sends(r, 8);
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_PAIR), CO_AB_STATE);
    assert_int_equal(r->refusals, 1); /* the same reason */
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FRAME), CO_AB_STATE);
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FRAME), CO_AB_STATE);
    assert_int_equal(r->refusals, 2);
    assert_string_equal(r->told, "unit refused: form 2 (frame) needs FD frames, this bus has no data bit rate");
    r->info.period_ns = NS_PER_S / 250;
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_PAIR), 0);
    assert_int_equal(r->refusals, 2); /* the end of a refusal is no refusal */
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FRAME), CO_AB_STATE);
    assert_int_equal(r->refusals, 3); /* and after its end it is news again */
}

static void a_data_rate_that_the_form_cannot_carry_never_reaches_the_chip(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    assert_int_equal(write_u8(r, 0x2000, 2, 0x62), CO_AB_STATE); /* DR 100: 4000 SPS */
    assert_null(r->request);
    const struct can_msg *m = seen_id(r, 0x085);
    assert_non_null(m);
    assert_int_equal(bits_get_le(m->data, 2), PSA2_EMCY_STREAM_REFUSED);
    assert_int_equal(strncmp(refusal(r), "refused: form 0 (pair)", 22), 0);
    ask(r, 0x2F, 0x2003, 2, 0x5A); /* DR 011: 2000 SPS; through Y as well */
    assert_non_null(r->request);
    assert_int_equal(r->request->value, 0x5A);
    fake_done(r, PSA2_OK);
    settle(r);
    assert_int_equal(answer(r), 0);
    assert_int_equal(upload(r, 0x1001, 0) & 0xFF, 0);
}

static void a_rate_that_rises_by_itself_stops_the_stream_and_says_so(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    board_sends(r, 2);
    assert_int_equal(r->count, 4);
    r->info.period_ns = NS_PER_S / 4000;
    r->count = 0;
    board_sends(r, 8);
    assert_int_equal(count_id(r, 0x185), 0);
    assert_int_equal(count_id(r, 0x085), 1);
    assert_int_equal(upload(r, 0x2030, 3), 8);
    r->info.period_ns = NS_PER_S / 1000;
    r->count = 0;
    board_sends(r, 2);
    assert_int_equal(count_id(r, 0x185), 2);
    assert_int_equal(count_id(r, 0x085), 1); /* 0000h */
    assert_string_equal(refusal(r), "");
}

/* Two units at 54..62 % each: neither can know of the other, so the loss must show. */
static void samples_the_bus_does_not_take_are_counted_and_told(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 2000);
    struct can_node jammer = {.name = "jam"};
    can_attach(&r->bus, &jammer);
    r->count = 0;
    struct can_msg single = {.len = 8}; /* an odd backlog: room for one half only, at the end */
    assert_int_equal(co_pdo_offer(&r->can.node.node, PSA2_XY_TPDO, &single, r->s.now_ns), CO_PDO_SENT);
    for (unsigned i = 0; i < 100; i++) {
        const struct can_msg m = {.id = 0x001, .len = 8};
        while (can_room(&jammer) > 0) assert_int_equal(can_send(&r->bus, &jammer, &m, r->s.now_ns), CAN_OK);
        board_sends(r, 1);
    }
    assert_true(r->can.node.dropped > 80);
    assert_true(error_active(&r->can.node.node, PSA2_EMCY_CAN_OVERRUN));
    can_detach(&r->bus, &jammer);
    settle(r);
    assert_int_equal(count_id(r, 0x085), 1);
    assert_int_equal(count_id(r, 0x185), count_id(r, 0x285) + 1); /* halves are never lost alone */
    r->count = 0;
    board_sends(r, 2100);
    assert_int_equal(count_id(r, 0x085), 1);
    assert_int_equal(bits_get_le(seen_id(r, 0x085)->data, 2), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(forms_are_taken_or_refused_by_the_worst_case),
        cmocka_unit_test(a_refusal_shows_its_arithmetic_and_ends_with_a_form_that_fits),
        cmocka_unit_test(a_refusal_is_told_to_the_listener_once_for_each_reason),
        cmocka_unit_test(a_data_rate_that_the_form_cannot_carry_never_reaches_the_chip),
        cmocka_unit_test(a_rate_that_rises_by_itself_stops_the_stream_and_says_so),
        cmocka_unit_test(samples_the_bus_does_not_take_are_counted_and_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* PSA-2 on CAN: registers of the converters, requests of the board, abort codes, Res by NMT. */
#include "psa2_can_rig.h"

/* ---- registers ---- */

static void registers_are_read_per_chip_and_written_to_all(void **state)
{
    (void)state;
    static const struct {
        uint16_t index;
        uint8_t sub;
        enum psa2_group group;
        uint8_t addr, want;
    } row[] = {
        {0x2000, 2, PSA2_ACCEL, 1, 0xA1},
        {0x2003, 2, PSA2_ACCEL, 1, 0xA2},
        {0x2004, 11, PSA2_ACCEL, 10, 0xA3},
        {0x2001, 1, PSA2_TEMP, 0, 0xA1},
    };
    struct rig *r = rig_up(1000000, 0, 1000);
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        ask(r, 0x40, row[i].index, row[i].sub, 0);
        assert_int_equal(r->count, 0); /* not before the board has answered */
        assert_int_equal(r->request->op, PSA2_READ_REG);
        assert_int_equal(r->request->group, row[i].group);
        assert_int_equal(r->request->addr, row[i].addr);
        memcpy(r->request->answer, (const uint8_t[]){0xA1, 0xA2, 0xA3}, 3);
        fake_done(r, PSA2_OK);
        settle(r);
        assert_int_equal(answer(r), row[i].want);
    }
}

static void results_of_the_board_become_abort_codes(void **state)
{
    (void)state;
    static const struct {
        enum psa2_result submit, done;
        uint32_t want;
    } row[] = {
        {PSA2_OK, PSA2_OK, 0},
        {PSA2_NO_SUCH_REG, PSA2_OK, 0x06090011},
        {PSA2_READ_ONLY, PSA2_OK, 0x06010002},
        {PSA2_BAD_VALUE, PSA2_OK, 0x06090030},
        {PSA2_BUSY, PSA2_OK, 0x08000022},
        {PSA2_OK, PSA2_BAD_VALUE, 0x06090030},
        {PSA2_OK, PSA2_TIMEOUT, 0x08000020},
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct rig *r = rig_up(1000000, 0, 1000);
        r->accept = row[i].submit;
        ask(r, 0x2F, 0x2000, 4, 0x11);
        if (row[i].submit == PSA2_OK) fake_done(r, row[i].done);
        settle(r);
        assert_int_equal(answer(r), row[i].want);
        const bool timeout = row[i].done == PSA2_TIMEOUT;
        assert_int_equal(count_id(r, 0x085), timeout);
        if (timeout) assert_int_equal(bits_get_le(seen_id(r, 0x085)->data, 2), 0xFF01);
    }
}

static void objects_outside_the_map_have_the_codes_of_cia_301(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    assert_int_equal(upload(r, 0x2002, 0), CO_AB_NO_OBJECT); /* PSD-1's */
    assert_int_equal(upload(r, 0x2000, 12), CO_AB_NO_SUB);
    assert_int_equal(write_u8(r, 0x2000, 1, 0), CO_AB_READ_ONLY); /* ID */
    assert_int_equal(write_u8(r, 0x2020, 0, 4), CO_AB_VALUE);
    assert_int_equal(write_u8(r, 0x2021, 0, 16), CO_AB_READ_ONLY);
    assert_int_equal(upload(r, 0x2010, 1), CO_AB_WRITE_ONLY);
}

static void opcodes_reach_their_group_and_are_answered_when_accepted(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    for (uint8_t sub = 1; sub <= 2; sub++) {
        ask(r, 0x2F, 0x2010, sub, 0x04);
        assert_int_equal(r->request->op, PSA2_OPCODE);
        assert_int_equal(r->request->group, sub == 1 ? PSA2_ACCEL : PSA2_TEMP);
        assert_int_equal(r->request->value, 0x04);
        assert_int_equal(r->count, 0);
        fake_done(r, PSA2_OK);
        settle(r);
        assert_int_equal(answer(r), 0);
    }
}

static void a_client_that_gives_up_finds_the_port_busy_until_the_board_is_done(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    ask(r, 0x40, 0x2000, 2, 0);
    assert_int_equal(upload(r, 0x1000, 0), 0x194); /* other objects are served */
    assert_int_equal(upload(r, 0x2000, 3), CO_AB_STATE);
    assert_int_equal(r->request->addr, 1); /* the board still has the first, untouched */
    r->count = 0;
    fake_done(r, PSA2_OK);
    settle(r);
    assert_int_equal(r->count, 0); /* no client waits for it */
    ask(r, 0x40, 0x2000, 3, 0);
    fake_done(r, PSA2_OK);
    settle(r);
    assert_int_equal(answer(r), 0);
}

static const struct port {
    enum psa2_fault fault;
    enum psa2_group group;
    uint8_t status; /* of a frame that shows the port at work */
    uint16_t code;
    uint8_t source;
} ports[] = {
    {PSA2_FAULT_ACCEL_PORT, PSA2_ACCEL, PSA2_ST_SETTLED, 0xFF01, 1},
    {PSA2_FAULT_TEMP_PORT, PSA2_TEMP, PSA2_ST_SETTLED | PSA2_ST_TEMP_NEW, 0xFF02, 2},
};

/* The only emergency since the last look: code, error register, source. */
static void told(struct rig *r, uint16_t code, uint8_t reg, uint8_t source)
{
    settle(r);
    assert_int_equal(count_id(r, 0x085), 1);
    const struct can_msg *const m = seen_id(r, 0x085);
    if (!m) return; /* for the analyser: there is one */
    assert_int_equal(bits_get_le(m->data, 2), code);
    assert_int_equal(m->data[2], reg);
    assert_int_equal(m->data[3], source);
    r->count = 0;
}

static void not_told(struct rig *r)
{
    settle(r);
    assert_int_equal(count_id(r, 0x085), 0);
}

static void falls_silent(struct rig *r, const struct port *p)
{
    psa2_can_fault(&r->can, (uint16_t)p->fault, r->s.now_ns);
    told(r, p->code, 0x81, p->source);
    psa2_can_fault(&r->can, (uint16_t)p->fault, r->s.now_ns);
    not_told(r);
}

static void frame_with(struct rig *r, uint8_t status)
{
    struct psa2_frame f = sample(r);
    f.status = status;
    psa2_can_frame(&r->can, &f, r->s.now_ns);
}

/* A request that times out tells a fault that is not told yet; one that is carried out ends it. */
static void request_ends(struct rig *r, const struct port *p, enum psa2_result result)
{
    ask(r, 0x40, p->group == PSA2_ACCEL ? 0x2000 : 0x2001, 1, 0);
    fake_done(r, result);
}

static void a_port_fault_is_told_once_and_ends_with_data_or_a_request(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(ports); i++) {
        const struct port *const p = &ports[i], *const other = &ports[1 - i];
        struct rig *r = rig_up(1000000, 0, 1000);
        falls_silent(r, p);
        request_ends(r, other, PSA2_OK);
        if (p->group == PSA2_TEMP) frame_with(r, other->status); /* the axes go on */
        not_told(r);
        frame_with(r, p->status);
        told(r, 0, 0, 0);
        request_ends(r, p, PSA2_TIMEOUT);
        told(r, p->code, 0x81, p->source);
        request_ends(r, p, PSA2_OK);
        told(r, 0, 0, 0);
    }
}

/* ---- resets, mirrors, several units ---- */

static void reset_node_is_the_reset_pin_and_restores_defaults(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    write_u8(r, 0x2020, 0, PSA2_FORM_FAST);
    ask(r, 0x40, 0x2000, 2, 0); /* under way when the reset comes */
    nmt(r, 129);
    assert_int_equal(r->resets, 1);
    assert_null(r->request);
    assert_int_equal(upload(r, 0x2020, 0) & 0xFF, PSA2_FORM_PAIR);
    assert_int_equal(upload(r, 0x1001, 0) & 0xFF, 0); /* the time-out of the reset is no fault */
    assert_int_equal(upload(r, 0x1800, 1), 0x40000185);
    write_u8(r, 0x2020, 0, PSA2_FORM_FAST);
    nmt(r, 130);
    assert_int_equal(r->resets, 1);
    assert_int_equal(upload(r, 0x2020, 0) & 0xFF, PSA2_FORM_FAST);
    assert_int_equal(upload(r, 0x1800, 1), 0xC0000185);
    assert_int_equal(upload(r, 0x1802, 1), 0x40000385);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(registers_are_read_per_chip_and_written_to_all),
        cmocka_unit_test(results_of_the_board_become_abort_codes),
        cmocka_unit_test(objects_outside_the_map_have_the_codes_of_cia_301),
        cmocka_unit_test(opcodes_reach_their_group_and_are_answered_when_accepted),
        cmocka_unit_test(a_client_that_gives_up_finds_the_port_busy_until_the_board_is_done),
        cmocka_unit_test(a_port_fault_is_told_once_and_ends_with_data_or_a_request),
        cmocka_unit_test(reset_node_is_the_reset_pin_and_restores_defaults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

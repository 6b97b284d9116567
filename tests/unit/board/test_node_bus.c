/* The parallel bus of a board as objects: cycles, refusals, resets within one (sources can 3.3). */
#include "node_rig.h"

static void fake_done(struct rig *r, enum board_cycle_result result, uint16_t data)
{
    struct board_cycle *c = r->board.cycle;
    assert_non_null(c);
    r->board.cycle = NULL;
    c->data = data;
    c->done(c->ctx, c, result, r->s.now_ns);
}

static void write_u16(struct rig *r, uint16_t index, uint8_t sub, uint16_t value)
{
    ask(r, 0x2B, index, sub, value);
}

/* ---- bus cycles ---- */

static void a_read_is_answered_when_the_cycle_is_done(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, 0x40, PSD1_OD_BUS, 3, 0);
    assert_null(seen_id(r, 0x580 + NODE));
    assert_non_null(r->board.cycle);
    assert_false(r->board.cycle->write);
    assert_int_equal(r->board.cycle->address, 2);
    assert_int_equal(r->board.cycle->strobe_ns, 0);
    fake_done(r, BOARD_CYCLE_OK, 0xBEEF);
    settle(r);
    assert_false(aborted(r));
    assert_int_equal(answer(r) & 0xFFFF, 0xBEEF);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, CYCLES), 1);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, CYCLES_REFUSED), 0);
}

static void a_write_carries_data_and_the_strobe_that_was_set(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    write_u32(r, PSD1_OD_STROBE_NS, 0, 1600);
    assert_false(aborted(r));
    assert_int_equal(upload(r, PSD1_OD_STROBE_NS, 0), 1600);
    write_u16(r, PSD1_OD_BUS, 4, 0xA55A);
    assert_true(r->board.cycle->write);
    assert_int_equal(r->board.cycle->address, 3);
    assert_int_equal(r->board.cycle->data, 0xA55A);
    assert_int_equal(r->board.cycle->strobe_ns, 1600);
    assert_null(seen_id(r, 0x580 + NODE));
    fake_done(r, BOARD_CYCLE_OK, 0);
    settle(r);
    assert_int_equal(seen_id(r, 0x580 + NODE)->data[0], 0x60);
}

/* Sources can 3.3. */
static void each_refusal_has_its_code_its_words_and_is_counted(void **state)
{
    static const struct {
        enum board_cycle_result result;
        uint32_t abort;
        const char *words;
    } rows[] = {
        {BOARD_CYCLE_NO_ADDRESS, 0x06090011, "nothing answers"},
        {BOARD_CYCLE_READ_ONLY, 0x06010002, "read-only"},
        {BOARD_CYCLE_WRITE_ONLY, 0x06010001, "write-only"},
        {BOARD_CYCLE_NOT_READY, 0x08000022, "too early"},
        {BOARD_CYCLE_TAKEN, 0x08000022, "profile psd1_host"},
        {BOARD_CYCLE_TOO_SHORT, 0x06090030, "strobe is shorter"},
        {BOARD_CYCLE_BUSY, 0x08000022, "another cycle"},
        {BOARD_CYCLE_BAD_VALUE, 0x06090030, "value"},
        {BOARD_CYCLE_OFF, 0x08000022, "power"},
    };
    (void)state;
    struct rig *r = rig_up();
    write_u32(r, PSD1_OD_STROBE_NS, 0, 50);
    for (unsigned i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        r->board.accept = rows[i].result;
        write_u16(r, PSD1_OD_BUS, 2, 7);
        assert_true(aborted(r));
        assert_int_equal(answer(r), rows[i].abort);
        const char *text = upload_text(r, PSD1_OD_REFUSAL);
        assert_non_null(strstr(text, rows[i].words));
        assert_non_null(strstr(text, "refused: write of 7 to address 01h (Y), strobe 50 ns: "));
        assert_int_equal(upload(r, PSD1_OD_COUNTERS, CYCLES_REFUSED), i + 1);
    }
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, SDO_REFUSED), sizeof rows / sizeof rows[0]);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, CYCLES), 0);
    assert_int_equal(r->refusals, 0); /* the log hears of settings, not of each cycle */
}

/* Whether an address is there, and which way it goes, the board says and counts. */
static void every_address_reaches_the_board_and_no_other_sub_index(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    r->board.accept = BOARD_CYCLE_NO_ADDRESS;
    for (uint8_t sub = 1; sub <= 16; sub++) {
        assert_int_equal(upload(r, PSD1_OD_BUS, sub), 0x06090011);
        write_u16(r, PSD1_OD_BUS, sub, 0);
        assert_int_equal(answer(r), 0x06090011);
    }
    assert_int_equal(r->board.submits, 32);
    assert_int_equal(upload(r, PSD1_OD_BUS, 17), 0x06090011);
    assert_int_equal(r->board.submits, 32);
    assert_non_null(strstr(upload_text(r, PSD1_OD_REFUSAL), "(nothing)"));
}

static void a_value_of_the_wrong_length_never_becomes_a_cycle(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, 0x2F, PSD1_OD_BUS, 1, 1);
    assert_int_equal(answer(r), 0x06070013);
    ask(r, 0x23, PSD1_OD_BUS, 1, 1);
    assert_int_equal(answer(r), 0x06070012);
    assert_int_equal(r->board.submits, 0);
}

static void a_refusal_at_the_end_of_a_cycle_is_answered_too(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, 0x40, PSD1_OD_BUS, 1, 0);
    fake_done(r, BOARD_CYCLE_TOO_SHORT, 0);
    settle(r);
    assert_true(aborted(r));
    assert_int_equal(answer(r), 0x06090030);
    assert_non_null(strstr(upload_text(r, PSD1_OD_REFUSAL), "read of address 00h (X), strobe 800 ns"));
}

static void a_cycle_that_a_reset_cuts_says_so(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, 0x40, PSD1_OD_BUS, 1, 0);
    fake_reset((struct board *)&r->board, r->s.now_ns); /* by the control socket, or a brown-out */
    settle(r);
    assert_int_equal(answer(r), 0x08000020);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, CYCLES_REFUSED), 1);
    ask(r, 0x40, PSD1_OD_BUS, 1, 0);
    fake_done(r, BOARD_CYCLE_OK, 5);
    settle(r);
    assert_int_equal(answer(r) & 0xFFFF, 5);
}

static void who_gives_up_a_cycle_finds_the_bus_busy_until_it_ends(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, 0x40, PSD1_OD_BUS, 1, 0);
    assert_int_equal(upload(r, PSD1_OD_BUS, 2), 0x08000022);
    assert_non_null(strstr(upload_text(r, PSD1_OD_REFUSAL), "address 01h (Y)"));
    assert_int_equal(r->board.submits, 1);
    r->count = 0;
    fake_done(r, BOARD_CYCLE_OK, 0x1234);
    settle(r);
    assert_null(seen_id(r, 0x580 + NODE)); /* no client waits any more */
    ask(r, 0x40, PSD1_OD_BUS, 2, 0);
    assert_int_equal(r->board.submits, 2);
    fake_done(r, BOARD_CYCLE_OK, 2);
    settle(r);
    assert_int_equal(answer(r) & 0xFFFF, 2);
}

static void a_cycle_that_never_ends_times_out_and_hangs_nothing(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, 0x40, PSD1_OD_BUS, 1, 0);
    sched_run_until(&r->s, r->s.now_ns + 2 * NS_PER_S);
    assert_int_equal(answer(r), 0x05040000);
    assert_int_equal(upload(r, PSD1_OD_IDENTITY, 4), 4711);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_read_is_answered_when_the_cycle_is_done),
        cmocka_unit_test(a_write_carries_data_and_the_strobe_that_was_set),
        cmocka_unit_test(each_refusal_has_its_code_its_words_and_is_counted),
        cmocka_unit_test(every_address_reaches_the_board_and_no_other_sub_index),
        cmocka_unit_test(a_value_of_the_wrong_length_never_becomes_a_cycle),
        cmocka_unit_test(a_refusal_at_the_end_of_a_cycle_is_answered_too),
        cmocka_unit_test(a_cycle_that_a_reset_cuts_says_so),
        cmocka_unit_test(who_gives_up_a_cycle_finds_the_bus_busy_until_it_ends),
        cmocka_unit_test(a_cycle_that_never_ends_times_out_and_hangs_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

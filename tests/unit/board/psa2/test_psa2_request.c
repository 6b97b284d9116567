/* PSA-2 board: requests through its controller, and what they cost. */
#include "psa2_words.h"

/* Registers after the set-up: E1 values, and what silicon makes of 02h then 04h. */
static void registers_after_the_set_up(void **state)
{
    (void)state;
    const struct {
        const char *profile;
        enum psa2_group group;
        uint8_t addr, want, mask;
    } rows[] = {
        {"article", PSA2_ACCEL, 0x01, 0x56, 0xFF}, {"article", PSA2_ACCEL, 0x02, 0x09, 0xFF},
        {"article", PSA2_ACCEL, 0x05, 0x00, 0xFF}, {"article", PSA2_ACCEL, 0x0A, 0x40, 0xFF},
        {"article", PSA2_TEMP, 0x00, 0x04, 0x06},  {"intent", PSA2_TEMP, 0x00, 0x06, 0x06},
        {"article", PSA2_TEMP, 0x03, 0x82, 0xFF},  {"intent", PSA2_TEMP, 0x03, 0x82, 0xFF},
        {"psa1", PSA2_ACCEL, 0x01, 0x56, 0xFF},    {"psa1", PSA2_ACCEL, 0x02, 0x08, 0xFF},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        rig_up(&rig, rows[i].profile, 1.0);
        struct psa2_request q = {.group = rows[i].group, .op = PSA2_READ_REG, .addr = rows[i].addr};
        assert_int_equal(rig_request(&rig, &q), PSA2_OK);
        for (unsigned k = 0; k < (rows[i].group == PSA2_ACCEL ? 3u : 1u); k++)
            assert_int_equal(q.answer[k] & rows[i].mask, rows[i].want);
    }
}

/* Every register written and read back, and not one conversion lost by it. */
static void requests_cost_no_conversion(void **state)
{
    (void)state;
    rig_up(&rig, "article", 1.0);
    for (uint8_t a = 3; a <= 0x0A; a++) {
        rig_run(&rig, 125000); /* at all phases of the data period */
        struct psa2_request w = {.group = PSA2_ACCEL, .op = PSA2_WRITE_REG, .addr = a, .value = (uint8_t)(0x10 + a)};
        assert_int_equal(rig_request(&rig, &w), PSA2_OK);
        struct psa2_request r = {.group = PSA2_ACCEL, .op = PSA2_READ_REG, .addr = a};
        assert_int_equal(rig_request(&rig, &r), PSA2_OK);
        for (int k = 0; k < 3; k++) assert_int_equal(r.answer[k], 0x10 + a);
        struct psa2_request t = {.group = PSA2_TEMP, .op = PSA2_READ_REG, .addr = a};
        assert_int_equal(rig_request(&rig, &t), PSA2_OK);
    }
    rig_run(&rig, 10000000);
    for (unsigned i = 1; i < rig.frames; i++) assert_int_equal(rig.frame[i].seq, rig.frame[i - 1].seq + 1);
    no_read_was_late(&rig);
    assert_int_equal(rig.b.counters.overruns, 0);
    assert_int_equal(rig.b.counters.requests, 24);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(rig.b.adc[i].count.torn_reads + rig.b.adc[i].count.overruns, 0);
        assert_int_equal(rig.b.adc[i].count.gap_violations + rig.b.adc[i].count.refused, 0);
    }
    assert_int_equal(rig.b.tadc.n.gap_violations, 0);
}

/* A data rate that is no whole number: 1.007452 MHz / 16384 = 61.49 words a second, one each 16.262809 ms. Requests at all
 * phases of the last half millisecond of the period, where one of 0.3 ms still fits or does not: no read waits for one. */
static void requests_delay_no_read_at_a_broken_data_rate(void **state)
{
    (void)state;
    struct psa2_profile p = psa2_profile_file("article");
    p.fclk_hz = 1007452;
    p.sclk_hz = 251863;
    p.setup[0].bytes[2] = 0x46;
    rig_init(&rig, &p, 0.0);
    psa2_power_up(&rig.b, 0);
    while (rig.frames == 0) rig_run(&rig, 16000000);
    assert_int_equal(rig.b.period_ns, 16262809);
    for (int64_t before_ns = 500000; before_ns > 0; before_ns -= 2000) {
        struct psa2_request q = {
            .group = before_ns / 2000 % 2 ? PSA2_TEMP : PSA2_ACCEL, .op = PSA2_READ_REG, .addr = 1};
        rig_run(&rig, rig.b.drd_a_ns + 2 * rig.b.period_ns - before_ns - rig.s.now_ns);
        assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    }
    for (unsigned i = 0; i < rig.frames; i++) /* 26 SClk periods at most, and the CLK's grid */
        assert_in_range(rig.frame[i].t_int_fall_ns - rig.frame[i].t_sample_ns, 95000, 104500);
    assert_int_equal(rig.b.counters.overruns, 0);
}

static void what_the_converters_do_not_take_is_refused(void **state)
{
    (void)state;
    rig_up(&rig, "article", 1.0);
    const struct {
        enum psa2_group group;
        enum psa2_op op;
        uint8_t addr, value;
        enum psa2_result result;
    } rows[] = {
        {PSA2_ACCEL, PSA2_READ_REG, 0x0B, 0, PSA2_NO_SUCH_REG},
        {PSA2_ACCEL, PSA2_WRITE_REG, 0x20, 0, PSA2_NO_SUCH_REG},
        {PSA2_ACCEL, PSA2_WRITE_REG, 0x00, 0, PSA2_READ_ONLY},
        {PSA2_ACCEL, PSA2_WRITE_REG, 0x01, 0x7E, PSA2_BAD_VALUE}, /* DR 111 */
        {PSA2_ACCEL, PSA2_WRITE_REG, 0x01, 0xD6, PSA2_BAD_VALUE}, /* continuous sync: words that are no data */
        {PSA2_ACCEL, PSA2_WRITE_REG, 0x01, 0x55, PSA2_BAD_VALUE}, /* sinc alone: faster than KPSA reads */
        {PSA2_ACCEL, PSA2_WRITE_REG, 0x02, 0x0F, PSA2_BAD_VALUE}, /* PGA 111 */
        {PSA2_TEMP, PSA2_READ_REG, 0x0B, 0, PSA2_NO_SUCH_REG},
        {PSA2_TEMP, PSA2_WRITE_REG, 0x03, 0x20, PSA2_BAD_VALUE},
        {PSA2_TEMP, PSA2_WRITE_REG, 0x03, 0x92, PSA2_OK},
        {PSA2_ACCEL, PSA2_OPCODE, 0, 0x41, PSA2_BAD_VALUE},
        {PSA2_ACCEL, PSA2_OPCODE, 0, 0x04, PSA2_OK},
        {PSA2_ACCEL, PSA2_OPCODE, 0, 0x77, PSA2_BAD_VALUE},
        {PSA2_TEMP, PSA2_OPCODE, 0, 0x51, PSA2_BAD_VALUE},
        {PSA2_TEMP, PSA2_OPCODE, 0, 0xF0, PSA2_OK},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct psa2_request q = {
            .group = rows[i].group, .op = rows[i].op, .addr = rows[i].addr, .value = rows[i].value};
        const enum psa2_result result = rig_request(&rig, &q);
        if (result != rows[i].result) fail_msg("row %zu: %d, want %d", i, result, rows[i].result);
        rig_run(&rig, 100000000);
    }
}

/* ACAL is on: another DRATE starts a self-calibration of 61.8 ms (50 SPS), during which the scan sends nothing; then the
 * temperatures go on, right. */
static void the_scan_waits_for_a_calibration(void **state)
{
    (void)state;
    rig_up(&rig, "article", 0.0);
    rig_run(&rig, 20000000);
    struct psa2_request q = {.group = PSA2_TEMP, .op = PSA2_WRITE_REG, .addr = 3, .value = 0x63};
    const uint32_t calibrations = rig.b.tadc.n.calibrations;
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    rig_run(&rig, 200000000);
    assert_int_equal(rig.b.tadc.n.calibrations, calibrations + 1);
    assert_int_equal(rig.b.tadc.n.refused + rig.b.tadc.n.gap_violations, 0);
    near(last(&rig)->temp_code, 298.15 * 65.536, 2);
}

static void one_request_at_a_time_and_none_before_the_set_up(void **state)
{
    (void)state;
    const struct psa2_profile p = psa2_profile_file("article");
    rig_init(&rig, &p, 1.0);
    struct psa2_request a = {.group = PSA2_ACCEL, .op = PSA2_READ_REG, .addr = 1, .done = rig_done, .ctx = &rig};
    struct psa2_request b = a;
    assert_int_equal(psa2_submit(&rig.b, &a, 0), PSA2_BUSY);
    psa2_power_up(&rig.b, 0);
    rig_run(&rig, 100000000);
    assert_int_equal(psa2_submit(&rig.b, &a, rig.s.now_ns), PSA2_BUSY);
    rig_run(&rig, 100000000);
    assert_int_equal(psa2_submit(&rig.b, &a, rig.s.now_ns), PSA2_OK);
    assert_int_equal(psa2_submit(&rig.b, &b, rig.s.now_ns), PSA2_BUSY);
    rig_run(&rig, 5000000);
    assert_true(rig.answered);
}

/* A pulse on SYNC_A: t_DR (63.095 ms) without frames, then on again; seq counts conversions, so it has no gap. */
static void a_sync_pulse_restarts_the_converters(void **state)
{
    (void)state;
    rig_up(&rig, "article", 1.0);
    struct psa2_request q = {.group = PSA2_ACCEL, .op = PSA2_PULSE_SYNC};
    rig_run(&rig, 5000000);
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    const unsigned before = rig.frames;
    const int64_t sync_ns = rig.answered_ns - 977; /* the pulse is 4 tCLK wide and works on its rise */
    rig_run(&rig, 70000000);
    assert_true(rig.frames > before);
    near((double)(rig.frame[before].t_sample_ns - sync_ns), 63094727, 300);
    assert_int_equal(rig.b.counters.timeouts, 0);
}

/* Gain 4 in place of 2: codes double; 63 words are marked as not settled. */
static void a_new_gain_is_marked_until_it_has_settled(void **state)
{
    (void)state;
    rig_up(&rig, "article", 0.0);
    rig.volts[0] = 1.0;
    rig_run(&rig, 100000000);
    struct psa2_request q = {.group = PSA2_ACCEL, .op = PSA2_WRITE_REG, .addr = 2, .value = 0x0A};
    const int32_t was = last(&rig)->code[0];
    const unsigned from = rig.frames;
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    rig_run(&rig, 100000000);
    unsigned marked = 0;
    for (unsigned i = from; i < rig.frames; i++) marked += !(rig.frame[i].status & PSA2_ST_SETTLED);
    assert_int_equal(marked, 63);
    near(last(&rig)->code[0], 2.0 * was, 3);
}

/* A restart leaves nothing old in the filter: words after a restart are settled, a new gain just before it or not. */
static void a_restart_settles_a_new_gain(void **state)
{
    (void)state;
    const struct {
        enum psa2_op op;
        uint8_t addr, value;
    } rows[] = {{PSA2_PULSE_SYNC, 0, 0}, {PSA2_OPCODE, 0, 0x04}, {PSA2_OPCODE, 0, 0x06}, {PSA2_WRITE_REG, 1, 0x52}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        rig_up(&rig, "article", 0.0);
        struct psa2_request gain = {.group = PSA2_ACCEL, .op = PSA2_WRITE_REG, .addr = 2, .value = 0x0A};
        struct psa2_request restart = {
            .group = PSA2_ACCEL, .op = rows[i].op, .addr = rows[i].addr, .value = rows[i].value};
        assert_int_equal(rig_request(&rig, &gain), PSA2_OK);
        assert_int_equal(rig_request(&rig, &restart), PSA2_OK);
        rig_run(&rig, 1000000); /* the word already read when the restart came is on its way */
        const unsigned from = rig.frames;
        rig_run(&rig, 80000000);
        assert_true(rig.frames > from);
        for (unsigned k = from; k < rig.frames; k++) assert_true(rig.frame[k].status & PSA2_ST_SETTLED);
    }
}

/* 250 SPS by a request: 252 ms without DRD_A are no fault. */
static void a_slower_rate_is_awaited_longer(void **state)
{
    (void)state;
    rig_up(&rig, "article", 1.0);
    struct psa2_request q = {.group = PSA2_ACCEL, .op = PSA2_WRITE_REG, .addr = 1, .value = 0x46};
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    rig_run(&rig, 1000000);
    const unsigned frames = rig.frames;
    rig_run(&rig, 300000000);
    assert_true(rig.frames > frames);
    assert_int_equal(rig.faults + rig.b.counters.timeouts, 0);
}

/* From 250 to 4000 SPS: the 352 ms that were to be waited become 100 + 15.77 ms. */
static void a_faster_rate_is_awaited_shorter(void **state)
{
    (void)state;
    rig_up(&rig, "article", 1.0);
    struct psa2_request q = {.group = PSA2_ACCEL, .op = PSA2_WRITE_REG, .addr = 1, .value = 0x46};
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    rig_run(&rig, 400000000); /* the timeout armed at the first of these words */
    q.value = 0x66;
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    ads1282_reset_pin(&rig.b.adc[0], false, rig.s.now_ns);
    rig_run(&rig, 114000000 + rig.answered_ns - rig.s.now_ns);
    assert_int_equal(rig.faults, 0);
    rig_run(&rig, 4000000);
    assert_int_equal(rig.faults, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(registers_after_the_set_up),
        cmocka_unit_test(requests_cost_no_conversion),
        cmocka_unit_test(requests_delay_no_read_at_a_broken_data_rate),
        cmocka_unit_test(what_the_converters_do_not_take_is_refused),
        cmocka_unit_test(the_scan_waits_for_a_calibration),
        cmocka_unit_test(one_request_at_a_time_and_none_before_the_set_up),
        cmocka_unit_test(a_sync_pulse_restarts_the_converters),
        cmocka_unit_test(a_new_gain_is_marked_until_it_has_settled),
        cmocka_unit_test(a_restart_settles_a_new_gain),
        cmocka_unit_test(a_slower_rate_is_awaited_longer),
        cmocka_unit_test(a_faster_rate_is_awaited_shorter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

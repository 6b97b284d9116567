/* PSA-2 board: frames that find no room, converters that do not answer, resets. */
#include "psa2_words.h"

/* INT low for 296 us at 4000 SPS: DRD_A comes each 250 us, so every second frame finds the line busy and is dropped. */
static void a_frame_that_finds_int_low_is_dropped_and_counted(void **state)
{
    (void)state;
    struct psa2_profile p;
    fields_default(&psa2_fields, &p);
    p.line_div = 4;
    rig_init(&rig, &p, 1.0);
    psa2_power_up(&rig.b, 0);
    rig_run(&rig, 195000000);
    assert_int_equal(rig.b.counters.int_late, 0);
    struct psa2_request w = {.group = PSA2_ACCEL, .op = PSA2_WRITE_REG, .addr = 1, .value = 0x66};
    assert_int_equal(rig_request(&rig, &w), PSA2_OK);
    rig_run(&rig, 20000000);
    const unsigned from = rig.frames;
    const uint32_t late = rig.b.counters.int_late;
    rig_run(&rig, 100000000);
    near(rig.frames - from, 200, 1);
    near(rig.b.counters.int_late - late, 200, 1);
    for (unsigned i = from; i < rig.frames; i++) assert_int_equal(rig.frame[i].seq - rig.frame[i - 1].seq, 2);
    assert_int_equal(rig.b.counters.overruns, 0);
}

/* Slow SClk at 4000 SPS without gates: a temperature burst begun before DRD_A (32 bits, 125 us) and the read after it (125 us)
 * end behind the next DRD_A. Each is counted and marked in the frame that follows. */
static void a_read_that_is_not_over_at_drd_a_is_an_overrun(void **state)
{
    (void)state;
    struct psa2_profile p = psa2_profile_file("ungated");
    p.sclk_hz = 256000;
    p.temp_clkin_hz = 8016000; /* bursts begin late in the data period: at 8 MHz they do not */
    p.read_bits = 32;
    p.setup[0].bytes[2] = 0x66;
    rig_init(&rig, &p, 1.0);
    psa2_power_up(&rig.b, 0);
    rig_run(&rig, 900000000);
    unsigned marked = 0;
    for (unsigned i = 0; i < rig.frames; i++) marked += (rig.frame[i].status & PSA2_ST_OVERRUN) != 0;
    assert_in_range(rig.b.counters.overruns, 1, 100);
    assert_int_equal(marked, rig.b.counters.overruns);
}

/* A converter that is silent: the request fails 100 ms + t_DR (163.1 ms) after the last DRD_A, one fault is reported, and when
 * the converter comes back all goes on. */
static void a_silent_converter_is_a_time_out_and_a_fault(void **state)
{
    (void)state;
    rig_up(&rig, "article", 1.0);
    ads1282_reset_pin(&rig.b.adc[0], false, rig.s.now_ns);
    rig_run(&rig, 5000000);
    const int64_t last_ns = last(&rig)->t_sample_ns;
    struct psa2_request q = {.group = PSA2_ACCEL, .op = PSA2_READ_REG, .addr = 1};
    assert_int_equal(rig_request(&rig, &q), PSA2_TIMEOUT);
    near((double)(rig.answered_ns - last_ns), 163094727, 1000000);
    assert_int_equal(rig_request(&rig, &q), PSA2_TIMEOUT);
    assert_int_equal(rig.faults, 1);
    assert_int_equal(rig.fault[0], PSA2_FAULT_ACCEL_PORT);
    assert_int_equal(rig.b.counters.timeouts, 2);
    struct psa2_request wake = {.group = PSA2_ACCEL, .op = PSA2_OPCODE, .value = 0x00};
    assert_int_equal(rig_request(&rig, &wake), PSA2_OK); /* opcodes need no DRD_A */
    ads1282_reset_pin(&rig.b.adc[0], true, rig.s.now_ns);
    const unsigned frames = rig.frames;
    rig_run(&rig, 70000000);
    assert_true(rig.frames > frames);
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    assert_int_equal(q.answer[0], 0x52); /* reset lost its settings; the others kept theirs */
    assert_int_equal(q.answer[1], 0x56);
}

static void a_silent_temperature_converter_too(void **state)
{
    (void)state;
    rig_up(&rig, "article", 1.0);
    rig_run(&rig, 20000000);
    ads1256_reset_pin(&rig.b.tadc, false, rig.s.now_ns);
    rig_run(&rig, 30000000);
    struct psa2_request q = {.group = PSA2_TEMP, .op = PSA2_READ_REG, .addr = 0};
    assert_int_equal(rig_request(&rig, &q), PSA2_TIMEOUT);
    assert_int_equal(rig.faults, 1);
    assert_int_equal(rig.fault[0], PSA2_FAULT_TEMP_PORT);
    const unsigned frames = rig.frames;
    rig_run(&rig, 100000000);
    near(rig.frames - frames, 100, 1); /* accelerations go on */
    assert_int_equal(rig_request(&rig, &q), PSA2_TIMEOUT);
    assert_int_equal(rig.faults, 1); /* told once */
    ads1256_reset_pin(&rig.b.tadc, true, rig.s.now_ns);
    rig_run(&rig, 400000000);
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    ads1256_reset_pin(&rig.b.tadc, false, rig.s.now_ns);
    assert_int_equal(rig_request(&rig, &q), PSA2_TIMEOUT);
    assert_int_equal(rig.faults, 2); /* the first has ended */
    assert_int_equal(rig.fault[1], PSA2_FAULT_TEMP_PORT);
}

/* A set-up that puts the temperature converter to sleep (SYNC without WAKEUP) waits for DRD_T in vain: 100 ms and four
 * times t18 (4 * 0.213 ms at 30 kSPS) later that is a fault, told once; Res tries again. */
static void a_set_up_that_waits_in_vain_is_a_fault(void **state)
{
    (void)state;
    struct psa2_profile p = psa2_profile_file("article");
    p.setup[1] = (struct psa2_setup_step){.on = PSA2_ON_DRD_T, .action = PSA2_WRITE_T, .bytes = {0xFC}, .count = 1};
    rig_init(&rig, &p, 1.0);
    psa2_power_up(&rig.b, 0);
    rig_run(&rig, 164000000); /* the opcode is sent at 63.2 ms */
    assert_int_equal(rig.faults, 0);
    rig_run(&rig, 100000000);
    assert_int_equal(rig.faults, 1);
    assert_int_equal(rig.fault[0], PSA2_FAULT_TEMP_PORT);
    assert_int_equal(rig.b.counters.timeouts, 1);
    assert_false(psa2_ready(&rig.b));
    psa2_reset(&rig.b, rig.s.now_ns);
    rig_run(&rig, 264000000);
    assert_int_equal(rig.faults, 2);
    p.setup_count = 2; /* silent from the very first step */
    p.setup[0].on = PSA2_ON_DRD_T;
    rig_init(&rig, &p, 1.0);
    psa2_power_up(&rig.b, 0);
    rig_run(&rig, 20000);
    ads1256_reset_pin(&rig.b.tadc, false, rig.s.now_ns);
    rig_run(&rig, 110000000);
    assert_int_equal(rig.faults, 1);
}

/* 250 SPS: CONFIG0 changes the settling time from 63 to 252 ms, and the last step waits for its DRD_A till 315 ms, long after
 * the temperature converter has answered for good. */
static void a_slow_set_up_is_no_fault(void **state)
{
    (void)state;
    struct psa2_profile p = psa2_profile_file("article");
    p.setup[0].bytes[2] = 0x46;
    p.temp_channels = 0;
    rig_init(&rig, &p, 1.0);
    psa2_power_up(&rig.b, 0);
    rig_run(&rig, 600000000);
    assert_true(psa2_ready(&rig.b));
    assert_int_equal(rig.faults, 0);
}

static void a_reset_ends_a_request(void **state)
{
    (void)state;
    rig_up(&rig, "article", 1.0);
    struct psa2_request q = {.group = PSA2_ACCEL, .op = PSA2_READ_REG, .addr = 1, .done = rig_done, .ctx = &rig};
    rig.answered = false;
    assert_int_equal(psa2_submit(&rig.b, &q, rig.s.now_ns), PSA2_OK);
    psa2_reset(&rig.b, rig.s.now_ns);
    assert_true(rig.answered);
    assert_int_equal(rig.result, PSA2_TIMEOUT);
    assert_false(psa2_ready(&rig.b));
    rig_run(&rig, 250000000);
    assert_true(psa2_ready(&rig.b));
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_frame_that_finds_int_low_is_dropped_and_counted),
        cmocka_unit_test(a_read_that_is_not_over_at_drd_a_is_an_overrun),
        cmocka_unit_test(a_silent_converter_is_a_time_out_and_a_fault),
        cmocka_unit_test(a_silent_temperature_converter_too),
        cmocka_unit_test(a_set_up_that_waits_in_vain_is_a_fault),
        cmocka_unit_test(a_slow_set_up_is_no_fault),
        cmocka_unit_test(a_reset_ends_a_request),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

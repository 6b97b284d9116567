/* PSA-2 board: codes and words, temperatures, requests through the controller, faults. Edges: test_psa2_lines.c. */
#include "psa2_rig.h"

static struct rig rig;

static void near(double got, double want, double tol)
{
    if (!(got - want <= tol && want - got <= tol)) fail_msg("got %.9g, want %.9g within %g", got, want, tol);
}

static const struct psa2_frame *last(const struct rig *r)
{
    return &r->frame[r->frames - 1];
}

/* LSB at the load: 2.5 V / 2^24 * 8 = 1.192 uV, so code = volts * 2^23 / 10 V; the integer filter's gain is 1.000169. */
static void codes_are_volts_over_the_divider(void **state)
{
    (void)state;
    const struct {
        const char *profile;
        double volts;
        int32_t code;
        bool clip;
    } rows[] = {
        {"article", 0.0, 0, false},       {"article", 2.5, 2097506, false},  {"article", -2.5, -2097506, false},
        {"article", 9.9, 8306125, false}, {"article", 10.4, 0x7FFFFF, true}, {"article", -10.4, -0x800000, true},
        {"psa1", 2.5, 2097506, false},    {"psa1", -10.4, -0x800000, true},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        const struct psa2_profile p = psa2_profile_file(rows[i].profile);
        rig_init(&rig, &p, 0.0);
        rig.volts[0] = rows[i].volts;
        rig.volts[2] = -rows[i].volts;
        psa2_power_up(&rig.b, 0);
        rig_run(&rig, 195000000);
        assert_true(rig.frames > 3);
        near(last(&rig)->code[0], rows[i].code, 3);
        near(last(&rig)->code[1], 0, 0);
        near(last(&rig)->code[2], -rows[i].code, 3);
        assert_int_equal(last(&rig)->status & PSA2_ST_CLIP, rows[i].clip ? PSA2_ST_CLIP : 0);
        assert_int_equal(last(&rig)->status & PSA2_ST_SETTLED, PSA2_ST_SETTLED);
    }
}

/* What each profile sends for one reading: raw 32-bit words are the chip's, and the T word is code | channel | status. */
static void words_follow_the_profile(void **state)
{
    (void)state;
    const struct {
        const char *profile;
        unsigned shift; /* of the conversion word */
        uint32_t mask;
    } rows[] = {{"article", 8, 0xFFFFFFFF}, {"w24", 8, 0x00FFFFFF}, {"w16", 16, 0x0000FFFF}, {"lab32", 0, 0xFFFFFFFF}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        const struct psa2_profile p = psa2_profile_file(rows[i].profile);
        rig_init(&rig, &p, 1.0);
        rig.volts[0] = 2.4882;
        rig.volts[1] = -7.0;
        psa2_power_up(&rig.b, 0);
        rig_run(&rig, 260000000);
        uint32_t low_byte = 0;
        uint8_t status = 0;
        for (const struct psa2_frame *f = rig.frame; f < rig.frame + rig.frames; f++) {
            for (int k = 0; k < 3; k++)
                assert_int_equal(f->word[k], (uint32_t)((int32_t)f->raw[k] >> rows[i].shift) & rows[i].mask);
            const uint32_t t = f->temp_code | (uint32_t)f->temp_channel << 16 | (uint32_t)f->status << 20;
            assert_int_equal(f->word[3], t & rows[i].mask & 0x00FFFFFF);
            low_byte |= f->raw[0] & 0xFF;
            status |= f->status;
        }
        assert_int_equal(low_byte != 0, rows[i].shift == 0); /* 24 bits read, or 32 */
        assert_int_equal(status, PSA2_ST_SETTLED | PSA2_ST_TEMP_NEW);
    }
}

static void word_order_is_the_profiles(void **state)
{
    (void)state;
    struct psa2_profile p = psa2_profile_default();
    p.word[0] = PSA2_WORD_T;
    p.word[3] = PSA2_WORD_X;
    rig_init(&rig, &p, 0.0);
    rig.volts[0] = 1.0;
    psa2_power_up(&rig.b, 0);
    rig_run(&rig, 195000000);
    assert_int_equal(last(&rig)->word[3], (uint32_t)last(&rig)->code[0]);
    assert_int_equal(last(&rig)->word[0] & 0xFFFF, last(&rig)->temp_code);
}

/* Every frame begins on the grid of CLK (0.5 us), a fixed delay after its DRD_A: no other burst was in the way. */
static void no_read_was_late(const struct rig *r)
{
    for (unsigned i = 0; i < r->frames; i++) {
        const struct psa2_frame *f = &r->frame[i];
        assert_in_range(f->t_int_fall_ns - f->t_sample_ns, 24000, 28000);
        assert_int_equal(f->t_int_fall_ns % 500, 0);
    }
}

/* One frame a millisecond, INT low 74.000 us, seq without gaps; also where the temperature scan drifts past DRD_A. */
static void frames_come_with_the_data_rate(void **state)
{
    (void)state;
    const uint32_t temp_clkin_hz[] = {7680000, 8000000};
    for (size_t c = 0; c < COUNT(temp_clkin_hz); c++) {
        struct psa2_profile p = psa2_profile_file("article");
        p.temp_clkin_hz = temp_clkin_hz[c];
        rig_init(&rig, &p, 1.0);
        psa2_power_up(&rig.b, 0);
        rig_run(&rig, 2189500000);
        assert_int_equal(rig.frames, 2001);
        no_read_was_late(&rig);
        for (unsigned i = 0; i < rig.frames; i++) {
            const struct psa2_frame *f = &rig.frame[i];
            assert_int_equal(f->seq, i);
            assert_int_equal(f->t_int_rise_ns - f->t_int_fall_ns, 74000);
            if (i) assert_int_equal(f->t_sample_ns - f[-1].t_sample_ns, 1000000);
        }
        assert_int_equal(rig.b.counters.frames, 2001);
        assert_int_equal(rig.b.counters.overruns + rig.b.counters.int_late + rig.b.counters.timeouts, 0);
        for (int i = 0; i < 3; i++) assert_int_equal(rig.b.adc[i].count.torn_reads + rig.b.adc[i].count.overruns, 0);
    }
}

/* 1 uA/K on 10 kohm: 10 mV/K; full scale of the 16-bit code is +-5 V: 65.536 codes a kelvin. Channels in turn, each new
 * code marked once. */
static void temperatures_in_turn(void **state)
{
    (void)state;
    const struct psa2_profile p = psa2_profile_file("article");
    const double degc[4] = {-40.0, 0.0, 25.0, 85.0};
    rig_init(&rig, &p, 0.0);
    for (int i = 0; i < 4; i++) rig.degc[i] = degc[i];
    psa2_power_up(&rig.b, 0);
    rig_run(&rig, 400000000);
    unsigned fresh = 0;
    for (unsigned i = 1; i < rig.frames; i++) {
        const struct psa2_frame *f = &rig.frame[i];
        near(f->temp_code, (degc[f->temp_channel] + 273.15) * 65.536, 2);
        if (!(f->status & PSA2_ST_TEMP_NEW)) {
            assert_int_equal(f->temp_channel, f[-1].temp_channel);
            continue;
        }
        fresh++;
        if (fresh > 1) assert_int_equal(f->temp_channel, (f[-1].temp_channel + 1) % 4);
    }
    assert_in_range(fresh, 15, 22); /* one each 10.18 ms and up to two windows of 1 ms */
    assert_int_equal(rig.b.tadc.n.gap_violations, 0);
    assert_int_equal(rig.b.tadc.n.refused, 0);
}

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
    rig_run(&rig, 400000000); /* the patience armed at the first of these words */
    q.value = 0x66;
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    ads1282_reset_pin(&rig.b.adc[0], false, rig.s.now_ns);
    rig_run(&rig, 114000000 + rig.answered_ns - rig.s.now_ns);
    assert_int_equal(rig.faults, 0);
    rig_run(&rig, 4000000);
    assert_int_equal(rig.faults, 1);
}

/* INT low for 296 us at 4000 SPS: DRD_A comes each 250 us, so every second frame finds the line busy and is dropped. */
static void a_frame_that_finds_int_low_is_dropped_and_counted(void **state)
{
    (void)state;
    struct psa2_profile p = psa2_profile_default();
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

/* A converter that is silent: the request fails 100 ms + t_DR (163.1 ms) after the last DRD_A, one fault is told, and when
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
    assert_int_equal(rig.fault[0], PSA2_FAULT_TEMP_PORT);
    const unsigned frames = rig.frames;
    rig_run(&rig, 100000000);
    near(rig.frames - frames, 100, 1); /* accelerations go on */
    ads1256_reset_pin(&rig.b.tadc, true, rig.s.now_ns);
    rig_run(&rig, 400000000);
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
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

/* 4000 SPS through a request: four frames a millisecond, nothing lost, registers still reachable. */
static void four_thousand_frames_a_second(void **state)
{
    (void)state;
    rig_up(&rig, "article", 1.0);
    struct psa2_request w = {.group = PSA2_ACCEL, .op = PSA2_WRITE_REG, .addr = 1, .value = 0x66};
    assert_int_equal(rig_request(&rig, &w), PSA2_OK);
    rig_run(&rig, 20000000);
    struct psa2_request r = {.group = PSA2_ACCEL, .op = PSA2_READ_REG, .addr = 1};
    assert_int_equal(rig_request(&rig, &r), PSA2_OK);
    assert_int_equal(r.answer[2], 0x66);
    const unsigned from = rig.frames;
    rig_run(&rig, 100000000);
    near(rig.frames - from, 400, 1);
    assert_int_equal(last(&rig)->seq - rig.frame[from].seq, rig.frames - 1 - from);
    assert_int_equal(last(&rig)->t_sample_ns - rig.frame[rig.frames - 2].t_sample_ns, 250000);
    assert_int_equal(rig.b.counters.overruns + rig.b.counters.int_late, 0);
}

/* A board that begins a second life in the same memory, at time 0 again, does what it did in the first. */
static void a_board_may_be_initialised_again(void **state)
{
    (void)state;
    static struct psa2_frame first;
    rig_up(&rig, "article", 1.0);
    first = rig.frame[0];
    rig_run(&rig, 5300000); /* in the middle of things */
    const struct psa2_profile p = rig.b.profile;
    const struct board_cfg u = rig.b.cfg;
    const struct board_io io = rig.b.io;
    const struct psa2_host host = rig.b.host;
    sched_init(&rig.s);
    psa2_init(&rig.b, &p, &u, &io, &rig.s);
    psa2_attach(&rig.b, &host);
    psa2_power_up(&rig.b, 0);
    rig.frames = 0;
    rig_run(&rig, 192000000);
    assert_true(rig.frames > 0);
    assert_int_equal(rig.frame[0].t_int_fall_ns, first.t_int_fall_ns);
    assert_memory_equal(rig.frame[0].word, first.word, sizeof first.word);
}

/* Frames of two seconds whose code is wrong; there are 1811. */
static unsigned wrong_codes(struct psa2_profile p, bool gate, uint32_t temp_clkin_hz)
{
    p.gate_sclk = gate;
    p.temp_clkin_hz = temp_clkin_hz;
    rig_init(&rig, &p, 0.0);
    rig.volts[0] = 2.5;
    psa2_power_up(&rig.b, 0);
    rig_run(&rig, 2000000000);
    unsigned wrong = 0;
    assert_int_equal(rig.frames, 1811);
    for (unsigned k = 0; k < rig.frames; k++) wrong += rig.frame[k].code[0] > 2097509 || rig.frame[k].code[0] < 2097503;
    return wrong;
}

/* SClk that is not gated: a temperature burst that meets DRD_A eats bits of the new words. At exactly 7.68 MHz SYNC_T locks
 * the scan to the end of the read, and the hazard hides; with gates there is none at any clock. */
static void without_gates_words_are_damaged(void **state)
{
    (void)state;
    const struct psa2_profile p = psa2_profile_file("ungated");
    const struct {
        bool gate;
        uint32_t temp_clkin_hz;
        unsigned wrong;
    } rows[] = {{false, 8000000, 15}, {false, 7670000, 12}, {false, 7372800, 7}, {false, 7680000, 0},
                {true, 8000000, 0},   {true, 7670000, 0},   {true, 7372800, 0},  {true, 7680000, 0}};
    assert_false(p.gate_sclk);
    assert_int_equal(p.temp_clkin_hz, 8000000);
    for (size_t i = 0; i < COUNT(rows); i++)
        assert_int_equal(wrong_codes(p, rows[i].gate, rows[i].temp_clkin_hz), rows[i].wrong);
}

static void a_stopped_stream_sends_no_frame(void **state)
{
    (void)state;
    rig_up(&rig, "article", 1.0);
    psa2_stream(&rig.b, false);
    rig_run(&rig, 1000000);
    const unsigned frames = rig.frames;
    const uint32_t seq = rig.b.latest.seq;
    rig_run(&rig, 10000000);
    assert_int_equal(rig.frames, frames);
    assert_int_equal(rig.b.latest.seq, seq + 10); /* the controller reads on */
    psa2_stream(&rig.b, true);
    rig_run(&rig, 2000000);
    assert_true(rig.frames > frames);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(codes_are_volts_over_the_divider),
        cmocka_unit_test(words_follow_the_profile),
        cmocka_unit_test(word_order_is_the_profiles),
        cmocka_unit_test(frames_come_with_the_data_rate),
        cmocka_unit_test(temperatures_in_turn),
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
        cmocka_unit_test(a_frame_that_finds_int_low_is_dropped_and_counted),
        cmocka_unit_test(a_read_that_is_not_over_at_drd_a_is_an_overrun),
        cmocka_unit_test(a_silent_converter_is_a_time_out_and_a_fault),
        cmocka_unit_test(a_silent_temperature_converter_too),
        cmocka_unit_test(a_set_up_that_waits_in_vain_is_a_fault),
        cmocka_unit_test(a_slow_set_up_is_no_fault),
        cmocka_unit_test(a_reset_ends_a_request),
        cmocka_unit_test(a_board_may_be_initialised_again),
        cmocka_unit_test(four_thousand_frames_a_second),
        cmocka_unit_test(without_gates_words_are_damaged),
        cmocka_unit_test(a_stopped_stream_sends_no_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* PSA-2 board: codes and words, temperatures, rates, gates. Edges: test_psa2_lines.c. */
#include "psa2_words.h"

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
    struct psa2_profile p;
    fields_default(&psa2_fields, &p);
    p.word[0] = PSA2_WORD_T;
    p.word[3] = PSA2_WORD_X;
    rig_init(&rig, &p, 0.0);
    rig.volts[0] = 1.0;
    psa2_power_up(&rig.b, 0);
    rig_run(&rig, 195000000);
    assert_int_equal(last(&rig)->word[3], (uint32_t)last(&rig)->code[0]);
    assert_int_equal(last(&rig)->word[0] & 0xFFFF, last(&rig)->temp_code);
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
    const struct board_cfg u = rig.b.base.cfg;
    const struct board_io io = rig.b.base.io;
    const struct psa2_host host = rig.b.host;
    sched_init(&rig.s);
    psa2_init(&rig.b, &p, &u, &io, &rig.s);
    rig.b.host = host;
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

static void without_a_host_the_controller_reads_on(void **state)
{
    (void)state;
    rig_up(&rig, "article", 1.0);
    const struct psa2_host host = rig.b.host;
    rig.b.host = (struct psa2_host){.ctx = NULL};
    rig_run(&rig, 1000000);
    const unsigned frames = rig.frames;
    const uint32_t seq = rig.b.latest.seq;
    rig_run(&rig, 10000000);
    assert_int_equal(rig.frames, frames);
    assert_int_equal(rig.b.latest.seq, seq + 10); /* the controller reads on */
    rig.b.host = host;
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
        cmocka_unit_test(a_board_may_be_initialised_again),
        cmocka_unit_test(four_thousand_frames_a_second),
        cmocka_unit_test(without_gates_words_are_damaged),
        cmocka_unit_test(without_a_host_the_controller_reads_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

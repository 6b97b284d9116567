/* PSD-1: Res brings the three converters into step, and a control word is read whatever their words do meanwhile. */
#include "psd1_rig.h"

static struct rig rig;

enum { PERIOD_NS = 972800 };

static void clock_of_x(int32_t ppm)
{
    ad7712_fault(&rig.b.adc[0], &(struct chip_fault){.clock_ppm = ppm}, rig.s.now_ns);
}

static unsigned mixed_in(unsigned from)
{
    unsigned n = 0;
    for (unsigned i = from; i < rig.cycles; i++) n += (rig.cycle[i].status & PSD1_CY_MIXED) != 0;
    return n;
}

static uint32_t lost(void)
{
    uint32_t n = 0;
    for (unsigned i = 0; i < 3; i++) n += rig.b.adc[i].n.overruns + rig.b.adc[i].n.lost_words;
    return n;
}

/* A converter whose clock has been off for a while is out of step, and stays so until Res. */
static void res_brings_them_into_step(void **state)
{
    (void)state;
    unsigned out_of_step = 0;
    for (int k = 0; k < 8; k++) {
        const struct psd1_profile p = rig_exact();
        rig_up(&rig, &p);
        rig_run(&rig, 5000000);
        clock_of_x(700 + k);
        rig_run(&rig, 400000000 + k * 1234500 + k); /* Res at odd instants */
        clock_of_x(0);
        const unsigned off = rig.cycles;
        rig_run(&rig, 10 * PERIOD_NS);
        out_of_step += mixed_in(off) > 5 || rig.b.adc[0].due.t_ns != rig.b.adc[1].due.t_ns;
        psd1_reset(&rig.b, rig.s.now_ns);
        assert_int_equal(rig.b.adc[0].state, AD7712_SYNC_LOW);
        rig.cycles = 0;
        rig_run(&rig, 20 * PERIOD_NS);
        assert_in_range(rig.cycles, 7, 11);
        for (unsigned i = 0; i < 3; i++) assert_int_equal(rig.b.adc[i].due.t_ns, rig.b.adc[0].due.t_ns);
        const uint32_t before = lost();
        rig.volts[1] = 3.0; /* and no word is frozen */
        rig_run(&rig, 20 * PERIOD_NS);
        for (unsigned i = 0; i < rig.cycles; i++) assert_int_equal(rig.cycle[i].status & PSD1_CY_MIXED, 0);
        assert_int_equal(rig.cycle[rig.cycles - 1].status, PSD1_CY_READ);
        assert_int_equal(rig.cycle[rig.cycles - 1].word[1], 42598); /* 32768 (1 + 3 / 10) */
        assert_int_equal(lost(), before);
    }
    assert_int_equal(out_of_step, 8);
}

/* The supply fails in Res, or between two: SYNC is high again when it is over, in step. */
static void power_brings_them_into_step(void **state)
{
    (void)state;
    for (int64_t on_ns = 50000; on_ns < 3000000; on_ns += 983333) {
        const struct psd1_profile p = rig_exact();
        rig_init(&rig, &p, 0.0);
        psd1_power_up(&rig.b, 0);
        rig_run(&rig, on_ns);
        psd1_power_down(&rig.b, rig.s.now_ns);
        rig_run(&rig, 1000003);
        psd1_power_up(&rig.b, rig.s.now_ns);
        rig_run(&rig, 20 * PERIOD_NS);
        assert_in_range(rig.cycles, 7, 11);
        assert_int_equal(mixed_in(0), 0);
        for (unsigned i = 1; i < 3; i++) assert_int_equal(rig.b.adc[i].due.t_ns, rig.b.adc[0].due.t_ns);
    }
}

static void read_back(unsigned axis, int64_t t_ns)
{
    struct psd1_request q;
    rig_until(&rig, t_ns);
    assert_int_equal(command(&rig, &q, (uint8_t)(PSD1_CMD_CONTROL + axis), 0), BOARD_CYCLE_OK);
    if (q.word != 0x020013) fail_msg("axis %u at %lld ns: %06X", axis, (long long)t_ns, (unsigned)q.word);
}

/* No one takes the words: each waits, is announced, replaced, or comes while RFx is low or just between two frames. */
static void a_control_word_is_read_at_any_phase(void **state)
{
    (void)state;
    for (unsigned dr = PSD1_DR_X; dr <= PSD1_DR_ANY; dr++) {
        struct psd1_profile p = rig_exact();
        p.int0 = PSD1_INT0_HOST;
        p.host_strobe_ns = 0;
        p.dr = (uint8_t)dr;
        rig_up(&rig, &p);
        int64_t end_ns = rig.s.now_ns + 10 * PERIOD_NS; /* of a conversion */
        rig_until(&rig, end_ns);
        end_ns = rig.b.adc[0].due.t_ns;
        for (unsigned n = 0; n < 3000; n++, end_ns += 2 * PERIOD_NS) {
            const unsigned axis = n % 3;
            const int64_t early_ns = n < 2000 ? n / 3 * 67 : (int64_t)(n - 2000) * PERIOD_NS / 1000;
            read_back(axis, end_ns - early_ns); /* every 67 ns of 44 us before it, and over a whole period */
        }
        for (unsigned i = 0; i < 3; i++) {
            assert_int_equal(rig.b.adc[i].n.blocked_reads, 0);
            assert_int_equal(rig.b.adc[i].n.a0_violations, 0);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(res_brings_them_into_step),
        cmocka_unit_test(power_brings_them_into_step),
        cmocka_unit_test(a_control_word_is_read_at_any_phase),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

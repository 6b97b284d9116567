/* libpsabench: a whole PSA-2 board, its profiles, lines, frames and registers. */
#include "api_rig.h"
#include "psa2_profiles.h"

#include "api/internal.h"
#include "board/psa2/psa2.h"

struct frames {
    unsigned count, wrong;
    struct psabench_frame last;
};

static void on_frame(void *ctx, psabench_part *p, const struct psabench_frame *f)
{
    struct frames *s = ctx;
    s->wrong += f->size != sizeof *f || psabench_now_ns(psabench_of(p)) != f->t_int_rise_ns;
    s->wrong += s->count && f->seq != s->last.seq + 1;
    s->last = *f;
    s->count++;
}

/* What goes out on the line says which profile it is: width, order of the codes, period of CLK. */
static void profiles_are_those_of_the_files(void **state)
{
    (void)state;
    static const char *const names[] = {"article", "intent", "lab32", "psa1", "ungated", "w16", "w24"};
    for (size_t i = 0; i < COUNT(names); i++) {
        const struct psa2_profile want = psa2_profile_file(names[i]);
        char options[60];
        (void)snprintf(options, sizeof options, "profile=%s noise_scale=0 temp_noise_scale=0", names[i]);
        struct frames s = {.count = 0};
        psabench *b = psabench_new(1);
        psabench_part *p = part(b, "psa2", "u", options);
        good(b, psabench_on_frame(p, on_frame, &s));
        good(b, psabench_set_volts(p, 0, 2.5));
        run(b, 300 * MS);
        assert_true(s.count > 100 && s.wrong == 0);
        assert_true(s.last.t_int_rise_ns - s.last.t_int_fall_ns >= psa2_int_low_ns(&want) - 1 &&
                    s.last.t_int_rise_ns - s.last.t_int_fall_ns <= psa2_int_low_ns(&want) + 1);
        assert_int_equal(psabench_peek(p, 0x001), 0x56);
        assert_int_equal(psabench_peek(p, 0x303), 0x82);
        assert_int_equal(psabench_peek(p, 0x300) & 0x06, strcmp(names[i], "intent") == 0 ? 0x06 : 0x04);
        assert_int_equal(psabench_peek(p, 0x202) & 0x07, want.adc_pga == 2 ? 1 : 0);
        const int32_t code = 2097152; /* 2.5 V of 10 V */
        assert_in_range(s.last.code[0], code - 500, code + 500);
        const uint32_t word = (uint32_t)s.last.code[0] >> (24 - (want.code_bits < 24 ? want.code_bits : 24));
        assert_int_equal(s.last.word[0] >> (want.code_bits - (want.code_bits < 24 ? want.code_bits : 24)), word);
        psabench_free(b);
    }
}

/* The built-in differences against every field of the file. */
static void each_field_of_a_profile_is_that_of_its_file(void **state)
{
    (void)state;
    static const char *const names[] = {"article", "intent", "lab32", "psa1", "ungated", "w16", "w24"};
    for (size_t i = 0; i < COUNT(names); i++) {
        const struct psa2_profile want = psa2_profile_file(names[i]);
        struct psa2_profile got;
        char why[300];
        if (!api_psa2_profile((unsigned)i, &got, why, sizeof why)) fail_msg("%s", why);
        psa2_assert_same(&got, &want, names[i]);
    }
}

/* A receiver on the three lines, as the article's navigation computer has it: bits at rising CLK, LSB first. */
struct receiver {
    psabench_part *p;
    int level[16];
    unsigned bits, frames, wrong;
    uint32_t word[4];
    int64_t last_ns, rise_ns;
};

static void on_line(void *ctx, psabench_part *p, int number, int level, int64_t t_ns)
{
    struct receiver *r = ctx;
    r->wrong += p != r->p || t_ns < r->last_ns || t_ns > psabench_now_ns(psabench_of(p)) ||
                psabench_now_ns(psabench_of(p)) - t_ns > 250000 || r->level[number] == level;
    r->last_ns = t_ns;
    r->level[number] = level;
    if (number == PSA2_LINE_CLK && level) {
        if (r->bits % 32 == 0 && r->bits < 128) r->word[r->bits / 32] = 0;
        if (r->bits < 128) r->word[r->bits / 32] |= (uint32_t)r->level[PSA2_LINE_DATA] << (r->bits % 32);
        r->bits++;
    }
    if (number == PSA2_LINE_INT && !level) r->bits = 0;
    if (number == PSA2_LINE_INT && level) {
        r->wrong += r->bits != 128;
        r->rise_ns = t_ns;
        r->frames++;
    }
}

static void the_lines_carry_the_words_of_the_frame(void **state)
{
    (void)state;
    static const char *const lines[] = {"Int", "Data", "CLK"};
    struct frames s = {.count = 0};
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "psa2", "u", NULL);
    struct receiver r = {.p = p, .level[PSA2_LINE_INT] = 1};
    good(b, psabench_on_frame(p, on_frame, &s));
    until(p, "Int", 0);
    until(p, "Int", 1);
    run(b, 300000);
    const unsigned before = s.count;
    for (size_t i = 0; i < COUNT(lines); i++) good(b, psabench_watch(p, pin(p, lines[i]), on_line, &r));
    run(b, 3 * MS);
    until(p, "Int", 1);
    until(p, "Int", 0);
    run(b, 60000);
    /* Another line comes in the middle of a frame: nothing of the first three is lost. */
    good(b, psabench_watch(p, pin(p, "SClk"), on_line, &r));
    run(b, 2 * MS);
    good(b, psabench_watch(p, pin(p, "SClk"), NULL, NULL));
    until(p, "Int", 0);
    until(p, "Int", 1);
    run(b, 300000);
    assert_int_equal(r.wrong, 0);
    assert_int_equal(r.frames, s.count - before);
    assert_true(r.frames >= 6);
    assert_true(r.rise_ns == s.last.t_int_rise_ns);
    assert_memory_equal(r.word, s.last.word, sizeof r.word);
    psabench_free(b);
}

/* INT falls on the grid of CLK, which is no event of the board without observers. */
static void int_can_be_waited_for_unwatched(void **state)
{
    (void)state;
    struct frames s = {.count = 0};
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "psa2", "u", NULL);
    good(b, psabench_on_frame(p, on_frame, &s));
    for (int i = 0; i < 20; i++) {
        until(p, "Int", 0);
        const int64_t fall_ns = psabench_now_ns(b);
        until(p, "Int", 1);
        assert_int_equal(s.count, i + 1);
        assert_true(s.last.t_int_fall_ns == fall_ns && s.last.t_int_rise_ns == psabench_now_ns(b));
    }
    assert_int_equal(psabench_get(p, pin(p, "SClk")), PSABENCH_NOT_HERE);
    assert_int_equal(psabench_run_until_level(p, pin(p, "CLK"), 1, S), PSABENCH_NOT_HERE);
    assert_int_equal(psabench_spi(p, NULL, NULL, 1), PSABENCH_NOT_HERE);
    assert_int_equal(psabench_spi_clock(p, 1000, 0), PSABENCH_NOT_HERE);
    psabench_free(b);
}

/* Lines that can be asked agree with what their watchers hear. */
static void levels_asked_are_levels_told(void **state)
{
    (void)state;
    static const char *const lines[] = {"DRD_A", "DRD_T", "SYNC_A", "SYNC_T", "CST", "Int", "Res"};
    enum { STEPS = 40000, STEP_NS = 5003 };
    static uint8_t asked[COUNT(lines)][STEPS];
    static struct rig_vcd v;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "psa2", "u", NULL);
    rig_vcd_path(&v);
    good(b, psabench_vcd(b, v.path));
    for (int i = 0; i < STEPS; i++) {
        run(b, STEP_NS);
        for (size_t k = 0; k < COUNT(lines); k++) asked[k][i] = (uint8_t)get(p, lines[k]);
    }
    run(b, MS);
    psabench_free(b);
    FILE *f = fopen(v.path, "r"); /* too many changes for rig_vcd_read(): only those asked for */
    assert_non_null(f);
    char line[100];
    char code[COUNT(lines)] = {0};
    int level[COUNT(lines)];
    int64_t t_ns = 0;
    int i = 0;
    unsigned changes = 0;
    for (size_t k = 0; k < COUNT(lines); k++) level[k] = -1;
    while (fgets(line, sizeof line, f) && i < STEPS) {
        char c;
        char name[20];
        if (sscanf(line, "$var wire 1 %c %19s", &c, name) == 2)
            for (size_t k = 0; k < COUNT(lines); k++)
                if (strcmp(name, lines[k]) == 0) code[k] = c;
        if (line[0] == '#') {
            t_ns = strtoll(line + 1, NULL, 10);
            for (; i < STEPS && (i + 1) * (int64_t)STEP_NS < t_ns; i++)
                for (size_t k = 0; k < COUNT(lines); k++)
                    if (asked[k][i] != level[k])
                        fail_msg("%s at %d ns: %d asked", lines[k], (i + 1) * STEP_NS, asked[k][i]);
        }
        for (size_t k = 0; k < COUNT(lines) && (line[0] == '0' || line[0] == '1'); k++)
            if (line[1] == code[k]) level[k] = line[0] == '1', changes++;
    }
    assert_int_equal(i, STEPS);
    assert_true(changes > 500);
    (void)fclose(f);
    (void)unlink(v.path);
}

static void registers_are_reached_through_the_controller(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "psa2", "u", NULL);
    assert_int_equal(psabench_board_read(p, 0, 1, 1000), PSABENCH_TIMEOUT); /* the set-up is under way */
    assert_true(psabench_now_ns(b) == 1000);
    assert_int_equal(psabench_board_read(p, 0, 1, S), 0x56); /* waits for its end */
    assert_true(psabench_now_ns(b) > 100 * MS && psabench_now_ns(b) < 300 * MS);
    assert_int_equal(psabench_board_read(p, 2, 10, S), 0x40);
    assert_int_equal(psabench_board_read(p, 3, 3, S), 0x82);
    good(b, psabench_board_write(p, 1, 5, 0x12, S)); /* OFC0, to all three */
    for (unsigned g = 0; g < 3; g++) assert_int_equal(psabench_peek(p, 256 * g + 5), 0x12);
    good(b, psabench_board_write(p, 3, 1, 0x23, S));
    const struct {
        int got, want;
    } rows[] = {
        {psabench_board_read(p, 0, 11, S), PSABENCH_BAD_ARGUMENT},
        {psabench_board_read(p, 4, 0, S), PSABENCH_BAD_ARGUMENT},
        {psabench_board_read(p, 0, 256, S), PSABENCH_BAD_ARGUMENT},
        {psabench_board_read(p, 0, 0, -1), PSABENCH_BAD_ARGUMENT},
        {psabench_board_read(p, 0, 0, INT64_MAX), PSABENCH_BAD_ARGUMENT},
        {psabench_board_write(p, 0, 0, 1, S), PSABENCH_REFUSED},
        {psabench_board_write(p, 3, 3, 0x20, S), PSABENCH_REFUSED},
        {psabench_peek(p, 0x00B), PSABENCH_BAD_ARGUMENT},
        {psabench_peek(p, 0x400), PSABENCH_BAD_ARGUMENT},
    };
    for (size_t i = 0; i < COUNT(rows); i++)
        if (rows[i].got != rows[i].want) fail_msg("row %zu: %d", i, rows[i].got);
    psabench_free(b);
}

/* A request that outlives its time belongs to the board until it is answered. */
static void a_request_given_up_does_no_harm(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "psa2", "u", NULL);
    assert_int_equal(psabench_board_read(p, 0, 1, S), 0x56);
    assert_int_equal(psabench_board_read(p, 0, 4, 1), PSABENCH_TIMEOUT);
    assert_int_equal(psabench_board_read(p, 0, 3, 1), PSABENCH_TIMEOUT);
    assert_int_equal(psabench_board_read(p, 0, 3, S), 0x32);
    until(p, "DRD_A", 1);
    until(p, "DRD_A", 0);
    run(b, 5000); /* the controller is reading: the request waits */
    assert_int_equal(psabench_board_write(p, 0, 5, 0x12, 1), PSABENCH_TIMEOUT);
    assert_int_equal(psabench_board_read(p, 0, 3, S), 0x32); /* waits for the write, which is carried out */
    assert_int_equal(psabench_peek(p, 5), 0x12);
    assert_int_equal(psabench_board_read(p, 0, 4, 1), PSABENCH_TIMEOUT);
    psabench_free(b);
}

static void res_makes_a_reset_pulse(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "psa2", "u", NULL);
    until(p, "Int", 0);
    good(b, psabench_board_write(p, 0, 5, 0x12, S));
    assert_int_equal(psabench_pin_is_input(p, pin(p, "Res")), 1);
    set(p, "Res", 1); /* high it was */
    assert_int_equal(counter(p, "resets"), 0);
    set(p, "Res", 0);
    assert_int_equal(get(p, "Res"), 0);
    set(p, "Res", 0); /* the pulse is under way */
    assert_int_equal(counter(p, "resets"), 1);
    run(b, 10000);
    assert_int_equal(get(p, "Res"), 1);
    assert_int_equal(psabench_peek(p, 5), 0);
    psabench_free(b);
}

static double amps(void *ctx, psabench_part *p, int input, int64_t t_ns)
{
    (void)ctx;
    (void)p;
    (void)t_ns;
    return input == 0 ? 2.5e-3 : input == 1 ? -5e-3 : 0.0;
}

static void sensors_give_amperes_and_temperatures_are_inputs_too(void **state)
{
    (void)state;
    struct frames s = {.count = 0};
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "psa2", "u", "input=amps noise_scale=0 temp_noise_scale=0 temp_degc=0");
    good(b, psabench_set_input(p, amps, NULL));
    good(b, psabench_set_volts(p, 6, 100.0)); /* the board */
    assert_int_equal(psabench_set_volts(p, 7, 0.0), PSABENCH_BAD_ARGUMENT);
    good(b, psabench_on_frame(p, on_frame, &s));
    double degc[4] = {0};
    for (int i = 0; i < 400; i++) {
        run(b, MS);
        const double volts = s.last.temp_code * 5.0 / 32768.0;
        if (s.last.temp_channel < 4) degc[s.last.temp_channel] = volts / 10e3 / 1e-6 - 273.15;
    }
    assert_in_range(s.last.code[0], 2097152 - 500, 2097152 + 500);
    assert_in_range(s.last.code[1] + 8388608, 4194304 - 900, 4194304 + 900);
    assert_in_range(s.last.code[2] + 100, 98, 102);
    assert_true(degc[0] > -0.05 && degc[0] < 0.05);
    assert_true(degc[3] > 99.95 && degc[3] < 100.05);
    psabench_free(b);
}

/* The converters ask for their inputs when a data period ends; what was before a step keeps its volts all the same. */
static void a_step_is_felt_from_its_instant_on(void **state)
{
    (void)state;
    int32_t code[2];
    for (int k = 0; k < 2; k++) {
        struct frames s = {.count = 0};
        psabench *b = psabench_new(1);
        psabench_part *p = part(b, "psa2", "u", "noise_scale=0");
        good(b, psabench_on_frame(p, on_frame, &s));
        until(p, "Int", 0);
        until(p, "Int", 1);
        run(b, 100000 + k * 700000);
        good(b, psabench_set_volts(p, 0, 2.5));
        while (s.count < 6) until(p, "Int", 0), until(p, "Int", 1);
        code[k] = s.last.code[0];
        psabench_free(b);
    }
    assert_true(code[0] > code[1] + 100000); /* on the slope of the filter's answer */
}

/* A step tells the chains apart: the direct one has no slope. */
static void the_chain_is_a_choice(void **state)
{
    (void)state;
    static const char *const options[] = {"noise_scale=0 chain=exact", "noise_scale=0 chain=direct"};
    int slope[2] = {0, 0};
    for (int k = 0; k < 2; k++) {
        struct frames s = {.count = 0};
        psabench *b = psabench_new(1);
        psabench_part *p = part(b, "psa2", "u", options[k]);
        good(b, psabench_on_frame(p, on_frame, &s));
        run(b, 300 * MS);
        good(b, psabench_set_volts(p, 0, 2.5));
        for (int i = 0; i < 12; i++) {
            until(p, "Int", 0), until(p, "Int", 1);
            slope[k] += s.last.code[0] > 1000 && s.last.code[0] < 2000000;
        }
        psabench_free(b);
    }
    assert_true(slope[0] > 0 && slope[1] == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(profiles_are_those_of_the_files),
        cmocka_unit_test(each_field_of_a_profile_is_that_of_its_file),
        cmocka_unit_test(the_lines_carry_the_words_of_the_frame),
        cmocka_unit_test(a_step_is_felt_from_its_instant_on),
        cmocka_unit_test(the_chain_is_a_choice),
        cmocka_unit_test(int_can_be_waited_for_unwatched),
        cmocka_unit_test(levels_asked_are_levels_told),
        cmocka_unit_test(registers_are_reached_through_the_controller),
        cmocka_unit_test(a_request_given_up_does_no_harm),
        cmocka_unit_test(res_makes_a_reset_pulse),
        cmocka_unit_test(sensors_give_amperes_and_temperatures_are_inputs_too),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

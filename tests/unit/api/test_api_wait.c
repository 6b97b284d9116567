/* libpsabench: the next edge, interrupts that exchange bytes, the end of a program's time, violations. */
#include "api_rig.h"

#include <setjmp.h>

/* An ADS1256 at 30,000 SPS, selected and converting. */
static psabench_part *converting(psabench *b, const char *name)
{
    psabench_part *p = part(b, "ads1256", name, "start=at_once noise_scale=0");
    until(p, "DRDY", 0);
    set(p, "CS", 0);
    return p;
}

static void the_next_edge_is_never_the_level_that_is_there(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = converting(b, "u");
    const int drdy = pin(p, "DRDY");
    const int64_t fell_ns = psabench_now_ns(b);
    good(b, psabench_run_until_edge(p, drdy, PSABENCH_FALLING, MS));
    assert_in_range(psabench_now_ns(b) - fell_ns, 33333, 33334); /* 256 tau */
    assert_int_equal(psabench_get(p, drdy), 0);
    const int64_t again_ns = psabench_now_ns(b);
    good(b, psabench_run_until_edge(p, drdy, PSABENCH_RISING, MS));
    assert_in_range(psabench_now_ns(b) - again_ns, 31249, 31251); /* 16 tau before the next */
    good(b, psabench_run_until_edge(p, drdy, PSABENCH_EITHER, MS));
    assert_in_range(psabench_now_ns(b) - again_ns, 33332, 33334);
    assert_int_equal(psabench_run_until_edge(p, drdy, PSABENCH_FALLING, 1000), PSABENCH_TIMEOUT);
    assert_int_equal(psabench_run_until_edge(p, drdy, 3, MS), PSABENCH_BAD_ARGUMENT);
    assert_int_equal(psabench_run_until_edge(p, pin(p, "CS"), 0, MS), PSABENCH_BAD_ARGUMENT);
    assert_int_equal(psabench_run_until_edge(p, drdy, 0, -1), PSABENCH_BAD_ARGUMENT);
    psabench_part *board = part(b, "psa2", "board", NULL);
    assert_int_equal(psabench_run_until_edge(board, pin(board, "Int"), 0, MS), PSABENCH_NOT_HERE);
    psabench_free(b);
}

/* ---- interrupts ---- */

struct driver {
    unsigned words, nested, wrong;
    int64_t from_ns[50];
    int32_t code;
};

/* What a driver does when DRDY falls: RDATA, t6, 24 bits. */
static void read_word(void *ctx, psabench_part *p, int number)
{
    static const uint8_t rdata = 0x01;
    struct driver *d = ctx;
    uint8_t word[3];
    psabench *b = psabench_of(p);
    d->wrong += d->nested++ != 0 || number != pin(p, "DRDY") || psabench_get(p, number) != 0;
    if (d->words < COUNT(d->from_ns)) d->from_ns[d->words] = psabench_now_ns(b);
    good(b, psabench_spi(p, &rdata, NULL, 1));
    run(b, 7000);
    good(b, psabench_spi(p, NULL, word, 3));
    d->code = code24(word);
    d->words++;
    d->nested--;
    psabench_free(b); /* does nothing here */
}

static void a_handler_exchanges_bytes_while_the_program_waits(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = converting(b, "u");
    psabench_set_volts(p, 0, 1.0);
    run(b, MS);
    struct driver d = {.wrong = 0};
    psabench_spi_clock(p, 1900000, 0);
    good(b, psabench_on_interrupt(p, pin(p, "DRDY"), PSABENCH_FALLING, read_word, &d));
    run(b, 10 * 33334);
    assert_int_equal(d.words, 10);
    assert_int_equal(d.wrong, 0);
    assert_in_range(d.code, 1677720, 1677723); /* 1 V of +-5 V */
    for (unsigned i = 1; i < 10; i++) assert_in_range(d.from_ns[i] - d.from_ns[i - 1], 33333, 33334);
    assert_int_equal(psabench_check(p), PSABENCH_OK);
    good(b, psabench_on_interrupt(p, pin(p, "DRDY"), PSABENCH_FALLING, NULL, NULL));
    run(b, MS);
    assert_int_equal(d.words, 10);
    psabench_free(b);
}

/* The call that is interrupted ends when the handler has, even if its time was over before. */
static void what_is_interrupted_ends_after_the_handler(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = converting(b, "u");
    struct driver d = {.wrong = 0};
    good(b, psabench_on_interrupt(p, pin(p, "DRDY"), PSABENCH_FALLING, read_word, &d));
    const int64_t start_ns = psabench_now_ns(b);
    run(b, 33334); /* the edge is its last instant, or the one before */
    assert_in_range(psabench_now_ns(b) - start_ns, 33333 + 8000 + 7000 + 24000, 33335 + 8000 + 7000 + 24000);
    assert_int_equal(d.words, 1); /* though it took longer than a period: the program goes on */
    good(b, psabench_run_until_edge(p, pin(p, "DRDY"), PSABENCH_FALLING, MS));
    assert_int_equal(get(p, "DRDY"), 1);
    assert_int_equal(d.words, 2);
    good(b, psabench_run_until_interrupt(b, MS));
    assert_int_equal(d.words, 3);
    psabench_free(b);
}

static void a_level_that_the_handler_took_away_has_been_there(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = converting(b, "u");
    struct driver d = {.wrong = 0};
    psabench_spi_clock(p, 1900000, 0); /* a handler takes 24 us of a period of 33 us */
    good(b, psabench_on_interrupt(p, pin(p, "DRDY"), PSABENCH_FALLING, read_word, &d));
    good(b, psabench_run_until_interrupt(b, MS));
    assert_int_equal(get(p, "DRDY"), 1);
    good(b, psabench_run_until_level(p, pin(p, "DRDY"), 0, 10000)); /* over when the handler ends */
    assert_int_equal(get(p, "DRDY"), 1);
    assert_int_equal(d.words, 2);
    psabench_free(b);
}

static void interrupts_wait_while_they_are_masked_once_a_pin(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = converting(b, "u");
    struct driver d = {.wrong = 0};
    good(b, psabench_on_interrupt(p, pin(p, "DRDY"), PSABENCH_FALLING, read_word, &d));
    assert_int_equal(psabench_mask(b, 1), 0);
    good(b, psabench_run_until_interrupt(b, MS)); /* it waits */
    run(b, 5 * 33334);
    assert_int_equal(d.words, 0);
    assert_int_equal(psabench_mask(b, 0), 1);
    assert_int_equal(d.words, 0); /* served where time moves */
    run(b, 0);
    assert_int_equal(d.words, 1);
    assert_int_equal(psabench_mask(b, 2), PSABENCH_BAD_ARGUMENT);
    good(b, psabench_on_interrupt(p, pin(p, "DRDY"), PSABENCH_FALLING, NULL, NULL));
    assert_int_equal(psabench_run_until_interrupt(b, MS), PSABENCH_TIMEOUT);
    psabench_free(b);
}

/* Two chips in step: the second's edge falls into the first's handler, and waits. */
static void one_handler_runs_at_a_time(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    struct driver d = {.wrong = 0}, e = {.wrong = 0};
    psabench_part *p[2] = {converting(b, "u"), converting(b, "v")};
    good(b, psabench_on_interrupt(p[1], pin(p[1], "DRDY"), PSABENCH_FALLING, read_word, &e));
    good(b, psabench_on_interrupt(p[0], pin(p[0], "DRDY"), PSABENCH_FALLING, read_word, &d));
    psabench_spi_clock(p[0], 7680000 / 4, 0);
    psabench_spi_clock(p[1], 7680000 / 4, 0);
    run(b, 100000);
    assert_true(d.words >= 2 && e.words >= 2);
    assert_int_equal(e.wrong, 0);
    assert_int_equal(d.wrong, 0);
    psabench_free(b);
}

/* An exchange is one piece: the edge in its middle is served at its end. */
static void an_exchange_is_not_interrupted(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = converting(b, "u");
    psabench_part *q = converting(b, "v");
    struct driver d = {.wrong = 0};
    good(b, psabench_on_interrupt(p, pin(p, "DRDY"), PSABENCH_FALLING, read_word, &d));
    until(p, "DRDY", 0);
    d.words = 0;
    const int64_t start_ns = psabench_now_ns(b);
    good(b, psabench_spi(q, NULL, NULL, 6)); /* 48 us */
    assert_int_equal(d.words, 1);
    assert_true(d.from_ns[0] == start_ns + 48000);
    psabench_free(b);
}

/* ---- deadline ---- */

struct guard {
    jmp_buf out;
    unsigned calls;
    bool leave;
};

static void late(void *ctx, psabench *b)
{
    struct guard *g = ctx;
    (void)b;
    g->calls++;
    if (g->leave) longjmp(g->out, 1);
}

static void a_program_that_waits_for_ever_is_ended(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = converting(b, "u");
    struct guard g = {.leave = true};
    set(p, "SYNC", 0); /* stops the converter: DRDY stays high */
    const int64_t end_ns = psabench_now_ns(b) + 3 * MS;
    good(b, psabench_deadline(b, end_ns, late, &g));
    if (!setjmp(g.out))
        while (psabench_get(p, pin(p, "DRDY"))) (void)psabench_run_for(b, 700);
    assert_int_equal(g.calls, 1);
    assert_true(psabench_now_ns(b) == end_ns);
    assert_non_null(strstr(psabench_error_text(b), "nothing will happen by itself; u.DRDY=1"));
    assert_non_null(strstr(psabench_error_text(b), "u.SYNC=0"));
    g.leave = false;
    assert_int_equal(psabench_run_for(b, 1), PSABENCH_DEADLINE);
    assert_int_equal(psabench_run_until_level(p, pin(p, "DRDY"), 0, MS), PSABENCH_DEADLINE);
    assert_int_equal(psabench_run_until_edge(p, pin(p, "DRDY"), 0, MS), PSABENCH_DEADLINE);
    assert_int_equal(psabench_spi(p, NULL, NULL, 1), PSABENCH_DEADLINE);
    assert_int_equal(g.calls, 5);
    run(b, 0);
    assert_int_equal(psabench_deadline(b, end_ns - 1, NULL, NULL), PSABENCH_BAD_ARGUMENT);
    good(b, psabench_deadline(b, INT64_MAX, NULL, NULL));
    run(b, 1);
    psabench_free(b);
}

static void a_loop_that_lets_no_time_pass_is_ended(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = converting(b, "u");
    const int drdy = pin(p, "DRDY");
    set(p, "SYNC", 0);
    for (unsigned i = 0; i < 1000001; i++) assert_int_equal(psabench_get(p, drdy), 1); /* no deadline, no end */
    struct guard g = {.leave = false};
    good(b, psabench_deadline(b, psabench_now_ns(b) + S, late, &g));
    int level = 1;
    unsigned looks = 0;
    while (level == 1) level = psabench_get(p, drdy), looks++;
    assert_int_equal(level, PSABENCH_DEADLINE);
    assert_int_equal(looks, 1000000);
    assert_int_equal(g.calls, 1);
    run(b, 1);
    assert_int_equal(psabench_get(p, drdy), 1);
    psabench_free(b);
}

/* A handler that is still at it is left, too; what comes after is served again. */
struct stuck {
    struct guard g;
    bool once;
    unsigned calls;
};

static void wait_for_ever(void *ctx, psabench_part *p, int number)
{
    struct stuck *k = ctx;
    (void)number;
    k->calls++;
    while (k->once) (void)psabench_run_for(psabench_of(p), 1000);
}

static void a_handler_that_waits_for_ever_is_ended(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = converting(b, "u");
    struct stuck k = {.g = {.leave = true}, .once = true};
    good(b, psabench_on_interrupt(p, pin(p, "DRDY"), PSABENCH_FALLING, wait_for_ever, &k));
    good(b, psabench_deadline(b, psabench_now_ns(b) + MS, late, &k.g));
    if (!setjmp(k.g.out)) run(b, S);
    assert_int_equal(k.g.calls, 1);
    assert_int_equal(k.calls, 1);
    k.once = false;
    good(b, psabench_deadline(b, INT64_MAX, NULL, NULL));
    run(b, 10 * 33334);
    assert_in_range(k.calls, 11, 12);
    psabench_free(b);
}

/* ---- violations ---- */

static void counters_are_found_by_name(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = converting(b, "u");
    uint64_t value;
    for (int i = 0; psabench_counter(p, i, &value); i++)
        assert_true(psabench_count(p, psabench_counter(p, i, NULL)) == (int64_t)value);
    assert_true(psabench_count(p, "conversions") > 0);
    assert_int_equal(psabench_count(p, "frames"), PSABENCH_BAD_ARGUMENT);
    assert_non_null(strstr(psabench_error_text(b), "u: counter of ads1256: expected one of conversions"));
    assert_int_equal(psabench_count(p, NULL), PSABENCH_BAD_ARGUMENT);
    assert_int_equal(psabench_count(NULL, "conversions"), PSABENCH_BAD_ARGUMENT);
    psabench_free(b);
}

static void a_check_names_what_the_program_did_wrong(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = converting(b, "u");
    assert_int_equal(psabench_check(p), PSABENCH_OK);
    assert_int_equal(psabench_spi(p, (const uint8_t[]){0x01, 0, 0, 0}, NULL, 4), PSABENCH_OK); /* no t6 */
    assert_int_equal(psabench_check(p), PSABENCH_VIOLATED);
    assert_string_equal(psabench_error_text(b), "u: expected no violations of the data sheet, got gap_violations 1");
    uint64_t value;
    unsigned found = 0;
    for (int i = 0; psabench_violation(p, i, &value); i++) found += value != 0;
    assert_int_equal(found, 1);
    psabench_part *board = part(b, "psa2", "board", NULL);
    assert_int_equal(psabench_check(board), PSABENCH_OK);
    assert_string_equal(psabench_violation(board, 0, NULL), "edges_dropped");
    assert_null(psabench_violation(board, 2, NULL));
    psabench_free(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_next_edge_is_never_the_level_that_is_there),
        cmocka_unit_test(a_handler_exchanges_bytes_while_the_program_waits),
        cmocka_unit_test(what_is_interrupted_ends_after_the_handler),
        cmocka_unit_test(a_level_that_the_handler_took_away_has_been_there),
        cmocka_unit_test(interrupts_wait_while_they_are_masked_once_a_pin),
        cmocka_unit_test(one_handler_runs_at_a_time),
        cmocka_unit_test(an_exchange_is_not_interrupted),
        cmocka_unit_test(a_program_that_waits_for_ever_is_ended),
        cmocka_unit_test(a_loop_that_lets_no_time_pass_is_ended),
        cmocka_unit_test(a_handler_that_waits_for_ever_is_ended),
        cmocka_unit_test(counters_are_found_by_name),
        cmocka_unit_test(a_check_names_what_the_program_did_wrong),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

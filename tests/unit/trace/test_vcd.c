#include "rig.h"

#include "trace/vcd.h"

#include <errno.h>
#include <string.h>

static struct trace trace;
static struct vcd vcd;
static char text[1 << 20];

static int fresh(void **state)
{
    (void)state;
    memset(&trace, 0, sizeof trace);
    trace_add(&trace, "Int", true);
    trace_add(&trace, "CLK", false);
    return 0;
}

static FILE *open_vcd_from(uint32_t unit_ns, int64_t from_ns)
{
    FILE *f = tmpfile();
    assert_non_null(f);
    const struct vcd_cfg cfg = {.out = f, .scope = "unit1", .unit_ns = unit_ns, .mask = 3, .from_ns = from_ns};
    assert_true(vcd_open(&vcd, &cfg, &trace));
    return f;
}

static FILE *open_vcd(uint32_t unit_ns)
{
    return open_vcd_from(unit_ns, 0);
}

static const char *read_back(FILE *f)
{
    rewind(f);
    const size_t n = fread(text, 1, sizeof text - 1, f);
    text[n] = '\0';
    return text;
}

#define HEADER(unit)                                                                                                   \
    "$version psabench $end\n$timescale " unit " $end\n$scope module unit1 $end\n$var wire 1 ! Int $end\n"             \
    "$var wire 1 \" CLK $end\n$upscope $end\n$enddefinitions $end\n"

static void the_file_is_what_ieee_1364_says_and_ends_after_the_last_edge(void **state)
{
    (void)state;
    FILE *f = open_vcd(10);
    trace_set(&trace, 0, false, 1000);
    trace_set(&trace, 1, true, 1250);
    trace_set(&trace, 1, false, 1500);
    trace_set(&trace, 0, true, 1500);
    trace_advance(&trace, 1500);
    vcd_close(&vcd, 1500); /* the run ended on the edge itself */
    assert_string_equal(read_back(f), HEADER("10 ns") "#0\n$dumpvars\n1!\n0\"\n$end\n"
                                                      "#100\n0!\n#125\n1\"\n#150\n0\"\n1!\n#151\n");
    assert_int_equal(vcd_error(&vcd), 0);
    assert_int_equal(vcd.changes, 4);
    fclose(f);
}

static void sixty_four_lines_have_codes_of_their_own(void **state)
{
    (void)state;
    memset(&trace, 0, sizeof trace);
    for (unsigned i = 0; i < TRACE_SIGNALS_MAX; i++) (void)trace_add(&trace, i == 63 ? "last" : "line", false);
    FILE *f = tmpfile();
    assert_non_null(f);
    const struct vcd_cfg cfg = {
        .out = f, .scope = "unit1", .unit_ns = 10, .mask = TRACE_BIT(0) | TRACE_BIT(33) | TRACE_BIT(63)};
    assert_true(vcd_open(&vcd, &cfg, &trace));
    trace_set(&trace, 63, true, 1000);
    trace_set(&trace, 33, true, 1010);
    trace_advance(&trace, 1500);
    vcd_close(&vcd, 1500);
    const char *const got = read_back(f);
    assert_non_null(strstr(got, "$var wire 1 B line $end\n$var wire 1 ` last $end\n"));
    assert_non_null(strstr(got, "#0\n$dumpvars\n0!\n0B\n0`\n$end\n#100\n1`\n#101\n1B\n#150\n"));
    fclose(f);
}

static void times_are_rounded_down_to_the_unit(void **state)
{
    (void)state;
    const struct {
        uint32_t unit_ns;
        const char *name;
        int64_t t_ns, units;
    } row[] = {
        {1, "1 ns", 244, 244},           {10, "10 ns", 244, 24},
        {10, "10 ns", 249, 24},          {10, "10 ns", 250, 25},
        {100, "100 ns", 99, 0},          {1000, "1 us", 74000, 74},
        {1000000, "1 ms", 63090000, 63}, {10, "10 ns", INT64_C(3600000000000), INT64_C(360000000000)}, /* an hour */
    };
    for (size_t i = 0; i < COUNT(row); i++) {
        fresh(NULL);
        FILE *f = open_vcd(row[i].unit_ns);
        trace_set(&trace, 1, true, row[i].t_ns);
        trace_advance(&trace, row[i].t_ns);
        vcd_close(&vcd, row[i].t_ns);
        char want[64], scale[64];
        snprintf(want, sizeof want, "%s%lld\n1\"\n#%lld\n", row[i].units ? "#" : "", (long long)row[i].units,
                 (long long)row[i].units + 1);
        snprintf(scale, sizeof scale, "$timescale %s $end\n", row[i].name);
        read_back(f);
        assert_non_null(strstr(text, row[i].units ? want : "$end\n1\"\n#1\n"));
        assert_non_null(strstr(text, scale));
        fclose(f);
    }
}

/* Every count of digits, both sides of each place where one carries, as printf writes them. */
static void times_have_the_digits_that_printf_gives(void **state)
{
    (void)state;
    static char want[1 << 16];
    size_t n = 0;
    FILE *f = open_vcd(1);
    bool level = false;
    for (int64_t ten = 10; ten <= INT64_C(100000000000000000); ten *= 10) {
        for (int64_t t = ten - 2; t <= ten + 20002; t += t < ten + 1 ? 1 : 3333) {
            level = !level;
            trace_set(&trace, 1, level, t);
            trace_advance(&trace, t);
            n += (size_t)snprintf(want + n, sizeof want - n, "#%lld\n%d\"\n", (long long)t, level);
        }
        if (ten == 10) ten = 10000; /* small times would run into one another */
    }
    vcd_close(&vcd, trace.done_ns);
    assert_non_null(strstr(read_back(f), want));
    fclose(f);
}

/* The last and the first nanosecond of units all over a chunk of 10000, in every unit, as integer division has them. */
static void both_ends_of_a_unit_belong_to_it(void **state)
{
    (void)state;
    static char want[1 << 18];
    for (uint32_t unit = 1; unit <= 100000000; unit *= 10) {
        fresh(NULL);
        FILE *f = open_vcd(unit);
        size_t n = 0;
        int64_t seen = 0;
        for (int64_t k = 10000; k <= 40000; k += k % 10000 < 9990 ? 37 : 1)
            for (int64_t t = k * unit - (unit > 1); t <= k * unit; t++) {
                trace_set(&trace, 1, !(trace_known(&trace, t) >> 1 & 1), t);
                trace_advance(&trace, t);
                if (t / unit != seen)
                    n += (size_t)snprintf(want + n, sizeof want - n, "#%lld\n", (long long)(t / unit));
                n += (size_t)snprintf(want + n, sizeof want - n, "%d\"\n", (int)(trace.level >> 1 & 1));
                seen = t / unit;
            }
        vcd_close(&vcd, trace.done_ns);
        assert_non_null(strstr(read_back(f), want));
        fclose(f);
    }
}

static void a_unit_that_vcd_does_not_know_is_refused(void **state)
{
    (void)state;
    const uint32_t unit[] = {0, 2, 25, 50, 250, 1000000000};
    for (size_t i = 0; i < COUNT(unit); i++) {
        const struct vcd_cfg cfg = {.out = stdout, .scope = "x", .unit_ns = unit[i], .mask = 3};
        assert_false(vcd_open(&vcd, &cfg, &trace));
        assert_null(trace.sinks);
    }
}

static void a_late_start_begins_at_its_own_time(void **state)
{
    (void)state;
    trace_set(&trace, 1, true, 100);
    trace_advance(&trace, 5000);
    FILE *f = open_vcd(10);
    vcd_close(&vcd, 6000);
    assert_string_equal(read_back(f), HEADER("10 ns") "#500\n$dumpvars\n1!\n1\"\n$end\n#600\n");
    fclose(f);
}

/* The trace lags behind the board, which has kept its edges to itself until now: the file begins now. */
static void edges_before_its_start_are_in_its_first_levels(void **state)
{
    (void)state;
    trace_advance(&trace, 5000);
    FILE *f = open_vcd_from(10, 7000);
    vcd_flush(&vcd);
    assert_string_equal(read_back(f), HEADER("10 ns"));
    trace_set(&trace, 0, false, 5500);
    trace_set(&trace, 1, true, 6990);
    trace_set(&trace, 0, true, 7000);
    trace_set(&trace, 0, false, 7500);
    trace_advance(&trace, 6995);
    trace_advance(&trace, 8000);
    vcd_close(&vcd, 9000);
    assert_string_equal(read_back(f), HEADER("10 ns") "#700\n$dumpvars\n0!\n1\"\n$end\n1!\n#750\n0!\n#900\n");
    fclose(f);
}

static void listen(void *ctx, const struct trace_step *s, unsigned n)
{
    (void)ctx;
    (void)s;
    (void)n;
}

static struct trace_sink listener = {.mask = 3, .steps = listen};

/* Time is at 7000 when the recording is asked for: what has happened there already is no edge of it, what follows is. */
static void edges_at_its_start_count_from_the_command_on(void **state)
{
    (void)state;
    trace_attach(&trace, &listener);
    trace_advance(&trace, 5000);
    trace_set(&trace, 1, true, 7000);
    FILE *f = open_vcd_from(10, 7000);
    trace_set(&trace, 0, false, 7000);
    trace_advance(&trace, 7000);
    vcd_close(&vcd, 9000);
    assert_string_equal(read_back(f), HEADER("10 ns") "#700\n$dumpvars\n1!\n1\"\n$end\n0!\n#900\n");
    fclose(f);
}

static void a_quiet_start_is_told_when_the_trace_has_come_to_it(void **state)
{
    (void)state;
    FILE *f = open_vcd_from(10, 7000);
    trace_advance(&trace, 6999);
    vcd_flush(&vcd);
    assert_string_equal(read_back(f), HEADER("10 ns"));
    trace_advance(&trace, 7500);
    vcd_flush(&vcd);
    assert_string_equal(read_back(f), HEADER("10 ns") "#700\n$dumpvars\n1!\n0\"\n$end\n#750\n");
    vcd_close(&vcd, 7500);
    fclose(f);
}

static void a_recording_that_ends_before_its_start_is_delivered_has_its_levels(void **state)
{
    (void)state;
    trace_attach(&trace, &listener);
    trace_set(&trace, 1, true, 5000);
    trace_advance(&trace, 6000);
    trace_set(&trace, 0, false, 6500);
    FILE *f = open_vcd_from(10, 7000);
    vcd_close(&vcd, 6800);
    assert_string_equal(read_back(f), HEADER("10 ns") "#700\n$dumpvars\n0!\n1\"\n$end\n#701\n");
    fclose(f);
}

static void a_flushed_file_can_be_looked_at_while_it_grows(void **state)
{
    (void)state;
    FILE *f = open_vcd(10);
    trace_set(&trace, 1, true, 100);
    trace_advance(&trace, 400);
    vcd_flush(&vcd);
    assert_non_null(strstr(read_back(f), "#10\n1\"\n#40\n"));
    trace_set(&trace, 1, false, 400);
    trace_advance(&trace, 400);
    vcd_flush(&vcd);
    vcd_close(&vcd, 400);
    assert_non_null(strstr(read_back(f), "#10\n1\"\n#40\n0\"\n#41\n"));
    fclose(f);
}

/* More than the buffer holds: every line arrives, whole and in order. */
static void long_recordings_survive_the_buffer(void **state)
{
    (void)state;
    FILE *f = open_vcd(1);
    for (int i = 1; i <= 30000; i++) {
        trace_set(&trace, 1, i & 1, 10 * i);
        trace_advance(&trace, 10 * i);
    }
    vcd_close(&vcd, 400000);
    const char *p = strstr(read_back(f), "$end\n#10\n");
    assert_non_null(p);
    p += 5;
    for (int i = 1; i <= 30000; i++) {
        char want[32];
        const int n = snprintf(want, sizeof want, "#%d\n%d\"\n", 10 * i, i & 1);
        assert_memory_equal(p, want, (size_t)n);
        p += n;
    }
    assert_string_equal(p, "#400000\n");
    fclose(f);
}

/* ---- real-valued channels ---- */

static struct trace_reals reals = {.name = {"U_X", "U_K"}, .count = 2};

static FILE *open_with_reals(bool wanted)
{
    FILE *f = tmpfile();
    assert_non_null(f);
    trace.reals = &reals;
    const struct vcd_cfg cfg = {.out = f, .scope = "unit1", .unit_ns = 10, .mask = 3, .reals = wanted};
    assert_true(vcd_open(&vcd, &cfg, &trace));
    assert_true(trace_real_watched(&reals) == wanted);
    return f;
}

/* Edges of before, reported after it, stand before it. */
static void real_values_stand_between_the_edges(void **state)
{
    (void)state;
    FILE *f = open_with_reals(true);
    trace_set(&trace, 0, false, 1000);
    trace_real(&reals, 0, 1.25, 1100);
    trace_real(&reals, 1, -3.0, 1500);
    trace_set(&trace, 1, true, 1050);
    trace_set(&trace, 1, false, 1500);
    trace_set(&trace, 0, true, 2000);
    trace_advance(&trace, 1800);
    trace_real(&reals, 1, 1e-7, 2500);
    trace_advance(&trace, 3000);
    vcd_close(&vcd, 4000);
    assert_false(trace_real_watched(&reals));
    const char *body = strstr(read_back(f), "$end\n#");
    assert_non_null(
        strstr(text, "$var wire 1 \" CLK $end\n$var real 64 a U_X $end\n$var real 64 b U_K $end\n$upscope"));
    assert_string_equal(body,
                        "$end\n#0\n$dumpvars\n1!\n0\"\n$end\n#100\n0!\n#105\n1\"\n#110\nr1.25 a\n#150\n0\"\nr-3 b\n"
                        "#200\n1!\n#250\nr1e-07 b\n#400\n");
    assert_int_equal(vcd_error(&vcd), 0);
    fclose(f);
}

static void real_values_come_on_request_alone(void **state)
{
    (void)state;
    FILE *f = open_with_reals(false);
    trace_real(&reals, 0, 1.25, 1100);
    trace_advance(&trace, 3000);
    vcd_close(&vcd, 4000);
    assert_null(strstr(read_back(f), "U_X"));
    assert_null(strstr(text, "r1.25"));
    fclose(f);
}

static void more_real_values_than_can_wait_are_an_error(void **state)
{
    (void)state;
    FILE *f = open_with_reals(true);
    for (unsigned i = 0; i < VCD_REALS; i++) trace_real(&reals, 0, i, 1000 + i);
    assert_int_equal(vcd_error(&vcd), 0);
    trace_real(&reals, 0, 1.0, 9000);
    assert_int_equal(vcd_error(&vcd), ENOBUFS);
    vcd_close(&vcd, 10000);
    fclose(f);
}

static void a_full_disk_is_told_once_and_stops_nothing(void **state)
{
    (void)state;
    FILE *f = fopen("/dev/full", "w");
    if (!f) skip();
    const struct vcd_cfg cfg = {.out = f, .scope = "unit1", .unit_ns = 10, .mask = 3};
    assert_true(vcd_open(&vcd, &cfg, &trace));
    for (int i = 1; i <= 30000; i++) {
        trace_set(&trace, 1, i & 1, 10 * i);
        trace_advance(&trace, 10 * i);
    }
    assert_int_equal(vcd_error(&vcd), ENOSPC);
    assert_int_equal(vcd_error(&vcd), 0);
    vcd_close(&vcd, 400000);
    assert_int_equal(vcd_error(&vcd), 0);
    fclose(f);
}

enum { TICKS = 20000 };

/* All lines move at each instant, one of them with the code '#'. Bytes of the file. */
static size_t record_until(uint64_t max_bytes, char *out, size_t cap)
{
    memset(&trace, 0, sizeof trace);
    for (int i = 0; i < 5; i++) trace_add(&trace, "Line", false);
    FILE *f = tmpfile();
    assert_non_null(f);
    const struct vcd_cfg cfg = {.out = f, .scope = "unit1", .unit_ns = 10, .mask = 31, .max_bytes = max_bytes};
    assert_true(vcd_open(&vcd, &cfg, &trace));
    for (int i = 1; i <= TICKS; i++) {
        for (unsigned line = 0; line < 5; line++) trace_set(&trace, line, i & 1, INT64_C(70) * i);
        trace_advance(&trace, INT64_C(70) * i);
    }
    vcd_close(&vcd, INT64_C(70) * TICKS);
    rewind(f);
    const size_t n = fread(out, 1, cap - 1, f);
    out[n] = '\0';
    fclose(f);
    return n;
}

static void a_file_that_ends_at_its_limit_is_whole_up_to_its_closing_time(void **state)
{
    (void)state;
    static char whole[1 << 20];
    const size_t all = record_until(0, whole, sizeof whole);
    assert_int_equal(vcd_error(&vcd), 0);
    assert_true(all > 400000 && all < sizeof whole - 1);
    for (uint64_t max_bytes = 66000; max_bytes < all; max_bytes += 4567) {
        const size_t n = record_until(max_bytes, text, sizeof text);
        assert_int_equal(vcd_error(&vcd), EFBIG);
        assert_true(vcd.limited && vcd.bytes == n);
        assert_true(n <= max_bytes && n + 1024 > max_bytes);
        assert_memory_equal(text, whole, n);
        assert_int_equal(text[n - 1], '\n');
        const char *last = strrchr(text, '#');
        assert_true(last[-1] == '\n' && strchr(last, '\n') == text + n - 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(the_file_is_what_ieee_1364_says_and_ends_after_the_last_edge, fresh),
        cmocka_unit_test(a_file_that_ends_at_its_limit_is_whole_up_to_its_closing_time),
        cmocka_unit_test_setup(sixty_four_lines_have_codes_of_their_own, fresh),
        cmocka_unit_test(times_are_rounded_down_to_the_unit),
        cmocka_unit_test_setup(times_have_the_digits_that_printf_gives, fresh),
        cmocka_unit_test(both_ends_of_a_unit_belong_to_it),
        cmocka_unit_test_setup(a_unit_that_vcd_does_not_know_is_refused, fresh),
        cmocka_unit_test_setup(a_late_start_begins_at_its_own_time, fresh),
        cmocka_unit_test_setup(edges_before_its_start_are_in_its_first_levels, fresh),
        cmocka_unit_test_setup(edges_at_its_start_count_from_the_command_on, fresh),
        cmocka_unit_test_setup(a_quiet_start_is_told_when_the_trace_has_come_to_it, fresh),
        cmocka_unit_test_setup(a_recording_that_ends_before_its_start_is_delivered_has_its_levels, fresh),
        cmocka_unit_test_setup(a_flushed_file_can_be_looked_at_while_it_grows, fresh),
        cmocka_unit_test_setup(long_recordings_survive_the_buffer, fresh),
        cmocka_unit_test_setup(real_values_stand_between_the_edges, fresh),
        cmocka_unit_test_setup(real_values_come_on_request_alone, fresh),
        cmocka_unit_test_setup(more_real_values_than_can_wait_are_an_error, fresh),
        cmocka_unit_test_setup(a_full_disk_is_told_once_and_stops_nothing, fresh),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

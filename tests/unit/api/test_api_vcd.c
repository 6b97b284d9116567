/* libpsabench: recordings of several parts, chips and boards, read back. */
#include "api_rig.h"

#include "api/internal.h"

#include <signal.h>
#include <sys/resource.h>

static unsigned count(const struct rig_vcd *v, const char *name)
{
    unsigned n = 0;
    for (unsigned i = 0; i < v->count; i++) n += strcmp(v->change[i].name, name) == 0;
    return n;
}

static void every_part_has_a_scope_and_every_pin_its_changes(void **state)
{
    (void)state;
    static struct rig_vcd v;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ads1256", "left", "start=at_once");
    psabench_part *q = part(b, "ads1255", "right", "start=at_once");
    run(b, 20000);
    set(p, "CS", 0);
    rig_vcd_path(&v);
    good(b, psabench_vcd(b, v.path));
    run(b, 100);
    (void)part(b, "ads1256", "late", "start=at_once"); /* not in the file */
    set(p, "CS", 1);
    set(p, "CS", 1);
    set(q, "D1", 1);
    run(b, 2 * MS);
    good(b, psabench_vcd_close(b));
    good(b, psabench_vcd_close(b));
    assert_true(p->recorded == 0 && q->recorded == 0); /* else it would go on in memory */
    rig_vcd_read(&v);
    assert_true(v.start_ns == 20000 && v.end_ns == psabench_now_ns(b));
    assert_int_equal(count(&v, "left.CS"), 1);
    assert_int_equal(count(&v, "right.D1"), 1);
    assert_true(v.change[0].t_ns == 20100);
    assert_int_equal(v.change[0].level, 1);
    const unsigned drdy = count(&v, "left.DRDY");
    assert_true(drdy > 50 && count(&v, "right.DRDY") == drdy);
    for (unsigned i = 0; i < v.count; i++) assert_null(strstr(v.change[i].name, "late"));
    psabench_free(b);
}

/* Edges that a board reports late are in order of time with those of a chip beside it. */
static void a_board_and_a_chip_share_a_recording(void **state)
{
    (void)state;
    static struct rig_vcd v;
    psabench *b = psabench_new(1);
    psabench_part *adc = part(b, "ads1256", "adc", "start=at_once");
    psabench_part *psa = part(b, "psa2", "psa", NULL);
    run(b, 200 * MS); /* frames flow */
    until(psa, "Int", 1);
    until(psa, "Int", 0);
    rig_vcd_path(&v);
    good(b, psabench_vcd(b, v.path)); /* in the middle of a frame */
    for (int i = 0; i < 100; i++) {
        run(b, 20011);
        set(adc, "CS", i & 1);
    }
    good(b, psabench_vcd(b, v.path)); /* ends the first one: same file, begun again */
    run(b, 3 * MS);
    set(adc, "CS", 0);
    run(b, 100);
    set(adc, "CS", 1); /* the last thing that happens */
    const int64_t end_ns = psabench_now_ns(b);
    psabench_free(b); /* closes */
    rig_vcd_read(&v); /* asserts that time rises */
    assert_int_equal(count(&v, "psa.Int"), 6);
    assert_int_equal(count(&v, "adc.CS"), 2);
    assert_true(count(&v, "psa.CLK") == 3 * 4 * 32 * 2);
    assert_true(count(&v, "adc.DRDY") > 100);
    assert_string_equal(v.change[v.count - 1].name, "adc.CS");
    assert_true(v.change[v.count - 1].t_ns == end_ns);
    assert_true(v.end_ns == end_ns + 1); /* a closing time behind the last change */
}

static void a_recording_does_not_change_what_happens(void **state)
{
    (void)state;
    static struct rig_vcd v;
    uint64_t value[2];
    int word[2] = {0, 0};
    for (int k = 0; k < 2; k++) {
        psabench *b = psabench_new(1);
        psabench_part *psa = part(b, "psa2", "psa", NULL);
        psabench_part *adc = part(b, "ads1256", "adc", NULL);
        rig_vcd_path(&v);
        if (k) good(b, psabench_vcd(b, v.path));
        run(b, 250 * MS);
        value[k] = counter(psa, "frames");
        word[k] = (int)counter(adc, "conversions");
        psabench_free(b);
        (void)unlink(v.path);
    }
    assert_true(value[0] == value[1] && value[0] > 10);
    assert_int_equal(word[0], word[1]);
}

static void a_full_disk_is_told_when_the_recording_ends(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    (void)part(b, "ads1256", "u", "start=at_once");
    if (psabench_vcd(b, "/dev/full") != PSABENCH_OK) skip(); /* no such device */
    run(b, 100 * MS);
    assert_int_equal(psabench_vcd_close(b), PSABENCH_SYSTEM);
    assert_non_null(strstr(psabench_error_text(b), "No space left"));
    good(b, psabench_vcd_close(b));
    psabench_free(b);
}

/* The disk was full for a while only: the file has a hole. */
static void a_write_that_failed_on_the_way_is_told_too(void **state)
{
    (void)state;
    static struct rig_vcd v;
    struct rlimit was;
    psabench *b = psabench_new(1);
    (void)part(b, "ads1256", "u", "start=at_once");
    rig_vcd_path(&v);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &was), 0);
    const struct rlimit small = {.rlim_cur = 8192, .rlim_max = was.rlim_max};
    void (*handler)(int) = signal(SIGXFSZ, SIG_IGN);
    good(b, psabench_vcd(b, v.path));
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    run(b, 100 * MS);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &was), 0);
    assert_int_equal(psabench_vcd_close(b), PSABENCH_SYSTEM);
    (void)signal(SIGXFSZ, handler);
    psabench_free(b);
    (void)unlink(v.path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_part_has_a_scope_and_every_pin_its_changes),
        cmocka_unit_test(a_board_and_a_chip_share_a_recording),
        cmocka_unit_test(a_recording_does_not_change_what_happens),
        cmocka_unit_test(a_full_disk_is_told_when_the_recording_ends),
        cmocka_unit_test(a_write_that_failed_on_the_way_is_told_too),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

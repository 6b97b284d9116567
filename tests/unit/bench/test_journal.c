#include "rig.h"

#include "bench/journal.h"

#include <string.h>

#define SECOND INT64_C(1000000000)

static void each_announcement_comes_once_with_the_instant_of_the_end(void **state)
{
    struct journal j = {.len = JOURNAL_MAX / 2 - 1000};
    char news[JOURNAL_NEWS_MAX];
    (void)state;
    assert_false(journal_news(&j, 600 * SECOND, news));
    j.len = JOURNAL_MAX / 64 * 33;
    assert_true(journal_news(&j, 600 * SECOND, news));
    assert_string_equal(news,
                        "input log: 50 % of 64 MiB are used after 600 s of simulated time; at this rate it is full at "
                        "1164 s, and snapshots are not possible from then on");
    assert_false(journal_news(&j, 700 * SECOND, news));
    j.len = JOURNAL_MAX - 1000;
    assert_true(journal_news(&j, 1200 * SECOND, news));
    assert_non_null(
        strstr(news, "90 % of 64 MiB are used after 1200 s of simulated time; at this rate it is full at 1200 s"));
    assert_false(journal_news(&j, 1200 * SECOND, news));
    j.lost = "more has come";
    assert_true(journal_news(&j, 1201 * SECOND, news));
    assert_string_equal(news, "input log: more has come; snapshots are not possible from now on");
    assert_false(journal_news(&j, 1300 * SECOND, news));
}

static void a_log_without_memory_is_lost_at_once(void **state)
{
    struct journal j = {.len = 100, .lost = "out of memory for the input log"};
    char news[JOURNAL_NEWS_MAX];
    (void)state;
    assert_true(journal_news(&j, SECOND, news));
    assert_non_null(strstr(news, "out of memory"));
    assert_false(journal_news(&j, SECOND, news));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_announcement_comes_once_with_the_instant_of_the_end),
        cmocka_unit_test(a_log_without_memory_is_lost_at_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Where LCM messages go: URLs, and event logs to the byte. What a full disk does is in tests/e2e/faults/test_outputs.py. */
#define _GNU_SOURCE /* mkstemp */
#include "rig.h"

#include "link/lcm/lcm_log.h"
#include "link/lcm/lcm_url.h"

#include <errno.h>
#include <signal.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

static void urls_are_read_as_lcm_has_them(void **state)
{
    static const struct {
        const char *text;
        enum lcm_kind kind;
        uint8_t group[4];
        uint16_t port;
        const char *path;
    } rows[] = {
        {"udpm://", LCM_UDPM, {239, 255, 76, 67}, 7667, NULL},
        {"udpm://?ttl=0", LCM_UDPM, {239, 255, 76, 67}, 7667, NULL},
        {"udpm://239.255.76.67:7667?ttl=0", LCM_UDPM, {239, 255, 76, 67}, 7667, NULL},
        {"udpm://224.0.0.1", LCM_UDPM, {224, 0, 0, 1}, 7667, NULL},
        {"udpm://:7668", LCM_UDPM, {239, 255, 76, 67}, 7668, NULL},
        {"udpm://239.255.255.255:65535?", LCM_UDPM, {239, 255, 255, 255}, 65535, NULL},
        {"file://run.lcmlog", LCM_FILE, {0}, 0, "run.lcmlog"},
        {"file:///tmp/a b", LCM_FILE, {0}, 0, "/tmp/a b"},
    };
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct lcm_url u;
        char why[256] = "";
        if (!lcm_url_parse(rows[i].text, "--lcm", &u, why, sizeof why)) fail_msg("%s: %s", rows[i].text, why);
        assert_int_equal(u.kind, rows[i].kind);
        assert_int_equal(u.port, rows[i].port);
        assert_memory_equal(u.group, rows[i].group, sizeof u.group);
        if (rows[i].path) assert_string_equal(u.path, rows[i].path);
    }
}

static void other_urls_are_rejected_in_words(void **state)
{
    static const struct {
        const char *text, *words;
    } rows[] = {
        {"", "file://PATH or udpm://"},
        {"run.lcmlog", "file://PATH or udpm://"},
        {"memq://", "file://PATH or udpm://"},
        {"tcpq://127.0.0.1:7700", "file://PATH or udpm://"},
        {"file://", "file://PATH without options"},
        {"file://a?mode=a", "file://PATH without options"},
        {"udpm://239.255.76.67:7667?ttl=1", "ttl=0, so that messages stay on this machine"},
        {"udpm://?ttl=00", "ttl=0, so that messages stay on this machine"},
        {"udpm://?ttl=0&ttl=1", "ttl=0, so that messages stay on this machine"},
        {"udpm://?recv_buf_size=1", "a multicast group from 224.0.0.0"},
        {"udpm://127.0.0.1:7667", "a multicast group from 224.0.0.0"},
        {"udpm://240.0.0.1", "a multicast group from 224.0.0.0"},
        {"udpm://239.255.76", "a multicast group from 224.0.0.0"},
        {"udpm://239.255.76.67.1", "a multicast group from 224.0.0.0"},
        {"udpm://239.256.76.67", "a multicast group from 224.0.0.0"},
        {"udpm://239.255.076.67", "a multicast group from 224.0.0.0"},
        {"udpm://239.255.76.67:0", "a multicast group from 224.0.0.0"},
        {"udpm://239.255.76.67:65536", "a multicast group from 224.0.0.0"},
        {"udpm://239.255.76.67:99999999999999999999", "a multicast group from 224.0.0.0"},
        {"udpm://239.255.76.67:", "a multicast group from 224.0.0.0"},
        {"udpm:// ", "a multicast group from 224.0.0.0"},
    };
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct lcm_url u;
        char why[256] = "";
        if (lcm_url_parse(rows[i].text, "--lcm", &u, why, sizeof why)) fail_msg("%s passes", rows[i].text);
        if (!strstr(why, rows[i].words) || strncmp(why, "--lcm: expected ", 16) != 0)
            fail_msg("%s: %s", rows[i].text, why);
    }
}

/* ---- event logs */

static struct {
    struct lcm_log log;
    char path[64];
    uint8_t file[262144];
} r;

static int fresh(void **state)
{
    (void)state;
    memset(&r, 0, sizeof r);
    strcpy(r.path, "/tmp/psabench-lcm-XXXXXX");
    const int fd = mkstemp(r.path);
    assert_true(fd >= 0);
    close(fd);
    long owner = 0;
    assert_int_equal(lcm_log_open(&r.log, r.path, &owner), 0);
    return 0;
}

static int forget(void **state)
{
    (void)state;
    lcm_log_close(&r.log);
    return unlink(r.path);
}

static size_t read_file(void)
{
    FILE *f = fopen(r.path, "rb");
    assert_non_null(f);
    const size_t n = fread(r.file, 1, sizeof r.file, f);
    fclose(f);
    return n;
}

static void an_event_has_the_bytes_of_the_format(void **state)
{
    static const uint8_t want[] = {0xED, 0xA1, 0xDA, 0x01, 0, 0, 0, 0, 0,   0,   0,    0, /* sync word, number */
                                   0,    5,    0xAF, 0x31, 7, 0, 0, 0,                    /* time */
                                   0,    0,    0,    2,    0, 0, 0, 3, 'a', 'b', 0xFF, 0, 1};
    (void)state;
    lcm_log_put(&r.log, "ab", "\xFF\0\1", 3, INT64_C(0x0005AF3107000000));
    lcm_log_put(&r.log, "c", "", 0, -1);
    assert_int_equal(lcm_log_flush(&r.log), 0);
    assert_int_equal(read_file(), sizeof want + LCM_LOG_HEADER + 1);
    assert_memory_equal(r.file, want, sizeof want);
    assert_int_equal(r.file[sizeof want + 11], 1); /* the second's number */
    assert_int_equal(r.log.stored, 2);
}

/* A file that may not grow: as a full disk, at any byte. */
static void a_log_that_is_cut_off_ends_with_a_whole_event(void **state)
{
    enum { EVENT = LCM_LOG_HEADER + 4 + 100, LIMIT = 70000, WHOLE = LIMIT / EVENT };
    static const uint8_t data[100];
    struct rlimit before, limit;
    (void)state;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    limit = (struct rlimit){.rlim_cur = LIMIT, .rlim_max = before.rlim_max};
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
    for (unsigned i = 0; i < 2000; i++) lcm_log_put(&r.log, "chan", data, sizeof data, i);
    const int err = lcm_log_flush(&r.log);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_int_equal(err, -EFBIG);
    assert_int_equal(r.log.stored, WHOLE);
    assert_int_equal(read_file(), WHOLE * EVENT);
}

static void a_second_writer_is_refused(void **state)
{
    static struct lcm_log second;
    long owner = 0;
    (void)state;
    assert_int_equal(lcm_log_open(&second, r.path, &owner), -EBUSY);
    assert_int_equal(owner, getpid());
}

static void a_log_that_was_removed_is_found_out(void **state)
{
    (void)state;
    lcm_log_put(&r.log, "a", "", 0, 0);
    lcm_log_look(&r.log);
    assert_int_equal(r.log.error, 0);
    assert_int_equal(unlink(r.path), 0);
    lcm_log_look(&r.log);
    assert_int_equal(r.log.error, ESTALE);
    assert_int_equal(r.log.stored, 0);
    fclose(fopen(r.path, "w")); /* for forget() */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(urls_are_read_as_lcm_has_them),
        cmocka_unit_test(other_urls_are_rejected_in_words),
        cmocka_unit_test_setup_teardown(an_event_has_the_bytes_of_the_format, fresh, forget),
        cmocka_unit_test_setup_teardown(a_log_that_is_cut_off_ends_with_a_whole_event, fresh, forget),
        cmocka_unit_test_setup_teardown(a_second_writer_is_refused, fresh, forget),
        cmocka_unit_test_setup_teardown(a_log_that_was_removed_is_found_out, fresh, forget),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

#include "rig.h"

#include "base/rng.h"
#include "link/lines.h"

#include <string.h>

#define CAP 8 /* lines of up to 7 bytes */

struct splitter {
    struct lines l;
    char buf[CAP];
    char said[256]; /* lines as "line|", overlong ones as "!|" */
};

static void start(struct splitter *s, char end)
{
    memset(s, 0, sizeof *s);
    lines_init(&s->l, s->buf, sizeof s->buf, end);
}

static void feed(struct splitter *s, const char *in, size_t n)
{
    while (n) {
        size_t used;
        const enum lines_result r = lines_feed(&s->l, in, n, &used);
        assert_true(used > 0 && used <= n);
        if (r == LINES_LINE) strncat(s->said, s->l.buf, s->l.len);
        if (r == LINES_OVERLONG) strcat(s->said, "!");
        if (r != LINES_MORE) strcat(s->said, "|");
        in += used;
        n -= used;
    }
}

static const struct {
    const char *in, *said;
    unsigned overlong;
} rows[] = {
    {"abc\rdef\r", "abc|def|", 0},
    {"\r\r", "||", 0},
    {"abc", "", 0},                             /* no terminator, no line */
    {"1234567\r", "1234567|", 0},               /* as long as fits */
    {"12345678\r", "!|", 1},                    /* one too many */
    {"12345678901234567890\rok\r", "!|ok|", 1}, /* skipped to the next terminator, not cut into lines */
    {"12345678\r12345678\rx\r", "!|!|x|", 2},
};

static void lines_come_whole_and_overlong_ones_are_skipped(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct splitter s;
        start(&s, '\r');
        feed(&s, rows[i].in, strlen(rows[i].in));
        assert_string_equal(s.said, rows[i].said);
        assert_int_equal(s.l.overlong, rows[i].overlong);
    }
}

static void how_the_bytes_are_cut_does_not_matter(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        for (size_t piece = 1; piece < 10; piece++) {
            struct splitter s;
            start(&s, '\r');
            const size_t n = strlen(rows[i].in);
            for (size_t at = 0; at < n; at += piece) feed(&s, rows[i].in + at, n - at < piece ? n - at : piece);
            assert_string_equal(s.said, rows[i].said);
        }
    }
}

static void a_truncated_line_is_not_completed_by_an_older_one(void **state)
{
    (void)state;
    struct splitter s;
    start(&s, '\r');
    feed(&s, "abcdef\rxy\r", 10);
    assert_string_equal(s.said, "abcdef|xy|");
    assert_string_equal(s.buf, "xy"); /* NUL follows the line: nothing of the older one is in reach */
}

static void a_peer_that_left_leaves_nothing(void **state)
{
    (void)state;
    struct splitter s;
    start(&s, '>');
    feed(&s, "< sen", 5);
    lines_reset(&s.l);
    feed(&s, "< x >", 5);
    assert_string_equal(s.said, "< x |");
    start(&s, '>');
    feed(&s, "0123456789", 10); /* the skipping is forgotten, too */
    lines_reset(&s.l);
    feed(&s, "ab>", 3);
    assert_string_equal(s.said, "ab|");
}

static void bytes_with_nul_and_high_bit_are_counted_by_length(void **state)
{
    (void)state;
    struct splitter s;
    start(&s, '\r');
    size_t used;
    assert_int_equal(lines_feed(&s.l, "a\0\xff\r", 4, &used), LINES_LINE);
    assert_int_equal(s.l.len, 3);
    assert_memory_equal(s.buf, "a\0\xff", 4);
}

static void random_bytes_give_the_same_lines_in_one_piece_and_in_pieces(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(1), 0, "lines");
    for (int run = 0; run < 2000; run++) {
        char in[64];
        const size_t n = rng_u64(&r) % sizeof in;
        for (size_t i = 0; i < n; i++) in[i] = "ab\r"[rng_u64(&r) % 3];
        struct splitter whole, cut;
        start(&whole, '\r');
        start(&cut, '\r');
        feed(&whole, in, n);
        for (size_t at = 0; at < n;) {
            const size_t piece = 1 + rng_u64(&r) % (n - at);
            feed(&cut, in + at, piece);
            at += piece;
        }
        assert_string_equal(whole.said, cut.said);
        assert_int_equal(whole.l.overlong, cut.l.overlong);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_come_whole_and_overlong_ones_are_skipped),
        cmocka_unit_test(how_the_bytes_are_cut_does_not_matter),
        cmocka_unit_test(a_truncated_line_is_not_completed_by_an_older_one),
        cmocka_unit_test(a_peer_that_left_leaves_nothing),
        cmocka_unit_test(bytes_with_nul_and_high_bit_are_counted_by_length),
        cmocka_unit_test(random_bytes_give_the_same_lines_in_one_piece_and_in_pieces),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

#include "can_rig.h"

#include "base/rng.h"
#include "link/can/socketcand.h"

#include <string.h>

static const struct {
    const char *msg; /* without the closing '>' */
    enum socketcand_err err;
    enum socketcand_verb verb;
    struct can_msg m;
} rows[] = {
    {"< open can0 ", SOCKETCAND_OK, SOCKETCAND_OPEN, {0}},
    {"\n< open can0", SOCKETCAND_OK, SOCKETCAND_OPEN, {0}}, /* typed into a terminal */
    {"<rawmode", SOCKETCAND_OK, SOCKETCAND_RAWMODE, {0}},
    {"< rawmode ", SOCKETCAND_OK, SOCKETCAND_RAWMODE, {0}},
    {"< echo ", SOCKETCAND_OK, SOCKETCAND_ECHO, {0}},
    /* python-can writes bytes without a leading zero */
    {"< send 605 8 40 8 10 0 0 0 0 0 ",
     SOCKETCAND_OK,
     SOCKETCAND_SEND,
     {.id = 0x605, .len = 8, .data = {0x40, 8, 0x10}}},
    {"< send 000 2 01 05 ", SOCKETCAND_OK, SOCKETCAND_SEND, {.id = 0, .len = 2, .data = {1, 5}}},
    {"< send 080 0  ", SOCKETCAND_OK, SOCKETCAND_SEND, {.id = 0x80, .len = 0}},
    {"< send 1FFFFFFF 1 ff ",
     SOCKETCAND_OK,
     SOCKETCAND_SEND,
     {.id = 0x1FFFFFFF, .flags = CAN_EXT, .len = 1, .data = {0xFF}}},
    {"< send 00000005 1 ff ", SOCKETCAND_OK, SOCKETCAND_SEND, {.id = 5, .flags = CAN_EXT, .len = 1, .data = {0xFF}}},
    /* refusals */
    {"", SOCKETCAND_SYNTAX, 0, {0}},
    {"< ", SOCKETCAND_SYNTAX, 0, {0}},
    {"open can0 ", SOCKETCAND_SYNTAX, 0, {0}},
    {"GET / HTTP/1.1\r\n", SOCKETCAND_SYNTAX, 0, {0}},
    {"< fly ", SOCKETCAND_UNKNOWN, 0, {0}},
    {"< sendx 123 0 ", SOCKETCAND_UNKNOWN, 0, {0}},
    {"< bcmmode ", SOCKETCAND_MODE, 0, {0}},
    {"< add 0 10000 123 1 11 ", SOCKETCAND_MODE, 0, {0}},
    {"< open ", SOCKETCAND_ARGS, 0, {0}},
    {"< open can0 now ", SOCKETCAND_ARGS, 0, {0}},
    {"< open \177can0 ", SOCKETCAND_ARGS, 0, {0}},
    {"< open can\177 ", SOCKETCAND_ARGS, 0, {0}},
    {"< open a_name_of_thirty_two_characters__ ", SOCKETCAND_ARGS, 0, {0}},
    {"< rawmode please ", SOCKETCAND_ARGS, 0, {0}},
    {"< send ", SOCKETCAND_ARGS, 0, {0}},
    {"< send 123 ", SOCKETCAND_ARGS, 0, {0}},
    {"< send 123 x 11 ", SOCKETCAND_ARGS, 0, {0}},
    {"< send 800 1 11 ", SOCKETCAND_ID, 0, {0}},
    {"< send 1234 1 11 ", SOCKETCAND_ID, 0, {0}},
    {"< send 20000000 1 11 ", SOCKETCAND_ID, 0, {0}},
    {"< send 12 1 11 ", SOCKETCAND_ID, 0, {0}},
    {"< send 12G 1 11 ", SOCKETCAND_ID, 0, {0}},
    {"< send CCCCCCCCCCCCCCCCCCCCCCCCCCCCCCCCCCCC 1 11 ", SOCKETCAND_ID, 0, {0}}, /* found by fuzzing: overflow */
    {"< send 124 C 0 1 2 3 4 5 6 7 8 9 a b ", SOCKETCAND_FD, 0, {0}}, /* what python-can makes of an FD frame */
    {"< send 124 9 0 1 2 3 4 5 6 7 8 ", SOCKETCAND_FD, 0, {0}},
    {"< send 124 4  ", SOCKETCAND_LENGTH, 0, {0}}, /* what python-can makes of a remote frame */
    {"< send 124 2 11 ", SOCKETCAND_LENGTH, 0, {0}},
    {"< send 124 2 11 22 33 ", SOCKETCAND_LENGTH, 0, {0}},
    {"< send 124 2 11 222 ", SOCKETCAND_DATA, 0, {0}},
    {"< send 124 2 11 zz ", SOCKETCAND_DATA, 0, {0}},
};

static void messages_are_read_or_refused_in_words(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct socketcand_msg m = {.verb = SOCKETCAND_ECHO, .frame = {.id = 99}};
        const enum socketcand_err err = socketcand_decode(rows[i].msg, strlen(rows[i].msg), &m);
        assert_int_equal(err, rows[i].err);
        assert_int_equal(m.verb, err ? SOCKETCAND_ECHO : rows[i].verb);
        if (!err && m.verb == SOCKETCAND_SEND) assert_same_frame(&m.frame, &rows[i].m);
        if (!err && m.verb == SOCKETCAND_OPEN) assert_string_equal(m.channel, "can0");
        if (err) assert_int_equal(m.frame.id, 99);
        assert_true(strlen(socketcand_strerror(err)) > 0);
    }
}

static void a_message_is_not_read_beyond_its_length(void **state)
{
    (void)state;
    struct socketcand_msg m;
    assert_int_equal(socketcand_decode("< send 124 2 11 22", 16, &m), SOCKETCAND_LENGTH); /* "< send 124 2 11 " */
}

static void frames_are_written_as_socketcand_does(void **state)
{
    (void)state;
    static const struct {
        struct can_msg m;
        int64_t t_ns;
        size_t pad;
        const char *text;
    } frames[] = {
        {{.id = 0x185, .len = 8, .data = {1, 2, 3, 4, 5, 6, 7, 0xFF}},
         1250000999,
         0,
         "< frame 185 1.250000 01020304050607FF >"},
        {{.id = 5, .len = 1, .data = {0xA}}, 0, 0, "< frame 005 0.000000 0A >"},
        {{.id = 5, .flags = CAN_EXT, .len = 1, .data = {0xA}},
         123456789012345678,
         0,
         "< frame 00000005 123456789.012345 0A >"},
        /* No data: two blanks, as the original, or python-can finds no third word. */
        {{.id = 0x80}, 1000, 0, "< frame 080 0.000001  >"},
        {{.id = 0x705, .len = 1, .data = {5}}, 2000000000, 32, "< frame 705 2.000000 05        >"},
        {{.id = 0x80}, 1000, 23, "< frame 080 0.000001  >"}, /* fits as it is: no blank more */
        {{.id = 0x7, .len = 0}, 2000000000, 24, "< frame 007 2.000000   >"},
    };
    for (size_t i = 0; i < COUNT(frames); i++) {
        char text[128] = {0};
        const size_t n = socketcand_frame(&frames[i].m, frames[i].t_ns, frames[i].pad, text, sizeof text);
        assert_string_equal(text, frames[i].text);
        assert_int_equal(n, strlen(frames[i].text));
        char guarded[128];
        memset(guarded, '?', sizeof guarded);
        assert_int_equal(socketcand_frame(&frames[i].m, frames[i].t_ns, frames[i].pad, guarded, n - 1), 0);
        assert_int_equal(guarded[n - 1], '?');
        assert_int_equal(socketcand_frame(&frames[i].m, frames[i].t_ns, frames[i].pad, guarded, n), n);
    }
}

static void what_the_protocol_cannot_carry_has_no_text(void **state)
{
    (void)state;
    static const uint8_t flags[] = {CAN_FD, CAN_FD | CAN_BRS, CAN_RTR, CAN_ERROR};
    char text[256];
    for (size_t i = 0; i < COUNT(flags); i++) {
        const struct can_msg m = {.id = 1, .flags = flags[i], .len = 8};
        assert_int_equal(socketcand_frame(&m, 0, 0, text, sizeof text), 0);
    }
}

static void every_padded_message_has_a_multiple_of_the_block(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(1), 0, "socketcand");
    for (int i = 0; i < 5000; i++) {
        char text[256];
        const struct can_msg m = random_frame(&r, rng_u64(&r) & 1 ? CAN_EXT : 0);
        const size_t n = socketcand_frame(&m, (int64_t)(rng_u64(&r) >> 10), 64, text, sizeof text);
        assert_true(n > 0 && n % 64 == 0 && n <= SOCKETCAND_MSG_MAX);
        assert_memory_equal(text + n - 2, " >", 2);
    }
}

static void an_error_is_a_frame_to_programs_and_words_to_people(void **state)
{
    (void)state;
    char text[SOCKETCAND_MSG_MAX];
    const size_t n = socketcand_error(SOCKETCAND_LOST, 1500000000, "12 frames lost", 0, text, sizeof text);
    assert_int_equal(n, strlen("< error 20000004 1.500000 12 frames lost >"));
    assert_memory_equal(text, "< error 20000004 1.500000 12 frames lost >", n);
    for (int e = SOCKETCAND_SYNTAX; e <= SOCKETCAND_LENGTH; e++) {
        const char *words = socketcand_strerror((enum socketcand_err)e);
        assert_null(strpbrk(words, "<>")); /* would end the message early */
        assert_true(socketcand_error(SOCKETCAND_REFUSED, INT64_MAX, words, 64, text, sizeof text) > 0);
    }
}

static void random_bytes_are_refused_or_are_valid_frames(void **state)
{
    (void)state;
    static const char alphabet[] = "< > send 0 1 2 8 9 a F 123 12345678 open rawmode\t\n";
    struct rng r = rng_stream(rig_seed(2), 0, "socketcand");
    for (int i = 0; i < 200000; i++) {
        char msg[48] = "< send ";
        const size_t head = rng_u64(&r) & 1 ? 7 : 0;
        const size_t n = head + rng_u64(&r) % (sizeof msg - head);
        for (size_t k = head; k < n; k++) msg[k] = alphabet[rng_u64(&r) % (sizeof alphabet - 1)];
        struct socketcand_msg m;
        if (socketcand_decode(msg, n, &m) == SOCKETCAND_OK && m.verb == SOCKETCAND_SEND)
            assert_true(can_valid(&m.frame));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(messages_are_read_or_refused_in_words),
        cmocka_unit_test(a_message_is_not_read_beyond_its_length),
        cmocka_unit_test(frames_are_written_as_socketcand_does),
        cmocka_unit_test(what_the_protocol_cannot_carry_has_no_text),
        cmocka_unit_test(every_padded_message_has_a_multiple_of_the_block),
        cmocka_unit_test(an_error_is_a_frame_to_programs_and_words_to_people),
        cmocka_unit_test(random_bytes_are_refused_or_are_valid_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

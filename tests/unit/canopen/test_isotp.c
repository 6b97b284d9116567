/* The transport alone: frames go to a list, and the test says when one has been on the bus. */
#include "rig.h"

#include "canopen/isotp.h"

#include <string.h>

enum { MS = 1000000, SENT_MAX = 700, BUFFER = 32 };

struct rig {
    struct sched s;
    struct isotp p;
    uint8_t buffer[BUFFER];
    uint8_t sent[SENT_MAX][8];
    int64_t sent_ns[SENT_MAX];
    unsigned count;
    unsigned begun, messages, failures, done;
    enum isotp_result failure, result;
    uint8_t message[BUFFER];
    size_t len;
};
static struct rig rig;

static void on_send(void *ctx, const uint8_t frame[8], int64_t t_ns)
{
    struct rig *r = ctx;
    assert_true(r->count < SENT_MAX);
    memcpy(r->sent[r->count], frame, 8);
    r->sent_ns[r->count++] = t_ns;
}

static void on_begun(void *ctx, int64_t t_ns)
{
    (void)t_ns;
    ((struct rig *)ctx)->begun++;
}

static void on_received(void *ctx, enum isotp_result result, const uint8_t *data, size_t len, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    if (result != ISOTP_OK) {
        assert_null(data);
        r->failures++;
        r->failure = result;
        return;
    }
    assert_true(len >= 1 && len <= BUFFER);
    r->messages++;
    memcpy(r->message, data, len);
    r->len = len;
}

static void on_done(void *ctx, enum isotp_result result, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    r->done++;
    r->result = result;
}

static struct rig *rig_up(uint8_t block_size)
{
    struct rig *r = &rig;
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    const struct isotp_cfg cfg = {r->buffer, sizeof r->buffer, block_size, 0};
    const struct isotp_io io = {r, on_send, on_begun, on_received, on_done};
    isotp_init(&r->p, &cfg, &io, &r->s);
    return r;
}

static size_t bytes_of(const char *hex, uint8_t *out)
{
    size_t n = 0;
    for (; *hex; hex += hex[2] ? 3 : 2) out[n++] = (uint8_t)strtoul((const char[3]){hex[0], hex[1], '\0'}, NULL, 16);
    return n;
}

static void peer(struct rig *r, const char *hex)
{
    uint8_t data[8];
    const size_t n = bytes_of(hex, data);
    isotp_frame(&r->p, data, n, r->s.now_ns);
}

static void confirm(struct rig *r)
{
    isotp_sent(&r->p, r->sent[r->count - 1], 8, r->s.now_ns);
}

static void expect_frame(const struct rig *r, unsigned i, const char *hex)
{
    uint8_t want[8];
    assert_int_equal(bytes_of(hex, want), 8);
    assert_true(i < r->count);
    assert_memory_equal(r->sent[i], want, 8);
}

static void wait_ms(struct rig *r, int64_t ms)
{
    sched_run_until(&r->s, r->s.now_ns + ms * MS);
}

/* A message of 20 bytes 0, 1, 2 ... up to its first flow control. */
static const uint8_t twenty[20] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19};

static struct rig *first_frame_out(void)
{
    struct rig *r = rig_up(0);
    assert_true(isotp_send(&r->p, twenty, sizeof twenty, 0));
    expect_frame(r, 0, "10 14 00 01 02 03 04 05");
    confirm(r);
    return r;
}

static void a_single_frame_goes_both_ways(void **state)
{
    (void)state;
    struct rig *r = rig_up(0);
    peer(r, "03 22 F1 8C");
    assert_int_equal(r->messages, 1);
    assert_int_equal(r->len, 3);
    assert_memory_equal(r->message, "\x22\xF1\x8C", 3);
    assert_true(isotp_send(&r->p, twenty, 7, 0));
    assert_false(isotp_send(&r->p, twenty, 7, 0)); /* one at a time */
    expect_frame(r, 0, "07 00 01 02 03 04 05 06");
    assert_int_equal(r->done, 0);
    confirm(r);
    assert_int_equal(r->done, 1);
    assert_int_equal(r->result, ISOTP_OK);
    assert_true(isotp_send(&r->p, twenty, 1, 0));
    expect_frame(r, 1, "01 00 CC CC CC CC CC CC"); /* 10.4.2 */
}

static void a_length_of_none_or_too_many_is_not_sent(void **state)
{
    (void)state;
    static uint8_t longest[ISOTP_MAX + 1];
    struct rig *r = rig_up(0);
    assert_false(isotp_send(&r->p, longest, 0, 0));
    assert_false(isotp_send(&r->p, longest, ISOTP_MAX + 1, 0));
    assert_true(isotp_send(&r->p, longest, ISOTP_MAX, 0));
    expect_frame(r, 0, "1F FF 00 00 00 00 00 00");
}

static void the_longest_message_goes_out_whole(void **state)
{
    (void)state;
    static uint8_t longest[ISOTP_MAX], got[ISOTP_MAX + 7];
    for (size_t i = 0; i < ISOTP_MAX; i++) longest[i] = (uint8_t)(i * 7 + i / 256);
    struct rig *r = rig_up(0);
    assert_true(isotp_send(&r->p, longest, ISOTP_MAX, 0));
    confirm(r);
    peer(r, "30 00 00");
    for (unsigned had = 0; had != r->count;) {
        had = r->count;
        confirm(r);
    }
    assert_int_equal(r->done, 1);
    assert_int_equal(r->count, 1 + (ISOTP_MAX - 6 + 6) / 7);
    memcpy(got, &r->sent[0][2], 6);
    for (unsigned i = 1; i < r->count; i++) {
        assert_int_equal(r->sent[i][0], 0x20 | (i & 15));
        memcpy(&got[6 + 7 * (i - 1)], &r->sent[i][1], 7);
    }
    assert_memory_equal(got, longest, ISOTP_MAX);
}

static void a_block_ends_and_waits_for_flow_control(void **state)
{
    (void)state;
    struct rig *r = first_frame_out();
    peer(r, "30 01 00");
    expect_frame(r, 1, "21 06 07 08 09 0A 0B 0C");
    confirm(r);
    wait_ms(r, 900);
    assert_int_equal(r->count, 2);
    peer(r, "30 00 00 CC CC");
    expect_frame(r, 2, "22 0D 0E 0F 10 11 12 13");
    assert_int_equal(r->done, 0);
    confirm(r);
    assert_int_equal(r->done, 1);
    assert_int_equal(r->result, ISOTP_OK);
}

static void separation_time_runs_from_the_end_of_a_frame(void **state)
{
    (void)state;
    static const struct {
        const char *flow;
        int64_t gap_ns;
    } row[] = {
        {"30 00 00", 0},        {"30 00 01", MS},          {"30 00 7F", 127 * MS},
        {"30 00 F1", MS / 10},  {"30 00 F9", 9 * MS / 10}, {"30 00 80", 127 * MS},
        {"30 00 F0", 127 * MS}, {"30 00 FA", 127 * MS}, /* reserved */
    };
    for (size_t i = 0; i < COUNT(row); i++) {
        struct rig *r = first_frame_out();
        peer(r, row[i].flow);
        sched_run_until(&r->s, 5 * MS); /* the bus is busy */
        confirm(r);
        sched_run_until(&r->s, 5 * MS + row[i].gap_ns - 1);
        if (row[i].gap_ns) assert_int_equal(r->count, 2);
        sched_run_until(&r->s, 5 * MS + row[i].gap_ns);
        assert_int_equal(r->count, 3);
        assert_int_equal(r->sent_ns[2], 5 * MS + row[i].gap_ns);
    }
}

static void flow_control_may_wait_overflow_or_be_invalid(void **state)
{
    (void)state;
    struct rig *r = first_frame_out();
    for (unsigned i = 0; i < 5; i++) {
        wait_ms(r, 900);
        peer(r, "31 00 00");
        assert_int_equal(r->done, 0);
    }
    peer(r, "32 00 00");
    assert_int_equal(r->result, ISOTP_BUFFER_OVFLW);
    r = first_frame_out();
    peer(r, "33 00 00");
    assert_int_equal(r->result, ISOTP_INVALID_FS);
    assert_int_equal(r->p.failed[ISOTP_INVALID_FS], 1);
    peer(r, "30 00 00"); /* nothing waits for it any more */
    assert_int_equal(r->count, 1);
    assert_int_equal(r->p.ignored, 1);
}

static void timeouts_end_a_message_that_goes_out(void **state)
{
    (void)state;
    struct rig *r = first_frame_out();
    peer(r, "30 00"); /* too short to be flow control */
    wait_ms(r, 999);
    assert_int_equal(r->done, 0);
    wait_ms(r, 1);
    assert_int_equal(r->result, ISOTP_TIMEOUT_BS);
    r = rig_up(0);
    assert_true(isotp_send(&r->p, twenty, 3, 0)); /* never on the bus */
    wait_ms(r, 999);
    assert_int_equal(r->done, 0);
    wait_ms(r, 1);
    assert_int_equal(r->result, ISOTP_TIMEOUT_A);
    assert_true(isotp_send(&r->p, twenty + 1, 3, r->s.now_ns));
    isotp_sent(&r->p, r->sent[0], 8, r->s.now_ns); /* the old one, at last */
    assert_int_equal(r->done, 1);
    confirm(r);
    assert_int_equal(r->done, 2);
    assert_int_equal(r->result, ISOTP_OK);
}

static void segments_come_in_blocks(void **state)
{
    (void)state;
    struct rig *r = rig_up(2);
    peer(r, "10 1B 00 01 02 03 04 05");
    assert_int_equal(r->begun, 1);
    expect_frame(r, 0, "30 02 00 CC CC CC CC CC");
    confirm(r);
    peer(r, "21 06 07 08 09 0A 0B 0C");
    peer(r, "22 0D 0E 0F 10 11 12 13");
    assert_int_equal(r->count, 2); /* the next block */
    confirm(r);
    peer(r, "23 14 15 16 17 18 19 1A");
    assert_int_equal(r->messages, 1);
    assert_int_equal(r->len, 27);
    for (unsigned i = 0; i < 27; i++) assert_int_equal(r->message[i], i);
    assert_int_equal(r->count, 2);
}

static struct rig *reception_begun(void)
{
    struct rig *r = rig_up(0);
    peer(r, "10 14 00 01 02 03 04 05");
    confirm(r);
    return r;
}

static void a_wrong_sequence_number_ends_the_message(void **state)
{
    (void)state;
    struct rig *r = reception_begun();
    peer(r, "22 06 07 08 09 0A 0B 0C");
    assert_int_equal(r->failures, 1);
    assert_int_equal(r->failure, ISOTP_WRONG_SN);
    peer(r, "21 06 07 08 09 0A 0B 0C"); /* belongs to nothing */
    assert_int_equal(r->p.ignored, 1);
    assert_int_equal(r->messages, 0);
}

static void timeouts_end_a_message_that_comes(void **state)
{
    (void)state;
    struct rig *r = reception_begun();
    wait_ms(r, 900);
    peer(r, "21 06 07 08 09 0A 0B 0C");
    peer(r, "22 0D 0E"); /* shorter than the rest: ignored */
    wait_ms(r, 999);
    assert_int_equal(r->failures, 0);
    wait_ms(r, 1);
    assert_int_equal(r->failure, ISOTP_TIMEOUT_CR);
    r = rig_up(0);
    peer(r, "10 14 00 01 02 03 04 05"); /* our flow control is never on the bus */
    peer(r, "21 06 07 08 09 0A 0B 0C"); /* so this is early */
    assert_int_equal(r->p.ignored, 1);
    wait_ms(r, 1000);
    assert_int_equal(r->failure, ISOTP_TIMEOUT_A);
}

static void a_message_that_does_not_fit_gets_overflow(void **state)
{
    (void)state;
    struct rig *r = rig_up(0);
    peer(r, "10 21 00 01 02 03 04 05"); /* 33 bytes */
    expect_frame(r, 0, "32 00 00 CC CC CC CC CC");
    peer(r, "10 00 00 00 10 00 00 01"); /* 4096 in 32 bits */
    expect_frame(r, 1, "32 00 00 CC CC CC CC CC");
    assert_int_equal(r->begun, 0);
    assert_int_equal(r->p.failed[ISOTP_BUFFER_OVFLW], 2);
    peer(r, "10 20 00 01 02 03 04 05"); /* 32 fit */
    assert_int_equal(r->begun, 1);
}

static void frames_of_no_form_are_counted(void **state)
{
    (void)state;
    static const char *const frames[] = {
        "",
        "00",
        "08 01 02 03 04 05 06 07",
        "04 01 02 03",             /* single: no length, too long, cut */
        "10 07 00 01 02 03 04 05", /* first: would fit a single frame */
        "10 14 00 01 02 03 04",    /* first: shorter than 8 */
        "10 00 00 00 0F FF 00 00", /* first: 4095 in 32 bits */
        "21 00",
        "30 00 00",
        "40 00",
        "F3", /* out of place; reserved */
    };
    struct rig *r = rig_up(0);
    for (size_t i = 0; i < COUNT(frames); i++) {
        peer(r, frames[i]);
        assert_int_equal(r->p.ignored, i + 1);
    }
    assert_int_equal(r->messages + r->begun + r->failures + r->count, 0);
}

/* ISO 15765-2:2016, 9.8.3. */
static void an_unexpected_frame_begins_anew_or_is_ignored(void **state)
{
    (void)state;
    struct rig *r = reception_begun();
    peer(r, "30 00 00"); /* flow control in a reception: ignored */
    peer(r, "02 3E 00");
    assert_int_equal(r->failure, ISOTP_UNEXP_PDU);
    assert_int_equal(r->messages, 1);
    r = reception_begun();
    peer(r, "10 0A 50 51 52 53 54 55");
    assert_int_equal(r->failure, ISOTP_UNEXP_PDU);
    confirm(r);
    peer(r, "21 56 57 58 59");
    assert_int_equal(r->messages, 1);
    assert_int_equal(r->message[0], 0x50);
    r = first_frame_out(); /* half duplex */
    peer(r, "02 3E 00");
    peer(r, "10 14 00 01 02 03 04 05");
    assert_int_equal(r->messages + r->begun, 0);
    assert_int_equal(r->p.ignored, 2);
    peer(r, "30 00 00");
    assert_int_equal(r->count, 2);
}

static void a_reset_drops_both_ways(void **state)
{
    (void)state;
    struct rig *r = first_frame_out();
    isotp_reset(&r->p);
    peer(r, "30 00 00");
    wait_ms(r, 2000);
    assert_int_equal(r->count, 1);
    assert_int_equal(r->done, 0);
    r = reception_begun();
    isotp_reset(&r->p);
    peer(r, "21 06 07 08 09 0A 0B 0C");
    wait_ms(r, 2000);
    assert_int_equal(r->failures + r->messages, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_single_frame_goes_both_ways),
        cmocka_unit_test(a_length_of_none_or_too_many_is_not_sent),
        cmocka_unit_test(the_longest_message_goes_out_whole),
        cmocka_unit_test(a_block_ends_and_waits_for_flow_control),
        cmocka_unit_test(separation_time_runs_from_the_end_of_a_frame),
        cmocka_unit_test(flow_control_may_wait_overflow_or_be_invalid),
        cmocka_unit_test(timeouts_end_a_message_that_goes_out),
        cmocka_unit_test(segments_come_in_blocks),
        cmocka_unit_test(a_wrong_sequence_number_ends_the_message),
        cmocka_unit_test(timeouts_end_a_message_that_comes),
        cmocka_unit_test(a_message_that_does_not_fit_gets_overflow),
        cmocka_unit_test(frames_of_no_form_are_counted),
        cmocka_unit_test(an_unexpected_frame_begins_anew_or_is_ignored),
        cmocka_unit_test(a_reset_drops_both_ways),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

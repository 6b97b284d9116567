#include "base/bits.h"
#include "base/rng.h"
#include "canopen/co_sdo.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

/* A small dictionary: one of each kind. */
static const struct co_entry entry[] = {
    {0x1000, 0, CO_UNSIGNED32, CO_CONST, 0, 0x194, 0, 4294967295.0, NULL},
    {0x1008, 0, CO_VISIBLE_STRING, CO_CONST, 0, 0, 0, 64, "PSA-2 on a bench, 29 letters."},
    {0x2000, 0, CO_UNSIGNED8, CO_RO, 0, 2, 0, 255, NULL},
    {0x2000, 1, CO_UNSIGNED8, CO_RW, 0, 7, 0, 0x7F, NULL},
    {0x2000, 2, CO_UNSIGNED8, CO_WO, 0, 0, 0, 255, NULL},
    {0x2001, 0, CO_INTEGER24, CO_RW, 0, -1, -8388608, 8388607, NULL},
    {0x2002, 0, CO_VISIBLE_STRING, CO_RW, 0, 0, 0, 20, ""},
    {0x2003, 0, CO_REAL32, CO_RW, 0, 0, -10, 10, NULL},
    {0x2004, 0, CO_UNSIGNED32, CO_RW, 0, 0, 0, 4294967295.0, NULL}, /* slow: answers later */
    {0x2005, 0, CO_VISIBLE_STRING, CO_RO, 0, 0, 0, 64, ""},
};
static const struct co_od od = {entry, sizeof entry / sizeof entry[0]};
enum { ENTRIES = sizeof entry / sizeof entry[0] };

struct rig {
    struct sched s;
    struct co_sdo sdo;
    struct co_value value[ENTRIES];
    uint8_t answer[8];
    unsigned answers;
    uint32_t refuse; /* what the owner answers, if not CO_OK */
    uint32_t ticket; /* of the pending access */
    unsigned writes;
};
static struct rig rig;

static uint32_t rig_read(void *ctx, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    if (r->refuse) return r->refuse;
    if (e->index == 0x2004) {
        r->ticket = r->sdo.ticket;
        return CO_PENDING;
    }
    *v = r->value[e - entry];
    return CO_OK;
}

static uint32_t rig_write(void *ctx, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    if (r->refuse) return r->refuse;
    r->writes++;
    r->value[e - entry] = *v;
    if (e->index != 0x2004) return CO_OK;
    r->ticket = r->sdo.ticket;
    return CO_PENDING;
}

static void rig_send(void *ctx, const uint8_t frame[8], int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    memcpy(r->answer, frame, 8);
    r->answers++;
}

static struct rig *rig_up(void)
{
    struct rig *r = &rig;
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    const struct co_sdo_io io = {r, rig_read, rig_write, rig_send};
    co_sdo_init(&r->sdo, &od, &io, &r->s);
    for (unsigned i = 0; i < ENTRIES; i++) co_default(&entry[i], 5, &r->value[i]);
    return r;
}

static void ask(struct rig *r, const char *hex)
{
    uint8_t data[8];
    for (unsigned i = 0; i < 8; i++) {
        const char byte[3] = {hex[3 * i], hex[3 * i + 1], '\0'};
        data[i] = (uint8_t)strtoul(byte, NULL, 16);
    }
    co_sdo_request(&r->sdo, data, sizeof data, r->s.now_ns);
}

static void expect(struct rig *r, const char *hex)
{
    char got[25];
    for (unsigned i = 0; i < 8; i++) {
        static const char digit[] = "0123456789ABCDEF";
        got[3 * i] = digit[r->answer[i] >> 4];
        got[3 * i + 1] = digit[r->answer[i] & 15];
        got[3 * i + 2] = ' ';
    }
    got[23] = '\0';
    assert_string_equal(got, hex);
}

static void one_request_one_answer(void **state)
{
    (void)state;
    static const struct {
        const char *ask, *answer;
    } row[] = {
        /* uploads, expedited: CiA 301 7.2.4.3.5; n in bits 3..2 */
        {"40 00 10 00 00 00 00 00", "43 00 10 00 94 01 00 00"},
        {"40 00 20 01 00 00 00 00", "4F 00 20 01 07 00 00 00"},
        {"40 01 20 00 00 00 00 00", "47 01 20 00 FF FF FF 00"}, /* INTEGER24 -1 */
        /* downloads, expedited, with and without a length */
        {"2F 00 20 01 55 00 00 00", "60 00 20 01 00 00 00 00"},
        {"22 00 20 01 55 00 00 00", "60 00 20 01 00 00 00 00"},
        {"27 01 20 00 00 00 80 00", "60 01 20 00 00 00 00 00"},
        {"23 03 20 00 00 00 20 41", "60 03 20 00 00 00 00 00"}, /* 10.0 */
        {"23 02 20 00 61 62 63 64", "60 02 20 00 00 00 00 00"}, /* a string of four */
        /* refusals: abort codes of CiA 301 table 22 */
        {"40 34 12 00 00 00 00 00", "80 34 12 00 00 00 02 06"}, /* no object */
        {"40 00 20 09 00 00 00 00", "80 00 20 09 11 00 09 06"}, /* no sub-index */
        {"40 00 20 02 00 00 00 00", "80 00 20 02 01 00 01 06"}, /* write-only */
        {"2F 00 20 00 01 00 00 00", "80 00 20 00 02 00 01 06"}, /* read-only */
        {"23 00 10 00 01 00 00 00", "80 00 10 00 02 00 01 06"}, /* const */
        {"2B 00 20 01 01 00 00 00", "80 00 20 01 12 00 07 06"}, /* two bytes for one */
        {"2F 01 20 00 01 00 00 00", "80 01 20 00 13 00 07 06"}, /* one byte for three */
        {"2F 00 20 01 80 00 00 00", "80 00 20 01 30 00 09 06"}, /* above the limit */
        {"23 03 20 00 00 00 30 41", "80 03 20 00 30 00 09 06"}, /* 11.0 */
        {"23 03 20 00 00 00 C0 7F", "80 03 20 00 30 00 09 06"}, /* not a number */
        {"A0 00 10 00 00 00 00 00", "80 00 10 00 01 00 04 05"}, /* block upload */
        {"C2 00 10 00 00 00 00 00", "80 00 10 00 01 00 04 05"}, /* block download */
        {"60 00 00 00 00 00 00 00", "80 00 00 00 01 00 04 05"}, /* segment without a transfer */
        {"00 00 00 00 00 00 00 00", "80 00 00 00 01 00 04 05"},
        {"21 02 20 00 00 10 00 00", "80 02 20 00 12 00 07 06"}, /* announces 4096 bytes */
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct rig *r = rig_up();
        ask(r, row[i].ask);
        expect(r, row[i].answer);
        assert_int_equal(r->answers, 1);
        assert_int_equal(r->sdo.state, CO_SDO_IDLE);
    }
}

/* A conversation: requests and answers in turn. */
static void talk(struct rig *r, const char *const line[][2], size_t n)
{
    for (size_t i = 0; i < n; i++) {
        ask(r, line[i][0]);
        expect(r, line[i][1]);
    }
}
#define TALK(r, line) talk(r, line, sizeof(line) / sizeof(line)[0])

static void a_long_string_goes_up_in_segments(void **state)
{
    (void)state;
    static const char *const line[][2] = {
        {"40 08 10 00 00 00 00 00", "41 08 10 00 1D 00 00 00"}, /* 29 bytes */
        {"60 00 00 00 00 00 00 00", "00 50 53 41 2D 32 20 6F"}, {"70 00 00 00 00 00 00 00", "10 6E 20 61 20 62 65 6E"},
        {"60 00 00 00 00 00 00 00", "00 63 68 2C 20 32 39 20"}, {"70 00 00 00 00 00 00 00", "10 6C 65 74 74 65 72 73"},
        {"60 00 00 00 00 00 00 00", "0D 2E 00 00 00 00 00 00"}, /* 6 bytes unused, last */
    };
    struct rig *r = rig_up();
    TALK(r, line);
    assert_int_equal(r->sdo.state, CO_SDO_IDLE);
}

static void an_empty_string_is_a_last_segment_without_bytes(void **state)
{
    (void)state;
    static const char *const line[][2] = {
        {"40 05 20 00 00 00 00 00", "41 05 20 00 00 00 00 00"},
        {"60 00 00 00 00 00 00 00", "0F 00 00 00 00 00 00 00"},
    };
    struct rig *r = rig_up();
    TALK(r, line);
}

static void a_string_comes_down_in_segments(void **state)
{
    (void)state;
    static const char *const line[][2] = {
        {"21 02 20 00 0A 00 00 00", "60 02 20 00 00 00 00 00"},
        {"00 61 62 63 64 65 66 67", "20 00 00 00 00 00 00 00"},
        {"19 68 69 6A 00 00 00 00", "30 00 00 00 00 00 00 00"}, /* 4 unused, toggle, last */
    };
    struct rig *r = rig_up();
    TALK(r, line);
    assert_string_equal(r->value[6].text, "abcdefghij");
    assert_int_equal(r->writes, 1);
}

static void a_number_may_come_down_in_segments_too(void **state)
{
    (void)state;
    static const char *const line[][2] = {
        {"20 01 20 00 00 00 00 00", "60 01 20 00 00 00 00 00"}, /* no length named */
        {"09 FE FF FF 00 00 00 00", "20 00 00 00 00 00 00 00"},
    };
    struct rig *r = rig_up();
    TALK(r, line);
    assert_true(r->value[5].number == -2.0);
}

static void faults_of_a_segmented_transfer_abort_it(void **state)
{
    (void)state;
    static const struct {
        const char *begin, *segment, *answer;
    } row[] = {
        {"21 02 20 00 0A 00 00 00", "10 61 62 63 64 65 66 67", "80 02 20 00 00 00 03 05"}, /* toggle */
        {"21 02 20 00 0A 00 00 00", "01 61 62 63 64 65 66 67", "80 02 20 00 10 00 07 06"}, /* 7 of 10, last */
        {"21 02 20 00 0A 00 00 00", "60 00 00 00 00 00 00 00", "80 02 20 00 01 00 04 05"}, /* upload segment */
        {"40 08 10 00 00 00 00 00", "70 00 00 00 00 00 00 00", "80 08 10 00 00 00 03 05"}, /* toggle */
        {"40 08 10 00 00 00 00 00", "00 00 00 00 00 00 00 00", "80 08 10 00 01 00 04 05"}, /* download segment */
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct rig *r = rig_up();
        ask(r, row[i].begin);
        ask(r, row[i].segment);
        expect(r, row[i].answer);
        assert_int_equal(r->sdo.state, CO_SDO_IDLE);
        assert_int_equal(r->writes, 0);
    }
}

static void a_string_longer_than_the_object_is_refused(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, "20 02 20 00 00 00 00 00");
    static const char *const segment[] = {"00 61 62 63 64 65 66 67", "10 61 62 63 64 65 66 67"};
    for (unsigned i = 0; i < 2; i++) ask(r, segment[i]);
    ask(r, "01 61 62 63 64 65 66 67"); /* 21 characters of 20 */
    expect(r, "80 02 20 00 12 00 07 06");
}

static void segments_without_end_do_not_overrun_the_buffer(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, "20 02 20 00 00 00 00 00");
    for (unsigned i = 0; i < 36; i++) ask(r, i % 2 ? "10 61 62 63 64 65 66 67" : "00 61 62 63 64 65 66 67");
    expect(r, "30 00 00 00 00 00 00 00");
    ask(r, "00 61 62 63 64 65 66 67"); /* byte 253 .. 259 of 256 */
    expect(r, "80 02 20 00 12 00 07 06");
}

static void a_silent_client_is_given_up_after_a_second(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, "21 02 20 00 0A 00 00 00");
    sched_run_until(&r->s, NS_PER_S / 2);
    ask(r, "00 61 62 63 64 65 66 67");
    sched_run_until(&r->s, NS_PER_S + NS_PER_S / 2 - 1);
    assert_int_equal(r->answers, 2);
    sched_run_until(&r->s, NS_PER_S + NS_PER_S / 2);
    assert_int_equal(r->answers, 3);
    expect(r, "80 02 20 00 00 00 04 05");
    assert_int_equal(r->sdo.timeouts, 1);
}

static void a_pending_access_is_answered_when_it_is_done(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, "40 04 20 00 00 00 00 00");
    assert_int_equal(r->answers, 0);
    const struct co_value v = {.number = 0x11223344};
    co_sdo_answer(&r->sdo, r->ticket, CO_OK, &v, 1000);
    expect(r, "43 04 20 00 44 33 22 11");
    ask(r, "23 04 20 00 01 00 00 00");
    assert_int_equal(r->answers, 1);
    co_sdo_answer(&r->sdo, r->ticket, CO_OK, NULL, 2000);
    expect(r, "60 04 20 00 00 00 00 00");
    co_sdo_answer(&r->sdo, r->ticket, CO_OK, NULL, 3000); /* twice: no client waits any more */
    assert_int_equal(r->answers, 2);
}

static void a_pending_access_may_fail(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, "23 04 20 00 01 00 00 00");
    co_sdo_answer(&r->sdo, r->ticket, CO_AB_TRANSFER, NULL, 1000);
    expect(r, "80 04 20 00 20 00 00 08");
}

static void an_answer_to_an_abandoned_request_is_dropped(void **state)
{
    (void)state;
    static const char *const again[] = {"40 00 10 00 00 00 00 00",
                                        "80 04 20 00 00 00 04 05"}; /* new, or client abort */
    for (unsigned i = 0; i < 2; i++) {
        struct rig *r = rig_up();
        ask(r, "40 04 20 00 00 00 00 00");
        const uint32_t old = r->ticket;
        ask(r, again[i]);
        const unsigned before = r->answers;
        ask(r, "40 04 20 00 00 00 00 00");
        const struct co_value v = {.number = 1};
        co_sdo_answer(&r->sdo, old, CO_OK, &v, 1000);
        assert_int_equal(r->answers, before);
        co_sdo_answer(&r->sdo, r->ticket, CO_OK, &v, 1000);
        assert_int_equal(r->answers, before + 1);
    }
}

static void a_pending_access_that_is_never_answered_times_out(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, "40 04 20 00 00 00 00 00");
    sched_run_until(&r->s, CO_SDO_TIMEOUT_NS);
    expect(r, "80 04 20 00 00 00 04 05");
}

static void refusals_of_the_owner_reach_the_client(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    r->refuse = CO_AB_STATE;
    ask(r, "2F 00 20 01 01 00 00 00");
    expect(r, "80 00 20 01 22 00 00 08");
    ask(r, "40 00 20 01 00 00 00 00");
    expect(r, "80 00 20 01 22 00 00 08");
    assert_int_equal(r->sdo.aborts, 2);
}

static void a_frame_of_another_length_is_counted_and_not_answered(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    const uint8_t data[8] = {0x40, 0x00, 0x10};
    for (size_t len = 0; len < 8; len++) co_sdo_request(&r->sdo, data, len, 0);
    assert_int_equal(r->answers, 0);
    assert_int_equal(r->sdo.malformed, 8);
}

/* Under the sanitizers: any bytes, answers at any time. Each request of 8 bytes but an abort gets at most one answer. */
static void arbitrary_frames_do_no_harm(void **state)
{
    (void)state;
    const char *env = getenv("TEST_SEED");
    const uint64_t seed = env ? strtoull(env, NULL, 0) : 1;
    print_message("TEST_SEED=%llu\n", (unsigned long long)seed);
    struct rng g = rng_stream(seed, 0, "sdo");
    static const uint16_t index[] = {0x1000, 0x1008, 0x2000, 0x2001, 0x2002, 0x2003, 0x2004, 0x2005, 0x3000};
    struct rig *r = rig_up();
    for (unsigned i = 0; i < 300000; i++) {
        const uint64_t bits = rng_u64(&g);
        const uint64_t where = rng_u64(&g);
        uint8_t data[8];
        bits_put_le(data, bits, 8);
        if (where % 4) { /* three in four name an object */
            bits_put_le(&data[1], index[where / 4 % 9], 2);
            data[3] = (uint8_t)(where / 64 % 3);
        }
        if (where % 16 > 12) data[0] = (uint8_t)(where >> 16 & 0x1F); /* many segments */
        const unsigned before = r->answers;
        const size_t len = where % 64 == 0 ? where / 64 % 9 : 8;
        co_sdo_request(&r->sdo, data, len, r->s.now_ns);
        assert_in_range(r->answers - before, 0, 1);
        if (bits % 8 == 0)
            co_sdo_answer(&r->sdo, r->ticket, bits % 16 ? CO_OK : CO_AB_TRANSFER, &r->value[0], r->s.now_ns);
        if (bits % 1024 == 1) sched_run_until(&r->s, r->s.now_ns + NS_PER_S);
        assert_in_range(r->sdo.size, 0, CO_SDO_BUFFER);
    }
    co_sdo_reset(&r->sdo);
    ask(r, "40 00 10 00 00 00 00 00"); /* and it still serves */
    expect(r, "43 00 10 00 94 01 00 00");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_request_one_answer),
        cmocka_unit_test(a_long_string_goes_up_in_segments),
        cmocka_unit_test(an_empty_string_is_a_last_segment_without_bytes),
        cmocka_unit_test(a_string_comes_down_in_segments),
        cmocka_unit_test(a_number_may_come_down_in_segments_too),
        cmocka_unit_test(faults_of_a_segmented_transfer_abort_it),
        cmocka_unit_test(a_string_longer_than_the_object_is_refused),
        cmocka_unit_test(segments_without_end_do_not_overrun_the_buffer),
        cmocka_unit_test(a_silent_client_is_given_up_after_a_second),
        cmocka_unit_test(a_pending_access_is_answered_when_it_is_done),
        cmocka_unit_test(a_pending_access_may_fail),
        cmocka_unit_test(an_answer_to_an_abandoned_request_is_dropped),
        cmocka_unit_test(a_pending_access_that_is_never_answered_times_out),
        cmocka_unit_test(refusals_of_the_owner_reach_the_client),
        cmocka_unit_test(a_frame_of_another_length_is_counted_and_not_answered),
        cmocka_unit_test(arbitrary_frames_do_no_harm),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

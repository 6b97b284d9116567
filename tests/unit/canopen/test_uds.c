/* The server alone: messages go to a list, a few objects answer at once, later or not at all. */
#include "rig.h"

#include "canopen/uds.h"

#include <string.h>

enum { MS = 1000000, SENT_MAX = 48, LATER = 0x2004, TEXT = 0x2005 };

static const struct co_entry entry[] = {
    {0x1003, 0, CO_UNSIGNED8, CO_RW, 0, 0, 0, 0, NULL},
    {0x1018, 4, CO_UNSIGNED32, CO_RO, 0, 0, 0, 4294967295.0, NULL},
    {0x2000, 0, CO_UNSIGNED8, CO_CONST, 0, 2, 0, 255, NULL},
    {0x2000, 1, CO_UNSIGNED16, CO_RW, 0, 0, 0, 0x7FFF, NULL},
    {0x2000, 2, CO_UNSIGNED8, CO_WO, 0, 0, 0, 255, NULL},
    {LATER, 0, CO_UNSIGNED8, CO_RW, 0, 0, 0, 255, NULL},
    {TEXT, 0, CO_VISIBLE_STRING, CO_RW, 0, 0, 0, 20, ""},
};
static const struct co_od od = {entry, COUNT(entry)};
static const struct uds_window window[] = {{0x2000, 0x2000, 16}};
static const struct uds_named named[] = {{0xF18C, 0x1018, 4}};
static const struct uds_dids dids = {window, COUNT(window), named, COUNT(named)};

struct rig {
    struct sched s;
    struct uds u;
    uint8_t sent[SENT_MAX][UDS_RESPONSE_MAX];
    size_t len[SENT_MAX];
    unsigned count;
    bool hold, busy; /* messages stay in the transport; one is there */
    uint32_t refuse; /* what the owner answers, if not CO_OK */
    struct co_value value[COUNT(entry)];
    unsigned writes, resets;
    struct uds_dtc dtc[UDS_DTCS_MAX];
    unsigned dtcs;
};
static struct rig rig;

static uint32_t on_read(void *ctx, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    if (r->refuse) return r->refuse;
    if (e->index == LATER) return CO_PENDING;
    *v = r->value[e - entry];
    return CO_OK;
}

static uint32_t on_write(void *ctx, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    if (r->refuse) return r->refuse;
    r->writes++;
    r->value[e - entry] = *v;
    return e->index == LATER ? CO_PENDING : CO_OK;
}

static bool on_send(void *ctx, const uint8_t *data, size_t len, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    if (r->busy) return false;
    assert_true(r->count < SENT_MAX && len >= 1 && len <= UDS_RESPONSE_MAX);
    memcpy(r->sent[r->count], data, len);
    r->len[r->count++] = len;
    r->busy = true;
    return true;
}

static void on_reset(void *ctx, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    r->resets++;
    uds_reset(&r->u);
}

static unsigned on_dtcs(void *ctx, struct uds_dtc out[UDS_DTCS_MAX])
{
    struct rig *r = ctx;
    memcpy(out, r->dtc, sizeof r->dtc);
    return r->dtcs;
}

static void on_losses(void *ctx, uint32_t *failed, uint32_t *ignored)
{
    (void)ctx;
    *failed = 0x11;
    *ignored = 0x22;
}

static struct rig *rig_up(void)
{
    struct rig *r = &rig;
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    const struct uds_io io = {r, on_read, on_write, on_send, on_reset, on_dtcs, on_losses};
    uds_init(&r->u, &od, &dids, &io, &r->s);
    for (unsigned i = 0; i < COUNT(entry); i++) co_default(&entry[i], 5, &r->value[i]);
    return r;
}

/* The transport is done with its message, and with what that makes due. */
static void deliver(struct rig *r)
{
    while (r->busy) {
        r->busy = false;
        uds_done(&r->u, r->s.now_ns);
    }
}

static size_t bytes_of(const char *hex, uint8_t *out)
{
    size_t n = 0;
    for (; *hex; hex += hex[2] ? 3 : 2) out[n++] = (uint8_t)strtoul((const char[3]){hex[0], hex[1], '\0'}, NULL, 16);
    return n;
}

static void request(struct rig *r, const char *hex, bool functional)
{
    uint8_t data[UDS_REQUEST_MAX];
    const size_t n = bytes_of(hex, data);
    uds_request(&r->u, data, n, functional, r->s.now_ns);
    if (!r->hold) deliver(r);
}

static void expect(const struct rig *r, unsigned count, const char *hex)
{
    uint8_t want[UDS_REQUEST_MAX];
    const size_t n = bytes_of(hex, want);
    assert_int_equal(r->count, count);
    assert_int_equal(r->len[count - 1], n);
    assert_memory_equal(r->sent[count - 1], want, n);
}

/* One request, one response; none if the answer is "". */
static void asks(struct rig *r, const char *question, const char *answer)
{
    const unsigned had = r->count;
    request(r, question, false);
    if (*answer) expect(r, had + 1, answer);
    else assert_int_equal(r->count, had);
}

static void wait_ms(struct rig *r, int64_t ms)
{
    sched_run_until(&r->s, r->s.now_ns + ms * MS);
    if (!r->hold) deliver(r);
}

static struct rig *in_extended(void)
{
    struct rig *r = rig_up();
    asks(r, "10 03", "50 03 00 32 01 F4");
    return r;
}

static void every_service_answers(void **state)
{
    (void)state;
    struct rig *r = in_extended();
    r->value[1].number = 0x01020304;
    asks(r, "22 F1 8C", "62 F1 8C 04 03 02 01"); /* object bytes as over SDO */
    asks(r, "22 F1 86", "62 F1 86 03");
    asks(r, "2E 20 01 34 12", "6E 20 01");
    assert_int_equal(r->value[3].number, 0x1234);
    asks(r, "22 20 01", "62 20 01 34 12");
    asks(r, "2E 20 02 07", "6E 20 02"); /* write-only */
    asks(r, "2E 21 40 68 69", "6E 21 40");
    asks(r, "22 21 40", "62 21 40 68 69");
    asks(r, "3E 00", "7E 00");
    asks(r, "10 01", "50 01 00 32 01 F4");
    asks(r, "22 F1 86", "62 F1 86 01");
    asks(r, "11 01", "51 01");
    assert_int_equal(r->resets, 1);
}

static void negative_responses_have_the_codes_of_annex_a(void **state)
{
    (void)state;
    static const struct {
        const char *question, *answer;
    } row[] = {
        {"27 01", "7F 27 11"},
        {"00", "7F 00 11"},
        {"7E 00", "7F 7E 11"}, /* no such service */
        {"10 02", "7F 10 12"},
        {"11 03", "7F 11 12"},
        {"19 0A FF", "7F 19 12"},
        {"3E 01", "7F 3E 12"},
        {"10", "7F 10 13"},
        {"10 03 00", "7F 10 13"},
        {"11 01 00", "7F 11 13"},
        {"3E", "7F 3E 13"},
        {"14 FF FF", "7F 14 13"},
        {"14 FF FF FF FF", "7F 14 13"},
        {"19 02", "7F 19 13"},
        {"19 02 FF 00", "7F 19 13"},
        {"22", "7F 22 13"},
        {"22 F1", "7F 22 13"},
        {"22 F1 8C F1", "7F 22 13"},
        {"22 F1 8C F1 8C F1 8C F1 8C F1 8C F1 8C F1 8C F1 8C F1 8C", "7F 22 13"}, /* nine */
        {"2E 20 01", "7F 2E 13"},
        {"2E 20 01 01", "7F 2E 13"},
        {"2E 20 01 01 02 03", "7F 2E 13"},
        {"14 00 00 00", "7F 14 31"},
        {"22 F1 90", "7F 22 31"},
        {"22 20 02", "7F 22 31"}, /* write-only */
        {"22 20 03", "7F 22 31"},
        {"22 24 00", "7F 22 31"},
        {"22 1F FF", "7F 22 31"},
        {"2E 20 01 00 80", "7F 2E 31"}, /* above the entry's limit */
        {"2E F1 8C 01 02 03 04", "7F 2E 31"},
        {"2E 20 00 02", "7F 2E 31"},
        {"2E F1 86 01", "7F 2E 31"},
    };
    struct rig *r = in_extended();
    for (size_t i = 0; i < COUNT(row); i++) asks(r, row[i].question, row[i].answer);
    assert_int_equal(r->writes, 0);
    assert_int_equal(r->u.negatives, COUNT(row));
}

static void an_abort_of_the_owner_becomes_a_code(void **state)
{
    (void)state;
    static const struct {
        uint32_t abort;
        const char *answer;
    } row[] = {
        {CO_AB_STATE, "7F 22 22"},     {CO_AB_VALUE, "7F 22 31"},  {CO_AB_NO_OBJECT, "7F 22 31"},
        {CO_AB_READ_ONLY, "7F 22 31"}, {CO_AB_LENGTH, "7F 22 13"}, {CO_AB_TRANSFER, "7F 22 10"},
        {CO_AB_GENERAL, "7F 22 10"},   {CO_AB_NO_SUB, "7F 22 31"},
    };
    struct rig *r = rig_up();
    for (size_t i = 0; i < COUNT(row); i++) {
        r->refuse = row[i].abort;
        asks(r, "22 20 01", row[i].answer);
    }
}

static void writing_needs_the_extended_session(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    asks(r, "2E 20 01 01 00", "7F 2E 7F");
    asks(r, "2E", "7F 2E 7F"); /* before its length is looked at */
    asks(r, "10 03", "50 03 00 32 01 F4");
    asks(r, "2E 20 01 01 00", "6E 20 01");
    assert_int_equal(r->writes, 1);
}

static void several_identifiers_are_read_at_once(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    r->value[3].number = 0x0102;
    asks(r, "22 20 01 F1 90 20 02 F1 86", "62 20 01 02 01 F1 86 01"); /* without those that cannot be read */
    asks(r, "22 F1 90 20 02", "7F 22 31");
    r->refuse = CO_AB_STATE;
    asks(r, "22 F1 86 20 01", "7F 22 22"); /* all or nothing */
    r->refuse = CO_OK;
    asks(r, "22 FD 00", "62 FD 00 04 00 00 00 02 00 00 00 00 00 00 00 00 00 00 00 11 00 00 00 22 00 00 00");
}

static void the_suppress_bit_silences_positive_responses_alone(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    asks(r, "3E 80", "");
    asks(r, "10 83", "");
    asks(r, "22 F1 86", "62 F1 86 03");
    asks(r, "10 82", "7F 10 12");
    asks(r, "11 81", "");
    assert_int_equal(r->resets, 1);
    asks(r, "22 F1 86", "62 F1 86 01");
}

static void s3_ends_the_session_unless_something_comes(void **state)
{
    (void)state;
    struct rig *r = in_extended();
    for (unsigned i = 0; i < 3; i++) {
        wait_ms(r, 4999);
        request(r, "3E 80", i % 2);
    }
    asks(r, "22 F1 86", "62 F1 86 03");
    wait_ms(r, 5000);
    asks(r, "22 F1 86", "62 F1 86 01");
    assert_int_equal(r->u.s3_timeouts, 1);
}

static void s3_waits_for_the_response_and_for_a_request_that_comes(void **state)
{
    (void)state;
    struct rig *r = in_extended();
    r->hold = true;
    wait_ms(r, 4000);
    request(r, "3E 00", false); /* its response takes 10 s */
    wait_ms(r, 10000);
    r->hold = false;
    deliver(r);
    wait_ms(r, 4999);
    uds_begun(&r->u); /* a long request */
    wait_ms(r, 10000);
    assert_int_equal(r->u.session, UDS_SESSION_EXTENDED);
    uds_broken(&r->u, r->s.now_ns);
    wait_ms(r, 4999);
    assert_int_equal(r->u.session, UDS_SESSION_EXTENDED);
    wait_ms(r, 1);
    assert_int_equal(r->u.session, UDS_SESSION_DEFAULT);
    uds_broken(&r->u, r->s.now_ns); /* nothing to end */
    wait_ms(r, 6000);
    assert_int_equal(r->u.s3_timeouts, 1);
}

static void a_reset_waits_for_its_response(void **state)
{
    (void)state;
    struct rig *r = in_extended();
    r->hold = true;
    request(r, "11 01", false);
    expect(r, 2, "51 01");
    assert_int_equal(r->resets, 0);
    deliver(r);
    assert_int_equal(r->resets, 1);
    assert_int_equal(r->u.session, UDS_SESSION_DEFAULT);
}

static void an_access_that_takes_time_is_answered_when_it_is_done(void **state)
{
    (void)state;
    struct rig *r = in_extended();
    const struct co_value v = {.number = 0x5A};
    asks(r, "22 21 00 F1 86", "");
    wait_ms(r, 49);
    uds_answer(&r->u, CO_OK, &v, r->s.now_ns);
    deliver(r);
    expect(r, 2, "62 21 00 5A F1 86 03");
    uds_answer(&r->u, CO_OK, &v, r->s.now_ns); /* twice: nothing waits */
    asks(r, "2E 21 00 33", "");
    uds_answer(&r->u, CO_OK, NULL, r->s.now_ns);
    deliver(r);
    expect(r, 3, "6E 21 00");
    asks(r, "2E 21 00 33", "");
    uds_answer(&r->u, CO_AB_TRANSFER, NULL, r->s.now_ns);
    deliver(r);
    expect(r, 4, "7F 2E 10");
    asks(r, "22 21 00 F1 86", "");
    uds_answer(&r->u, CO_AB_NO_SUB, NULL, r->s.now_ns);
    deliver(r);
    expect(r, 5, "62 F1 86 03");
}

static void response_pending_comes_after_p2_and_general_reject_in_the_end(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    const struct co_value v = {.number = 1};
    asks(r, "22 21 00", "");
    wait_ms(r, 49);
    assert_int_equal(r->count, 0);
    wait_ms(r, 1);
    expect(r, 1, "7F 22 78");
    wait_ms(r, 949);
    assert_int_equal(r->count, 1);
    wait_ms(r, 1);
    expect(r, 2, "7F 22 10");
    uds_answer(&r->u, CO_OK, &v, r->s.now_ns); /* too late */
    asks(r, "3E 00", "7E 00");
    request(r, "22 21 00", true);
    wait_ms(r, 50);
    expect(r, 4, "7F 22 78");
    uds_answer(&r->u, CO_AB_NO_SUB, NULL, r->s.now_ns);
    deliver(r);
    expect(r, 5, "7F 22 31"); /* owed, even to a functional request */
}

static void a_response_waits_for_a_notice_in_the_transport(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    const struct co_value v = {.number = 7};
    request(r, "22 21 00", false);
    r->hold = true;
    wait_ms(r, 50);
    expect(r, 1, "7F 22 78");
    uds_answer(&r->u, CO_OK, &v, r->s.now_ns);
    assert_int_equal(r->count, 1);
    deliver(r);
    expect(r, 2, "62 21 00 07");
    r->hold = false;
    asks(r, "3E 00", "7E 00");
}

static void a_second_request_is_told_to_repeat(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    const struct co_value v = {.number = 7};
    asks(r, "22 21 00", "");
    asks(r, "22 F1 86", "7F 22 21");
    request(r, "22 F1 86", true);
    asks(r, "3E 80", "");
    assert_int_equal(r->count, 1);
    assert_int_equal(r->u.busy, 2);
    uds_answer(&r->u, CO_OK, &v, r->s.now_ns);
    deliver(r);
    expect(r, 2, "62 21 00 07");
}

static void a_functional_request_gets_no_refusal_that_others_would_give_too(void **state)
{
    (void)state;
    static const struct {
        const char *question;
        bool answered;
    } row[] = {{"22 F1 86", true}, {"27 01", false}, {"10 02", false},          {"22 F1 90", false},
               {"10", true},       {"3E 00", true},  {"2E 20 01 01 00", false}, {"22 F1", true}};
    struct rig *r = rig_up();
    for (size_t i = 0; i < COUNT(row); i++) {
        const unsigned had = r->count;
        request(r, row[i].question, true);
        assert_int_equal(r->count - had, row[i].answered);
    }
}

static void trouble_codes_are_counted_listed_and_cleared(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    asks(r, "19 01 FF", "59 01 09 01 00 00");
    r->dtc[0] = (struct uds_dtc){0x8120, UDS_DTC_FAILED | UDS_DTC_CONFIRMED};
    r->dtc[1] = (struct uds_dtc){0xFF03, UDS_DTC_CONFIRMED};
    r->dtcs = 2;
    asks(r, "19 02 08", "59 02 09 81 20 00 09 FF 03 00 08");
    asks(r, "19 02 01", "59 02 09 81 20 00 09");
    asks(r, "19 01 09", "59 01 09 01 00 02");
    asks(r, "19 82 FF", "");
    r->value[0].number = 2;
    asks(r, "14 FF FF FF", "54");
    assert_int_equal(r->value[0].number, 0);
    assert_int_equal(r->writes, 1);
}

static void a_reset_from_outside_drops_the_request(void **state)
{
    (void)state;
    struct rig *r = in_extended();
    const struct co_value v = {.number = 7};
    asks(r, "22 21 00", "");
    uds_reset(&r->u);
    uds_answer(&r->u, CO_OK, &v, r->s.now_ns);
    wait_ms(r, 6000);
    assert_int_equal(r->count, 1);
    assert_int_equal(r->u.s3_timeouts, 0);
    asks(r, "22 F1 86", "62 F1 86 01");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_service_answers),
        cmocka_unit_test(negative_responses_have_the_codes_of_annex_a),
        cmocka_unit_test(an_abort_of_the_owner_becomes_a_code),
        cmocka_unit_test(writing_needs_the_extended_session),
        cmocka_unit_test(several_identifiers_are_read_at_once),
        cmocka_unit_test(the_suppress_bit_silences_positive_responses_alone),
        cmocka_unit_test(s3_ends_the_session_unless_something_comes),
        cmocka_unit_test(s3_waits_for_the_response_and_for_a_request_that_comes),
        cmocka_unit_test(a_reset_waits_for_its_response),
        cmocka_unit_test(an_access_that_takes_time_is_answered_when_it_is_done),
        cmocka_unit_test(response_pending_comes_after_p2_and_general_reject_in_the_end),
        cmocka_unit_test(a_response_waits_for_a_notice_in_the_transport),
        cmocka_unit_test(a_second_request_is_told_to_repeat),
        cmocka_unit_test(a_functional_request_gets_no_refusal_that_others_would_give_too),
        cmocka_unit_test(trouble_codes_are_counted_listed_and_cleared),
        cmocka_unit_test(a_reset_from_outside_drops_the_request),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

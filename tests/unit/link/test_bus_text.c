/* Text of the bus port: lines to requests, answers to lines. */
#include "rig.h"

#include "base/rng.h"
#include "link/line/bus_text.h"

#include <string.h>

static void lines_are_understood_or_refused(void **state)
{
    (void)state;
    static const struct {
        const char *line;
        enum bus_text_err err;
        unsigned fields;
        struct bus_request want;
    } rows[] = {
        {"R 0", BUS_TEXT_OK, 2, {.op = BUS_READ}},
        {"r f\r", BUS_TEXT_OK, 2, {.op = BUS_READ, .address = 15}},
        {"  R\t0A  1600 ", BUS_TEXT_OK, 2, {.op = BUS_READ, .address = 10, .strobe_ns = 1600}},
        {"R ff 999999999", BUS_TEXT_OK, 2, {.op = BUS_READ, .address = 255, .strobe_ns = 999999999}},
        {"R 0Ah", BUS_TEXT_OK, 2, {.op = BUS_READ, .address = 10}},
        {"w fH 3", BUS_TEXT_OK, 2, {.op = BUS_WRITE, .address = 15, .data = 3}},
        {"R h", BUS_TEXT_NUMBER, 1, {.op = BUS_READ}},
        {"R 100h", BUS_TEXT_NUMBER, 1, {.op = BUS_READ}},
        {"R 0hh", BUS_TEXT_NUMBER, 1, {.op = BUS_READ}},
        {"W 1 1h", BUS_TEXT_NUMBER, 2, {.op = BUS_WRITE, .address = 1}},
        {"W F 0003", BUS_TEXT_OK, 2, {.op = BUS_WRITE, .address = 15, .data = 3}},
        {"w d FfFf 1", BUS_TEXT_OK, 2, {.op = BUS_WRITE, .address = 13, .data = 0xFFFF, .strobe_ns = 1}},
        {"?", BUS_TEXT_OK, 1, {.op = BUS_WHO}},
        {"", BUS_TEXT_SYNTAX, 0, {0}},
        {"\r", BUS_TEXT_SYNTAX, 0, {0}},
        {"X 0", BUS_TEXT_SYNTAX, 0, {0}},
        {"\x1F", BUS_TEXT_SYNTAX, 0, {0}}, /* a "?" without its bit 5 */
        {"R0", BUS_TEXT_SYNTAX, 0, {0}},
        {"RW 0", BUS_TEXT_SYNTAX, 0, {0}},
        {"R", BUS_TEXT_SYNTAX, 1, {.op = BUS_READ}},
        {"R g", BUS_TEXT_NUMBER, 1, {.op = BUS_READ}},
        {"R 100", BUS_TEXT_NUMBER, 1, {.op = BUS_READ}},
        {"R -1", BUS_TEXT_NUMBER, 1, {.op = BUS_READ}},
        {"R 0x1", BUS_TEXT_NUMBER, 1, {.op = BUS_READ}},
        {"R 1 0", BUS_TEXT_NUMBER, 2, {.op = BUS_READ, .address = 1}},
        {"R 1 1000000000", BUS_TEXT_NUMBER, 2, {.op = BUS_READ, .address = 1}},
        {"R 1 8a", BUS_TEXT_NUMBER, 2, {.op = BUS_READ, .address = 1}},
        {"R 1 800 1", BUS_TEXT_SYNTAX, 2, {.op = BUS_READ, .address = 1, .strobe_ns = 800}},
        {"W 1", BUS_TEXT_SYNTAX, 2, {.op = BUS_WRITE, .address = 1}},
        {"W 1 10000", BUS_TEXT_NUMBER, 2, {.op = BUS_WRITE, .address = 1}},
        {"W 1 1 1 1", BUS_TEXT_SYNTAX, 2, {.op = BUS_WRITE, .address = 1, .data = 1, .strobe_ns = 1}},
        {"? 1", BUS_TEXT_SYNTAX, 1, {.op = BUS_WHO}},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct bus_request r;
        unsigned fields = 99;
        const enum bus_text_err err = bus_text_parse(rows[i].line, strlen(rows[i].line), &r, &fields);
        if (err != rows[i].err || fields != rows[i].fields)
            fail_msg("\"%s\": %d with %u fields", rows[i].line, (int)err, fields);
        assert_int_equal(r.op, rows[i].want.op);
        assert_int_equal(r.address, rows[i].want.address);
        assert_int_equal(r.data, rows[i].want.data);
        assert_int_equal(r.strobe_ns, rows[i].want.strobe_ns);
    }
}

/* 80 characters are a line, 81 are too many; a line need not end in NUL. */
static void length_is_bounded(void **state)
{
    (void)state;
    char line[BUS_TEXT_LINE_MAX + 1];
    struct bus_request r;
    unsigned fields;
    memset(line, ' ', sizeof line);
    memcpy(line, "R 2", 3);
    assert_int_equal(bus_text_parse(line, BUS_TEXT_LINE_MAX, &r, &fields), BUS_TEXT_OK);
    assert_int_equal(bus_text_parse(line, BUS_TEXT_LINE_MAX + 1, &r, &fields), BUS_TEXT_OVERLONG);
    assert_int_equal(fields, 0);
    assert_int_equal(bus_text_parse("R 2 80", 3, &r, &fields), BUS_TEXT_OK);
    assert_int_equal(r.strobe_ns, 0);
    assert_int_equal(bus_text_parse("R 12", 3, &r, &fields), BUS_TEXT_OK);
    assert_int_equal(r.address, 1);
}

static void answers(void **state)
{
    (void)state;
    char out[BUS_TEXT_MAX];
    const struct bus_request read = {.op = BUS_READ}, write = {.op = BUS_WRITE, .address = 15, .data = 3};
    const struct bus_request who = {.op = BUS_WHO};
    assert_int_equal(bus_text_done(&read, 0x8001, 123400, out), strlen("R 00h 8001 t=123400\n"));
    assert_string_equal(out, "R 00h 8001 t=123400\n");
    bus_text_done(&write, 3, 1, out);
    assert_string_equal(out, "W 0Fh 0003 t=1\n");
    assert_int_equal(bus_text_refused(&read, 2, "not-ready", 9, out), strlen("E not-ready R 00h t=9\n"));
    assert_string_equal(out, "E not-ready R 00h t=9\n");
    bus_text_refused(&write, 1, bus_text_code(BUS_TEXT_NUMBER), 9, out);
    assert_string_equal(out, "E number W - t=9\n");
    bus_text_refused(&read, 0, bus_text_code(BUS_TEXT_SYNTAX), 9, out);
    assert_string_equal(out, "E syntax - - t=9\n");
    bus_text_refused(&read, 0, bus_text_code(BUS_TEXT_OVERLONG), INT64_MAX, out);
    assert_string_equal(out, "E overlong - - t=9223372036854775807\n");
    bus_text_refused(&who, 1, "syntax", 9, out);
    assert_string_equal(out, "E syntax ? - t=9\n");
    assert_string_equal(bus_text_code(BUS_TEXT_OK), "");
}

/* What the port would be sent for a request comes back as that request. */
static void random_requests_survive(void **state)
{
    (void)state;
    const uint64_t seed = rig_seed(5);
    struct rng rng = rng_stream(seed, 1, "test");
    for (unsigned i = 0; i < 10000; i++) {
        const uint64_t v = rng_u64(&rng);
        const struct bus_request want = {.op = v & 1 ? BUS_WRITE : BUS_READ,
                                         .address = (uint8_t)(v >> 8),
                                         .data = v & 1 ? (uint16_t)(v >> 16) : 0,
                                         .strobe_ns = v & 2 ? 1 + (int64_t)(v >> 32) % 999999999 : 0};
        char line[64], data[8] = "", strobe[16] = "";
        if (want.op == BUS_WRITE) (void)snprintf(data, sizeof data, " %x", want.data);
        if (want.strobe_ns) (void)snprintf(strobe, sizeof strobe, " %d", (int)want.strobe_ns);
        (void)snprintf(line, sizeof line, "%c %X%s%s", want.op == BUS_WRITE ? 'W' : 'R', want.address, data, strobe);
        struct bus_request got;
        unsigned fields;
        assert_int_equal(bus_text_parse(line, strlen(line), &got, &fields), BUS_TEXT_OK);
        assert_int_equal(got.op, want.op);
        assert_int_equal(got.address, want.address);
        assert_int_equal(got.data, want.data);
        assert_int_equal(got.strobe_ns, want.strobe_ns);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_are_understood_or_refused),
        cmocka_unit_test(length_is_bounded),
        cmocka_unit_test(answers),
        cmocka_unit_test(random_requests_survive),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

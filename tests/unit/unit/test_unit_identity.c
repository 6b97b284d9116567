/* What a unit of each board says of itself on CAN: its name, product code and serial number, also after a reset. */
#include "host_wire.h"

#include "unit/unit.h"

enum { SERIAL = 0x0A0B0C0D, UP_NS = NS_PER_S / 2, ABORT = 0x80, EXPEDITED = 0x02, LAST = 0x01 };

static struct wire {
    struct sched s;
    struct lab lab;
    struct can_bus bus;
    struct can_node host;
    struct unit u;
    uint8_t node, answer[8];
    unsigned answers, frames;
} w;

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    assert_false(m->flags & CAN_EXT);
    w.frames++;
    if (m->id != 0x580u + w.node) return;
    memcpy(w.answer, m->data, sizeof w.answer);
    w.answers++;
}

static void live(const struct board_type *t)
{
    const struct lab_cfg lab = lab_default();
    const struct can_bus_cfg bus = {.bitrate_hz = 1000000};
    const struct board_can_cfg can = {.name = "a", .node_id = t->node};
    struct unit_cfg cfg = unit_default("a");
    memset(&w, 0, sizeof w);
    w.node = t->node;
    w.host = (struct can_node){.name = "host", .rx = on_frame};
    sched_init(&w.s);
    lab_init(&w.lab, &lab, 1);
    can_bus_init(&w.bus, &bus, &w.s);
    can_attach(&w.bus, &w.host);
    unit_cfg_type(&cfg, t);
    cfg.board.serial = SERIAL;
    unit_init(&w.u, &cfg, &w.lab, &w.s);
    unit_connect(&w.u, &can, &w.bus, &w.s);
    unit_power_up(&w.u, 0);
    sched_run_until(&w.s, UP_NS);
}

/* One request, answered once, by no abort. */
static void ask(uint8_t command, uint16_t index, uint8_t sub)
{
    w.answers = 0;
    host_asks(&w.bus, &w.host, w.node, command, index, sub, 0);
    host_settle(&w.bus);
    assert_int_equal(w.answers, 1);
    assert_int_not_equal(w.answer[0], ABORT);
}

static uint32_t upload(uint16_t index, uint8_t sub)
{
    ask(0x40, index, sub);
    return (uint32_t)bits_get_le(&w.answer[4], 4);
}

/* 1008h, expedited or in segments of seven characters. */
static void upload_name(char name[32])
{
    size_t n = 0;
    ask(0x40, 0x1008, 0);
    if (w.answer[0] & EXPEDITED) n = 4u - (w.answer[0] >> 2 & 3), memcpy(name, &w.answer[4], n);
    else {
        for (uint8_t toggle = 0; n + 8 < 32; toggle ^= 0x10) {
            ask(0x60 | toggle, 0, 0);
            const size_t more = 7u - (w.answer[0] >> 1 & 7);
            memcpy(name + n, &w.answer[1], more);
            n += more;
            if (w.answer[0] & LAST) break;
        }
    }
    name[n] = '\0';
}

/* Names and product codes of the requirements: PSA2-CAN-09, PSD1-CAN-07, PMKA-CAN-05, PIK-CAN-06, GYRO-CAN-05, BINS-CAN-05,
 * RECEIVER-CAN-05. Frames of a reading: the messages of a reading in proto/<board>.yaml. */
static const struct {
    const char *board, *name;
    uint32_t product;
    unsigned frames;
} row[] = {
    {"psa2", "PSA-2", 0x50534132, 2},        {"psd1", "PSD-1", 0x50534431, 1}, {"pmka", "PMKA", 0x504D4B41, 2},
    {"pik", "PIK", 0x50494B30, 3},           {"gyro", "GYRO", 0x4759524F, 3},  {"bins", "BINS", 0x42494E53, 4},
    {"receiver", "RECEIVER", 0x474E5353, 4},
};

static void each_board_says_what_it_is(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(row); i++) {
        char name[32];
        live(board_name_find(row[i].board)->type);
        upload_name(name);
        assert_string_equal(name, row[i].name);
        assert_int_equal(upload(0x1018, 2), row[i].product);
    }
    size_t types = 0;
    while (board_types[types]) types++;
    assert_int_equal(types, COUNT(row));
}

static void each_board_keeps_its_serial_number_over_a_reset(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) {
        live(*t);
        assert_int_equal(upload(0x1018, 4), SERIAL);
        for (uint8_t command = 0x81; command <= 0x82; command++) { /* reset node, reset communication */
            host_put(&w.bus, &w.host, 0, 2, (const uint8_t[]){command, w.node});
            sched_run_until(&w.s, w.s.now_ns + UP_NS);
            assert_int_equal(upload(0x1018, 4), SERIAL);
        }
    }
}

static unsigned readings_a_second(const struct board_type *t)
{
    union board_profile_store p;
    fields_default(t->fields, &p);
    return (unsigned)(NS_PER_S / t->period_ns(&p));
}

/* Boot-up, answers, PDOs, heartbeats: on_frame() looks at each. In a second come all readings, but one under way, and a
 * heartbeat. */
static void each_board_sends_11_bit_identifiers_alone(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(row); i++) {
        const struct board_type *t = board_name_find(row[i].board)->type;
        const unsigned due = row[i].frames * readings_a_second(t);
        live(t);
        host_put(&w.bus, &w.host, 0, 2, (const uint8_t[]){0x01, w.node}); /* start */
        w.frames = 0;
        sched_run_until(&w.s, w.s.now_ns + NS_PER_S);
        if (w.frames + row[i].frames < due || w.frames > due + 2)
            fail_msg("%s: %u frames, expected %u", row[i].board, w.frames, due);
        (void)upload(0x1018, 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_board_says_what_it_is),
        cmocka_unit_test(each_board_keeps_its_serial_number_over_a_reset),
        cmocka_unit_test(each_board_sends_11_bit_identifiers_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

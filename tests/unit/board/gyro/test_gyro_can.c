/* The gyro unit on CAN: readings as three PDOs, settings and modes by SDO, the level unit's frames off the bus. */
#include "gyro_rig.h"

#include "board/gyro/board.h"
#include "canopen/co_node.h"
#include "gen/gyro_od.h"
#include "gen/psabench_can.h"

enum { NODE = 9, LEVEL_NODE = 5, SEEN_MAX = 8192 };

static struct {
    struct can_bus bus;
    struct gyro_can can;
    struct can_node host, level;
    struct sched_ev feed;
    uint16_t seq;
    struct can_msg seen[SEEN_MAX];
    unsigned count;
    char said[256];
} wire;
static struct rig r;

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    if (wire.count < SEEN_MAX) wire.seen[wire.count++] = *m;
}

/* As the level unit would: beta 1', gamma -30'. */
static void feed(void *ctx, int64_t t_ns)
{
    struct can_msg m = {.id = 0x180 + LEVEL_NODE};
    (void)ctx;
    const double b = 1.0 * ARCMIN, g = -30.0 * ARCMIN;
    const struct psabench_psa2_xy_t xy = {.x = (int32_t)(1.2 * sin(g) * cos(b) / GYRO_VOLTS),
                                          .y = (int32_t)(-1.2 * sin(b) / GYRO_VOLTS),
                                          .seq = wire.seq++};
    m.len = (uint8_t)psabench_psa2_xy_pack(m.data, &xy, sizeof m.data);
    assert_int_equal(can_send(&wire.bus, &wire.level, &m, t_ns), CAN_OK);
    sched_at(&r.s, &wire.feed, t_ns + FRAME_NS);
}

static void said(void *ctx, const char *name, const char *why)
{
    (void)ctx;
    (void)name;
    (void)snprintf(wire.said, sizeof wire.said, "%s", why);
}

static int up(void **state)
{
    const struct board_cfg cfg = {.seed = 7, .serial = 3, .level_node = LEVEL_NODE};
    const struct board_io io = {.ctx = &r, .event = rig_event};
    struct gyro_profile profile;
    (void)state;
    memset(&r, 0, sizeof r);
    memset(&wire, 0, sizeof wire);
    fields_default(&gyro_fields, &profile);
    sched_init(&r.s);
    can_bus_init(&wire.bus, &(struct can_bus_cfg){.bitrate_hz = 1000000}, &r.s);
    wire.host = (struct can_node){.name = "host", .rx = on_frame};
    wire.level = (struct can_node){.name = "level", .order = CAN_ORDER_FIFO};
    can_attach(&wire.bus, &wire.host);
    can_attach(&wire.bus, &wire.level);
    gyro_init(&r.b, &profile, &cfg, &io, &r.s);
    const struct board_can_cfg can = {.name = "g", .type = &gyro_board, .node_id = NODE, .refused = said};
    gyro_can.init(&wire.can, &can, &r.b.base, &wire.bus, &r.s);
    gyro_board.power_up(&r.b.base, 0);
    gyro_can.power_up(&wire.can, 0);
    sched_ev(&wire.feed, feed, NULL);
    sched_at(&r.s, &wire.feed, 1000000);
    rig_run(&r, 0.5);
    return 0;
}

static void send(uint32_t id, unsigned len, const uint8_t *data)
{
    struct can_msg m = {.id = id, .len = (uint8_t)len};
    memcpy(m.data, data, len);
    assert_int_equal(can_send(&wire.bus, &wire.host, &m, r.s.now_ns), CAN_OK);
}

/* Expedited: the abort code, or 0 and what was read. */
static uint32_t sdo(const uint8_t request[8], uint32_t *data)
{
    wire.count = 0;
    send(0x600 + NODE, 8, request);
    rig_run(&r, 0.001);
    for (unsigned k = 0; k < wire.count; k++) {
        const uint8_t *d = wire.seen[k].data;
        if (wire.seen[k].id != 0x580 + NODE) continue;
        *data = d[4] | (uint32_t)d[5] << 8 | (uint32_t)d[6] << 16 | (uint32_t)d[7] << 24;
        return d[0] == 0x80 ? *data : 0;
    }
    fail_msg("no answer");
    return 0;
}

static uint32_t read_raw(unsigned index, unsigned sub)
{
    uint32_t data = 0;
    const uint8_t request[8] = {0x40, (uint8_t)index, (uint8_t)(index >> 8), (uint8_t)sub};
    assert_int_equal(sdo(request, &data), 0);
    return data;
}

static double read_real(unsigned index, unsigned sub)
{
    float v;
    const uint32_t raw = read_raw(index, sub);
    memcpy(&v, &raw, sizeof v);
    return (double)v;
}

static uint32_t write_raw(unsigned index, unsigned sub, uint32_t raw, unsigned size)
{
    uint32_t data = 0;
    const uint8_t request[8] = {(uint8_t)(0x23 | (4 - size) << 2),
                                (uint8_t)index,
                                (uint8_t)(index >> 8),
                                (uint8_t)sub,
                                (uint8_t)raw,
                                (uint8_t)(raw >> 8),
                                (uint8_t)(raw >> 16),
                                (uint8_t)(raw >> 24)};
    return sdo(request, &data);
}

static uint32_t write_real(unsigned index, unsigned sub, float v)
{
    uint32_t raw;
    memcpy(&raw, &v, sizeof raw);
    return write_raw(index, sub, raw, 4);
}

static const char *refusal(void)
{
    static struct co_value v;
    uint32_t abort = CO_OK;
    const struct co_entry *e = co_find(gyro_device.od, 0x2031, 0, &abort);
    memset(&v, 0, sizeof v);
    const struct co_node *n = gyro_can.node(&wire.can);
    assert_int_equal(n->io.read(n->io.ctx, e, &v, r.s.now_ns), CO_OK);
    return v.text;
}

/* ---- objects */

static void settings_begin_as_the_dictionary_says_and_come_back_as_written(void **state)
{
    (void)state;
    unsigned seen = 0;
    for (unsigned i = 0; i < gyro_device.od->count; i++) {
        const struct co_entry *e = &gyro_device.od->entry[i];
        const bool setting = e->index >= GYRO_OD_SLEW && e->index <= GYRO_OD_LEVEL && e->access == CO_RW;
        if (!setting || e->sub == 0) continue;
        const bool real = e->type == CO_REAL32;
        const double now = real ? read_real(e->index, e->sub) : (double)read_raw(e->index, e->sub);
        if (!(fabs(now - e->value) <= 1e-6 * fabs(e->value))) fail_msg("%04X:%02X is %g", e->index, e->sub, now);
        const double other = 0.5 * (e->value + e->high);
        const uint32_t abort =
            real ? write_real(e->index, e->sub, (float)other) : write_raw(e->index, e->sub, (uint32_t)other, 1);
        assert_int_equal(abort, 0);
        const double then = real ? read_real(e->index, e->sub) : (double)read_raw(e->index, e->sub);
        if (!(fabs(then - (real ? (double)(float)other : floor(other))) < 1e-9))
            fail_msg("%04X:%02X", e->index, e->sub);
        seen++;
    }
    assert_int_equal(seen, 6 + 5 + 32 + 2 + 3 + 1 + 2 + 4);
    assert_int_equal(read_raw(GYRO_OD_LEVEL, 1), LEVEL_NODE);
    send(0, 2, (const uint8_t[]){129, NODE}); /* reset node: defaults */
    rig_run(&r, 0.5);
    assert_true(read_real(GYRO_OD_LOOPS, 1) == 1.0);
}

static void what_cannot_be_written_is_refused_in_words(void **state)
{
    (void)state;
    assert_int_equal(write_real(GYRO_OD_LEVEL, 4, 0.0F), CO_AB_VALUE);
    assert_non_null(strstr(refusal(), "cannot be 0"));
    assert_int_equal(write_real(GYRO_OD_PLACE, 1, 90.0F), CO_AB_VALUE);
    assert_int_equal(write_raw(GYRO_OD_CONTROL, 1, 7, 1), CO_AB_VALUE);
    assert_int_equal(write_raw(GYRO_OD_CONTROL, 2, 1, 1), CO_AB_READ_ONLY);
    assert_int_equal(write_raw(GYRO_OD_RUN, 1, 32, 1), 0);
    assert_int_equal(write_raw(GYRO_OD_RUN, 2, 127, 1), 0);
    assert_int_equal(write_raw(GYRO_OD_CONTROL, 1, GYRO_COMPASS, 1), CO_AB_STATE);
    assert_non_null(strstr(refusal(), "127"));
    assert_int_equal(write_raw(GYRO_OD_RUN, 2, 1, 1), 0);
    assert_int_equal(write_raw(GYRO_OD_CONTROL, 1, GYRO_COMPASS, 1), 0);
    assert_int_equal(write_real(GYRO_OD_POSITIONS, 1, 10.0F), CO_AB_STATE);
    assert_non_null(strstr(refusal(), "under way"));
    assert_int_equal(write_real(GYRO_OD_LOOPS, 1, 2.0F), 0); /* loops may be changed at any time */
    sched_cancel(&r.s, &wire.feed);
    rig_run(&r, 0.2);
    assert_int_equal(write_raw(GYRO_OD_CONTROL, 1, GYRO_HOLD, 1), CO_AB_STATE);
    assert_non_null(strstr(refusal(), "silent"));
    assert_int_equal(write_raw(GYRO_OD_CONTROL, 1, GYRO_OFF, 1), 0);
}

static void the_clock_tells_the_period_and_all_steps_since_reset(void **state)
{
    (void)state;
    assert_int_equal(read_raw(GYRO_OD_CLOCK, 1), STEP_NS);
    r.b.profile.step_ns = 5000000; /* of another profile */
    assert_int_equal(read_raw(GYRO_OD_CLOCK, 1), 5000000);
    r.b.profile.step_ns = STEP_NS;
    rig_run(&r, 700.0); /* beyond 16 bits */
    const uint32_t steps = read_raw(GYRO_OD_CLOCK, 2);
    assert_in_range(steps, 70000, 70100);
    assert_int_equal(steps & 0xFFFF, read_raw(GYRO_OD_LATEST, 4));
    assert_int_equal(write_raw(GYRO_OD_CLOCK, 1, 1, 4), CO_AB_READ_ONLY);
    send(0, 2, (const uint8_t[]){129, NODE}); /* reset node */
    rig_run(&r, 1.0);
    assert_in_range(read_raw(GYRO_OD_CLOCK, 2), 70, 100);
}

static void no_torque(void *ctx, double u1_radps, double u2_radps, int64_t t_ns)
{
    (void)ctx;
    (void)u1_radps;
    (void)u2_radps;
    (void)t_ns;
}

static double no_angle_rad(void *ctx, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    return 0.0;
}

static const struct board_platform_io sensor_alone = {
    .torque = no_torque, .servo_rad = no_angle_rad, .encoder_rad = no_angle_rad, .magnetic_rad = rig_magnetic};

/* As the latest step has it, 0 to 360. */
static void the_magnetic_heading_is_that_of_the_sensor_if_one_is_fitted(void **state)
{
    (void)state;
    r.b.base.io.platform = &sensor_alone;
    rig_run(&r, 1.0);
    assert_int_equal(read_raw(GYRO_OD_MAGNETIC, 1), 0);
    assert_int_equal(read_raw(GYRO_OD_MAGNETIC, 2), 0);
    r.magnetic = true;
    r.magnetic_rad = -30.0 * RAD_PER_DEG;
    rig_run(&r, 0.1);
    assert_int_equal(read_raw(GYRO_OD_MAGNETIC, 1), 1);
    assert_true(fabs(read_real(GYRO_OD_MAGNETIC, 2) - 330.0) < 1e-4);
    assert_int_equal(write_raw(GYRO_OD_MAGNETIC, 2, 0, 4), CO_AB_READ_ONLY);
    r.magnetic = false;
    r.b.base.io.platform = NULL;
}

/* ---- readings */

static void a_reading_is_three_pdos_of_one_step(void **state)
{
    (void)state;
    assert_int_equal(write_raw(GYRO_OD_CONTROL, 1, GYRO_LEVEL, 1), 0);
    send(0, 2, (const uint8_t[]){1, NODE});
    rig_run(&r, 0.1);
    wire.count = 0;
    rig_run(&r, 1.0);
    unsigned readings = 0;
    uint16_t step = 0, seq = 0;
    for (unsigned k = 0; k < wire.count; k++) {
        if (wire.seen[k].id != 0x180 + NODE) continue;
        struct psabench_gyro_rates_t u;
        struct psabench_gyro_angles_t a;
        struct psabench_gyro_level_t l;
        unsigned at[2], n = 0; /* the next two of this node, whatever others send between */
        for (unsigned i = k + 1; i < wire.count && n < 2; i++)
            if ((wire.seen[i].id & 0x7F) == NODE && wire.seen[i].id != 0x700 + NODE) at[n++] = i;
        if (n < 2) break;
        assert_int_equal(wire.seen[at[0]].id, 0x280 + NODE);
        assert_int_equal(wire.seen[at[1]].id, 0x380 + NODE);
        assert_int_equal(psabench_gyro_rates_unpack(&u, wire.seen[k].data, 8), 0);
        assert_int_equal(psabench_gyro_angles_unpack(&a, wire.seen[at[0]].data, 8), 0);
        assert_int_equal(psabench_gyro_level_unpack(&l, wire.seen[at[1]].data, 8), 0);
        if (readings > 0) assert_int_equal(a.step, (uint16_t)(step + 1));
        if (readings > 0) assert_in_range((uint16_t)(l.level_seq - seq), 2, 3);
        step = a.step;
        seq = l.level_seq;
        assert_int_equal(a.mode, GYRO_LEVEL);
        assert_int_equal(a.phase, GYRO_IDLE);
        assert_true(fabs(l.beta * 2e-6 * 60.0 - 1.0) < 0.01 && fabs(l.gamma * 2e-6 * 60.0 + 30.0) < 0.01);
        const double beta = l.beta * 2e-6 * RAD_PER_DEG, gamma = l.gamma * 2e-6 * RAD_PER_DEG;
        const double up = gyro_place_of(50.0, 0.0, 0.0).up_radps;
        assert_true(fabs(u.u1 * 1e-4 * DEGPH + beta + up * cos(beta) * sin(gamma)) < 0.02 * DEGPH);
        assert_true(fabs(u.u2 * 1e-4 * DEGPH - up * cos(beta) * cos(gamma)) < 1e-3 * DEGPH);
        readings++;
    }
    assert_in_range(readings, 99, 101);
    assert_int_equal(read_raw(GYRO_OD_CONTROL, 1), GYRO_LEVEL);
    assert_int_equal(read_raw(GYRO_OD_LATEST, 8), r.b.latest.level_seq);
}

/* ---- conditions */

static unsigned emcy(uint16_t code)
{
    unsigned n = 0;
    for (unsigned k = 0; k < wire.count; k++) {
        const struct can_msg *m = &wire.seen[k];
        n += m->id == 0x80 + NODE && (m->data[0] | m->data[1] << 8) == code;
    }
    return n;
}

static void a_silent_level_unit_is_an_emergency_once(void **state)
{
    (void)state;
    assert_int_equal(write_raw(GYRO_OD_CONTROL, 1, GYRO_LEVEL, 1), 0);
    rig_run(&r, 1.0);
    wire.count = 0;
    sched_cancel(&r.s, &wire.feed);
    rig_run(&r, 2.0);
    assert_int_equal(emcy(GYRO_EMCY_LEVEL_LOST), 1);
    assert_true(read_raw(GYRO_OD_CONTROL, 4) & GYRO_LEVEL_LOST);
    wire.count = 0;
    feed(NULL, r.s.now_ns);
    rig_run(&r, 2.0);
    assert_int_equal(emcy(0), 1); /* it has ended */
}

/* A lost frame, gone by the time somebody looks; a nod that the angle sensor, which is not fitted here, does not follow. */
static void what_came_and_went_is_counted_and_a_self_test_is_begun(void **state)
{
    (void)state;
    assert_int_equal(write_raw(GYRO_OD_SELF_TEST, 1, 1, 1), CO_AB_STATE);
    assert_non_null(strstr(refusal(), "navigation"));
    assert_int_equal(write_raw(GYRO_OD_CONTROL, 1, GYRO_NAVIGATE, 1), 0);
    rig_run(&r, 1.0);
    const uint32_t before = read_raw(GYRO_OD_CLOCK, 2);
    wire.seq++;
    rig_run(&r, 3.0);
    assert_int_equal(read_raw(GYRO_OD_CONTROL, 4), 0);
    for (unsigned i = 1; i <= 4; i++) assert_int_equal(read_raw(GYRO_OD_PAST, i), i == 2);
    for (unsigned i = 5; i <= 8; i++)
        assert_in_range(read_raw(GYRO_OD_PAST, i), i == 6 ? before : 0, i == 6 ? before + 2 : 0);
    assert_int_equal(write_raw(GYRO_OD_SELF_TEST, 1, 0, 1), 0); /* nothing */
    assert_int_equal(read_raw(GYRO_OD_SELF_TEST, 1), 0);
    assert_int_equal(write_raw(GYRO_OD_SELF_TEST, 1, 1, 1), 0);
    assert_int_equal(read_raw(GYRO_OD_SELF_TEST, 1), 1);
    assert_int_equal(write_raw(GYRO_OD_SELF_TEST, 1, 1, 1), CO_AB_STATE);
    assert_int_equal(write_raw(GYRO_OD_SELF_TEST, 2, 1, 1), CO_AB_READ_ONLY);
    wire.count = 0;
    rig_run(&r, 5.0);
    assert_int_equal(emcy(GYRO_EMCY_ENCODER_FAULT), 1);
    assert_int_equal(read_raw(GYRO_OD_SELF_TEST, 1), 0);
    assert_int_equal(read_raw(GYRO_OD_SELF_TEST, 2), GYRO_TEST_FAILED);
    assert_int_equal(read_raw(GYRO_OD_PAST, 3), 1);
    assert_int_equal(read_raw(GYRO_OD_CONTROL, 4), GYRO_ENCODER_FAULT);
}

static void frames_of_another_node_are_not_the_level_unit_s(void **state)
{
    (void)state;
    const uint32_t frames = r.b.counters.level_frames;
    sched_cancel(&r.s, &wire.feed);
    rig_run(&r, 0.02);
    const uint32_t before = r.b.counters.level_frames;
    assert_true(before >= frames);
    send(0x180 + LEVEL_NODE + 1, 8, (const uint8_t[8]){1, 2, 3});
    send(0x280 + LEVEL_NODE, 8, (const uint8_t[8]){1, 2, 3});
    send(0x180 + LEVEL_NODE, 4, (const uint8_t[8]){1, 2, 3}); /* too short */
    rig_run(&r, 0.02);
    assert_int_equal(r.b.counters.level_frames, before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(settings_begin_as_the_dictionary_says_and_come_back_as_written, up),
        cmocka_unit_test_setup(what_cannot_be_written_is_refused_in_words, up),
        cmocka_unit_test_setup(the_clock_tells_the_period_and_all_steps_since_reset, up),
        cmocka_unit_test_setup(the_magnetic_heading_is_that_of_the_sensor_if_one_is_fitted, up),
        cmocka_unit_test_setup(a_reading_is_three_pdos_of_one_step, up),
        cmocka_unit_test_setup(a_silent_level_unit_is_an_emergency_once, up),
        cmocka_unit_test_setup(what_came_and_went_is_counted_and_a_self_test_is_begun, up),
        cmocka_unit_test_setup(frames_of_another_node_are_not_the_level_unit_s, up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

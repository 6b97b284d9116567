/* PMKA on CAN: the readings in PDOs, registers and refusals by SDO, the stream judged. */
#include "host_wire.h"
#include "pmka_rig.h"

#include "gen/pmka_od.h"
#include "gen/psabench_can.h"

enum { NODE = 7, SEEN_MAX = 4096 };

struct can_rig {
    struct can_bus bus;
    struct pmka_can can;
    struct can_node host;
    struct can_msg seen[SEEN_MAX];
    unsigned count;
    struct pmka_host stream; /* of the CAN side */
};

static struct rig rig;
static struct can_rig wire;

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    if (wire.count < SEEN_MAX) wire.seen[wire.count++] = *m;
}

/* To the rig and to the CAN side. */
static void tee(void *ctx, const struct pmka_reading *r, int64_t t_ns)
{
    rig_reading(ctx, r, t_ns);
    wire.stream.reading(wire.stream.ctx, r, t_ns);
}

static void start(int64_t bitrate_hz)
{
    struct pmka_profile p = rig_profile();
    p.beat_periods = 12;
    p.zero_periods = 5;
    rig_init(&rig, &p);
    for (unsigned a = 0; a < 3; a++) rig.input[a].mean_v = a == 1 ? -4.0 : 4.0;
    memset(&wire, 0, sizeof wire);
    can_bus_init(&wire.bus, &(struct can_bus_cfg){.bitrate_hz = (uint32_t)bitrate_hz}, &rig.s);
    wire.host = (struct can_node){.name = "host", .rx = on_frame};
    can_attach(&wire.bus, &wire.host);
    pmka_board.can->init(&wire.can, &(struct board_can_cfg){.name = "a", .type = &pmka_board, .node_id = NODE},
                         &rig.b.base, &wire.bus, &rig.s);
    wire.stream = rig.b.host;
    rig.b.host = (struct pmka_host){.ctx = &rig, .reading = tee};
    pmka_board.power_up(&rig.b.base, 0);
    pmka_board.can->power_up(&wire.can, 0);
}

static void send(uint32_t id, uint8_t len, const uint8_t *data)
{
    host_put(&wire.bus, &wire.host, id, len, data);
}

static void operational(void)
{
    send(0, 2, (const uint8_t[]){1, NODE});
    sched_run_until(&rig.s, rig.s.now_ns + 1000000);
}

/* Expedited: the abort code, or 0 and what was read. */
static uint32_t sdo(bool write, unsigned index, unsigned sub, unsigned size, uint32_t *data)
{
    const uint8_t command = write ? (uint8_t)(0x23 | (4 - size) << 2) : 0x40;
    wire.count = 0;
    host_asks(&wire.bus, &wire.host, NODE, command, (uint16_t)index, (uint8_t)sub, write ? *data : 0);
    for (unsigned n = 0; n < 100; n++) {
        sched_run_until(&rig.s, rig.s.now_ns + 100000);
        for (unsigned k = 0; k < wire.count; k++) {
            const uint8_t *d = wire.seen[k].data;
            if (wire.seen[k].id != 0x580 + NODE) continue;
            *data = d[4] | (uint32_t)d[5] << 8 | (uint32_t)d[6] << 16 | (uint32_t)d[7] << 24;
            return d[0] == 0x80 ? *data : 0;
        }
    }
    fail_msg("no answer to %04X:%02X", index, sub);
    return 0;
}

static void readings_as_pdos(void **state)
{
    (void)state;
    start(1000000);
    operational();
    wire.count = 0;
    rig_readings(&rig, 200);
    sched_run_until(&rig.s, rig.s.now_ns + 1000000);
    unsigned pairs = 0, resets = 0;
    for (unsigned k = 0; k + 1 < wire.count; k++) {
        if (wire.seen[k].id != 0x180 + NODE) continue;
        struct psabench_pmka_codes_t c;
        struct psabench_pmka_state_t s;
        assert_int_equal(wire.seen[k + 1].id, 0x280 + NODE);
        assert_int_equal(psabench_pmka_codes_unpack(&c, wire.seen[k].data, wire.seen[k].len), 0);
        assert_int_equal(psabench_pmka_state_unpack(&s, wire.seen[k + 1].data, wire.seen[k + 1].len), 0);
        const struct pmka_reading *r = &rig.reading[s.seq];
        const int16_t code[] = {c.x, c.y, c.z, c.k};
        const int reset[] = {s.reset_x, s.reset_y, s.reset_z, s.reset_k};
        const unsigned serves[] = {s.serves_x, s.serves_y, s.serves_z, s.serves_k};
        for (unsigned i = 0; i < 4; i++) {
            assert_int_equal(code[i], r->code[i]);
            assert_int_equal(reset[i], r->reset[i]);
            assert_int_equal(serves[i], r->serves[i]);
            resets += r->reset[i] < 0;
        }
        assert_int_equal(s.tau, r->tau);
        assert_int_equal(s.cal, r->cal);
        assert_int_equal(s.autonomous, 1);
        assert_int_equal(s.saturated | s.clipped, 0);
        assert_int_equal(s.t, r->temp_code);
        pairs++;
    }
    assert_int_equal(pairs, rig.readings);
    assert_true(resets > 30);
}

static void ends_are_flagged_by_integrator(void **state)
{
    (void)state;
    start(1000000);
    pmka_set_mode(&rig.b, PMKA_PROGRAM);
    operational();
    rig.input[1].mean_v = 10.45;
    bool clipped_only = false;
    for (unsigned n = 1; n <= 120; n++) {
        rig_readings(&rig, n);
        sched_run_until(&rig.s, rig.s.now_ns + 1000000);
        struct psabench_pmka_state_t s;
        assert_int_equal(wire.seen[wire.count - 1].id, 0x287);
        assert_int_equal(psabench_pmka_state_unpack(&s, wire.seen[wire.count - 1].data, 8), 0);
        assert_int_equal(s.saturated, rig.reading[n - 1].saturated[1] ? 2 : 0);
        assert_int_equal(s.clipped, rig.reading[n - 1].clipped[1] ? 2 : 0);
        assert_int_equal(s.autonomous, 0);
        clipped_only |= s.clipped && !s.saturated;
    }
    assert_true(clipped_only);
    assert_true(rig.reading[119].saturated[1]);
}

/* Sources can 3.3: what each refusal is on the wire. */
static void registers_by_sdo(void **state)
{
    (void)state;
    start(1000000);
    operational();
    rig_readings(&rig, 10);
    const struct {
        bool write;
        unsigned index, sub, size;
        uint32_t data, abort;
    } rows[] = {
        {false, 0x2002, 1, 2, 0, 0},           {true, 0x2002, 1, 2, 5, 0x06010002}, /* code: read-only */
        {false, 0x2002, 11, 2, 0, 0x06010001},                                      /* COMMAND: write-only */
        {true, 0x2002, 10, 2, 7, 0x06090030},                                       /* MODE */
        {false, 0x2002, 16, 2, 0, 0x06090011},                                      /* nothing there */
        {true, 0x2002, 12, 2, 300, 0},                                              /* BEAT */
        {true, 0x2051, 0, 4, 100, 0},                                               /* a strobe too short */
        {false, 0x2002, 1, 2, 0, 0x06090030},  {true, 0x2051, 0, 4, 0, 0},
    };
    for (size_t k = 0; k < COUNT(rows); k++) {
        uint32_t data = rows[k].data;
        const uint32_t got = sdo(rows[k].write, rows[k].index, rows[k].sub, rows[k].size, &data);
        if (got != rows[k].abort) fail_msg("row %zu: %08X, not %08X", k, got, rows[k].abort);
    }
    uint32_t data = 0;
    assert_int_equal(sdo(false, 0x2002, 12, 2, &data), 0);
    assert_int_equal(data & 0xFFFF, 300);
    assert_int_equal(sdo(false, 0x2030, 12, 4, &data), 0);
    assert_in_range(data, rig.b.counters.readings - 1, rig.b.counters.readings);
    assert_int_equal(sdo(false, 0x1018, 4, 4, &data), 0);
    assert_int_equal(data, 3);
}

static void a_bus_too_slow_is_refused(void **state)
{
    (void)state;
    start(50000);
    operational();
    wire.count = 0;
    rig_readings(&rig, 60);
    for (unsigned k = 0; k < wire.count; k++) assert_int_not_equal(wire.seen[k].id, 0x187);
    assert_false(wire.can.node.fits);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(readings_as_pdos),
        cmocka_unit_test(ends_are_flagged_by_integrator),
        cmocka_unit_test(registers_by_sdo),
        cmocka_unit_test(a_bus_too_slow_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

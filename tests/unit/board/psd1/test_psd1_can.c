/* PSD-1 on CAN: cycles in PDOs, control words, coefficients and refusals by SDO. */
#include "host_wire.h"
#include "psd1_rig.h"

#include "board/psd1/board.h"
#include "gen/psabench_can.h"
#include "gen/psd1_od.h"

enum { NODE = 6, SEEN_MAX = 4096 };

static struct rig rig;
static struct {
    struct can_bus bus;
    struct psd1_can can;
    struct can_node host;
    struct can_msg seen[SEEN_MAX];
    unsigned count;
    struct psd1_host stream; /* of the CAN side */
} wire;

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    if (wire.count < SEEN_MAX) wire.seen[wire.count++] = *m;
}

/* To the rig and to the CAN side. */
static void tee(void *ctx, const struct psd1_cycle *c, int64_t t_ns)
{
    rig_cycle(ctx, c, t_ns);
    wire.stream.cycle(wire.stream.ctx, c, t_ns);
}

static void start(const struct psd1_profile *p, uint32_t bitrate_hz)
{
    rig_init(&rig, p, 0.0);
    rig.w_radps[0] = 1.0;
    rig.w_radps[2] = -1.0;
    memset(&wire, 0, sizeof wire);
    can_bus_init(&wire.bus, &(struct can_bus_cfg){.bitrate_hz = bitrate_hz}, &rig.s);
    wire.host = (struct can_node){.name = "host", .rx = on_frame};
    can_attach(&wire.bus, &wire.host);
    psd1_board.can->init(&wire.can, &(struct board_can_cfg){.name = "a", .type = &psd1_board, .node_id = NODE},
                         &rig.b.base, &wire.bus, &rig.s);
    wire.stream = rig.b.host;
    rig.b.host = (struct psd1_host){.ctx = &rig, .cycle = tee, .fault = NULL};
    rig.b.host.fault = NULL;
    psd1_board.power_up(&rig.b.base, 0);
    psd1_board.can->power_up(&wire.can, 0);
    while (!rig.b.ready) rig_run(&rig, 1000000);
}

static void send(uint32_t id, uint8_t len, const uint8_t *data)
{
    host_put(&wire.bus, &wire.host, id, len, data);
}

/* Expedited: the abort code, or 0 and what was read. */
static uint32_t sdo(bool write, unsigned index, unsigned sub, unsigned size, uint32_t *data)
{
    const uint8_t command = write ? (uint8_t)(0x23 | (4 - size) << 2) : 0x40;
    wire.count = 0;
    host_asks(&wire.bus, &wire.host, NODE, command, (uint16_t)index, (uint8_t)sub, write ? *data : 0);
    for (unsigned n = 0; n < 500; n++) {
        rig_run(&rig, 100000);
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

static uint32_t get(unsigned index, unsigned sub)
{
    uint32_t v = 0;
    const uint32_t abort = sdo(false, index, sub, 4, &v);
    if (abort) fail_msg("%04X:%02X: %08X", index, sub, abort);
    return v;
}

static uint32_t put(unsigned index, unsigned sub, unsigned size, uint32_t v)
{
    return sdo(true, index, sub, size, &v);
}

static void operational(void)
{
    send(0, 2, (const uint8_t[]){1, NODE});
    rig_run(&rig, 1000000);
}

static const struct can_msg *find(uint32_t id, uint8_t cnt, unsigned cnt_at)
{
    for (unsigned k = 0; k < wire.count; k++)
        if (wire.seen[k].id == id && wire.seen[k].data[cnt_at] == cnt) return &wire.seen[k];
    fail_msg("no frame %X of cycle %u", id, cnt);
    return NULL;
}

static void cycles_as_pdos(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    start(&p, 1000000);
    operational();
    for (unsigned k = 1; k < 4; k++) {
        const uint32_t cob = get(0x1800 + k, 1);
        assert_int_equal(cob >> 31, 1); /* off, until the host wants them */
        assert_int_equal(put(0x1800 + k, 1, 4, cob & 0x7FFFFFFF), 0);
    }
    wire.count = 0;
    const unsigned first = rig.cycles;
    rig_run(&rig, 50 * 972800);
    assert_true(rig.cycles >= first + 49);
    for (unsigned i = first; i + 1 < rig.cycles; i++) {
        const struct psd1_cycle *c = &rig.cycle[i];
        struct psabench_psd1_cycle_t w;
        struct psabench_psd1_time_t t;
        struct psabench_psd1_gyro_t g;
        struct psabench_psd1_rate_t r;
        const uint8_t cnt = (uint8_t)c->seq;
        assert_int_equal(psabench_psd1_cycle_unpack(&w, find(0x186, cnt, 6)->data, 8), 0);
        assert_int_equal(psabench_psd1_time_unpack(&t, find(0x286, cnt, 7)->data, 8), 0);
        assert_int_equal(psabench_psd1_gyro_unpack(&g, find(0x386, cnt, 6)->data, 8), 0);
        assert_int_equal(psabench_psd1_rate_unpack(&r, find(0x486, cnt, 6)->data, 8), 0);
        assert_int_equal(w.x, c->word[0]);
        assert_int_equal(w.y, c->word[1]);
        assert_int_equal(w.z, c->word[2]);
        assert_int_equal(w.read_x + w.read_y + w.read_z, 3);
        assert_int_equal(w.overrun + w.late + w.mixed + w.clip, 0);
        assert_int_equal(t.tstamp, c->t_a0_ns / 1000);
        assert_int_equal(t.length, 60); /* of 800 ns, 48.4 us cut */
        assert_int_equal(t.waited, (c->t_a0_ns - c->t_dr_ns) / 800);
        assert_int_equal(g.x, (int16_t)c->gyro[0]);
        assert_int_equal(g.y, (int16_t)c->gyro[1]);
        assert_int_equal(g.z, (int16_t)c->gyro[2]);
        assert_int_equal(r.x, 2865); /* 57.296 deg/s in 0.02 */
        assert_int_equal(r.y, 0);
        assert_int_equal(r.z, -2865);
    }
}

/* A counter as it was before the question: asking takes time. */
static void counts(uint8_t sub, uint32_t want)
{
    assert_int_equal(get(PSD1_OD_COUNTERS, sub), want);
}

static void flags_of_a_cycle_on_the_wire(void **state)
{
    (void)state;
    struct psd1_profile p = rig_exact();
    p.host_strobe_ns = 2000000;
    start(&p, 1000000);
    rig.volts[1] = -11.0;
    operational();
    rig_run(&rig, 30000000);
    wire.count = 0;
    rig_run(&rig, 10000000);
    struct psabench_psd1_cycle_t w = {0};
    assert_true(wire.count > 0);
    assert_int_equal(psabench_psd1_cycle_unpack(&w, wire.seen[0].data, 8), 0);
    assert_int_equal(w.overrun + w.late + w.mixed + w.clip, 4);
    counts(16, rig.b.counters.late);
    counts(17, rig.b.counters.stretched);
    const uint32_t lost = get(PSD1_OD_COUNTERS, 20);
    assert_in_range(rig.b.counters.lost_z - lost, 0, 3);
    assert_true(lost > 10);
    p.host_strobe_ns = 30000; /* late, and no more */
    start(&p, 1000000);
    operational();
    rig_run(&rig, 30000000);
    wire.count = 0;
    rig_run(&rig, 10000000);
    assert_int_equal(psabench_psd1_cycle_unpack(&w, wire.seen[0].data, 8), 0);
    assert_int_equal(w.late, 1);
    assert_int_equal(w.overrun + w.mixed + w.clip, 0);
}

static void control_words_by_sdo(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    start(&p, 1000000);
    assert_int_equal(get(PSD1_OD_UC1, 0), 0x220013);
    assert_int_equal(get(PSD1_OD_UC2, 0), 0x020013);
    assert_int_equal(put(PSD1_OD_UC2, 0, 4, 0x020027), 0);
    assert_int_equal(get(PSD1_OD_UC2, 0), 0x020027);
    for (unsigned a = 1; a <= 3; a++) {
        assert_int_equal(get(PSD1_OD_CONTROL, a), 0x020027);
        assert_int_equal(get(PSD1_OD_ZERO_COEF, a), 0x800000);
        assert_int_equal(get(PSD1_OD_FULL_COEF, a), 0x400000);
    }
    assert_int_equal(put(PSD1_OD_UC1, 0, 4, 0x220027), 0);
    assert_int_equal(rig.b.adc[2].n.calibrations, 2);
    assert_int_equal(get(PSD1_OD_COUNTERS, 14), 5); /* commands */
    /* refused, with the reason in words */
    assert_int_equal(put(PSD1_OD_UC2, 0, 4, 0x028027), CO_AB_VALUE);
    assert_non_null(strstr(wire.can.node.refusal, "WL must be 0"));
    assert_int_equal(put(PSD1_OD_UC1, 0, 4, 0x020027), CO_AB_VALUE);
    assert_int_equal(put(PSD1_OD_UC2, 0, 4, 0x1000000), CO_AB_VALUE);
    assert_int_equal(put(PSD1_OD_ZERO_COEF, 1, 4, 0), CO_AB_READ_ONLY);
    rig_run(&rig, 30000000);
    assert_int_equal(get(PSD1_OD_CODES, 1), 40921);
    assert_int_equal(get(PSD1_OD_CODES, 3), 65208);
    const int32_t counts = (int32_t)get(PSD1_OD_GYRO, 3);
    assert_in_range(rig.b.latest.gyro[2] - counts + 100, 0, 100);
    assert_true(counts < 0);
}

/* The host on 2002h alone. */
static void words_by_bus_cycles(void **state)
{
    (void)state;
    struct psd1_profile p = rig_exact();
    p.host_strobe_ns = 0;
    start(&p, 1000000);
    rig_run(&rig, 2000000);
    assert_int_equal(get(PSD1_OD_BUS, PSD1_REG_STATUS + 1) & 7, 1);
    uint32_t v = 0;
    assert_int_equal(sdo(false, PSD1_OD_BUS, 2, 4, &v), CO_AB_STATE);
    assert_int_equal(get(PSD1_OD_BUS, 1), 40921);
    assert_int_equal(get(PSD1_OD_BUS, 2), 9830);
    assert_int_equal(put(PSD1_OD_STROBE_NS, 0, 4, 100), 0);
    assert_int_equal(sdo(false, PSD1_OD_BUS, 3, 4, &v), CO_AB_VALUE);
    assert_int_equal(put(PSD1_OD_STROBE_NS, 0, 4, 5000), 0);
    assert_int_equal(get(PSD1_OD_BUS, 3), 65208);
    assert_int_equal(put(PSD1_OD_BUS, 1, 2, 0), CO_AB_READ_ONLY);
    assert_int_equal(put(PSD1_OD_BUS, PSD1_REG_FLAGS + 1, 2, 8), CO_AB_VALUE);
    assert_int_equal(put(PSD1_OD_BUS, PSD1_REG_FLAGS + 1, 2, 0), 0);
    assert_false(rig.b.int0);
    assert_int_equal(rig.cycles, 1);
    assert_int_equal(rig.b.counters.too_short, 1);
}

static void silence_is_an_emergency(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    start(&p, 1000000);
    rig.b.host.fault = wire.stream.fault;
    rig.b.host.ctx = wire.stream.ctx;
    rig.b.host.cycle = wire.stream.cycle;
    operational();
    ad7712_fault(&rig.b.adc[0], &(struct chip_fault){.drdy = CHIP_STUCK_HIGH}, rig.s.now_ns);
    rig_run(&rig, 5000000);
    wire.count = 0;
    rig_run(&rig, 120000000);
    assert_int_equal(wire.count, 1);
    assert_int_equal(wire.seen[0].id, 0x086);
    assert_int_equal(wire.seen[0].data[0] | wire.seen[0].data[1] << 8, 0xFF01);
    wire.count = 0;
    ad7712_fault(&rig.b.adc[0], &(struct chip_fault){.drdy = CHIP_FREE}, rig.s.now_ns);
    rig_run(&rig, 3000000);
    assert_int_equal(wire.seen[0].id, 0x086);
    assert_int_equal(wire.seen[0].data[0] | wire.seen[0].data[1] << 8, 0);
}

/* A reset of the node resets the board, and whoever waits is answered. */
static void reset_node_resets_the_board(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    start(&p, 1000000);
    operational();
    send(0, 2, (const uint8_t[]){0x81, NODE});
    rig_run(&rig, 500000);
    assert_int_equal(rig.b.counters.resets, 1);
    assert_false(rig.b.ready);
    assert_int_equal(put(PSD1_OD_UC2, 0, 4, 0x020013), CO_AB_STATE); /* the set-up is under way */
    rig_run(&rig, 20000000);
    assert_true(rig.b.ready);
}

/* A bus that a cycle does not fit on is refused in words. */
static void a_bus_too_slow_is_told(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    start(&p, 100000);
    operational();
    rig_run(&rig, 20000000);
    wire.count = 0;
    rig_run(&rig, 10000000);
    assert_int_equal(wire.count, 0);
    assert_true(error_active(&wire.can.node.node, PSD1_EMCY_STREAM_REFUSED));
}

static void every_part_and_counter_has_its_place(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    start(&p, 1000000);
    rig_run(&rig, 10000000);
    for (unsigned i = 0; i < psd1_board.part_count; i++) {
        const struct board_part *part = &psd1_board.parts[i];
        for (unsigned k = 0; k < part->counter_count; k++) {
            uint32_t v;
            memcpy(&v, (const char *)&rig.b + part->offset + part->counters[k].offset, sizeof v);
            if (i == 0 && strcmp(part->counters[k].name, "cycles") == 0) assert_int_equal(v, rig.b.counters.cycles);
            if (i > 0 && strcmp(part->counters[k].name, "conversions") == 0)
                assert_int_equal(v, rig.b.adc[i - 1].n.conversions);
        }
    }
    const struct chip_fault fault = {.dout = CHIP_STUCK_HIGH};
    psd1_board.parts[2].fault(&rig.b.base, 2, &fault, rig.s.now_ns);
    rig_run(&rig, 3000000);
    assert_int_equal(rig.b.latest.word[1], 0xFFFF);
    assert_int_equal(rig.b.latest.word[0], 40921);
    assert_true(psd1_board.parts[3].flip(&rig.b.base, 3, 0, 0x04, rig.s.now_ns)); /* gain 2 */
    rig_run(&rig, 10000000);
    assert_int_equal(rig.b.adc[2].control >> 16 & 0xFF, 0x06);
    psd1_board.power_down(&rig.b.base, rig.s.now_ns);
    assert_false(psd1_board.parts[3].flip(&rig.b.base, 3, 0, 0x04, rig.s.now_ns));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cycles_as_pdos),          cmocka_unit_test(flags_of_a_cycle_on_the_wire),
        cmocka_unit_test(control_words_by_sdo),    cmocka_unit_test(words_by_bus_cycles),
        cmocka_unit_test(silence_is_an_emergency), cmocka_unit_test(reset_node_resets_the_board),
        cmocka_unit_test(a_bus_too_slow_is_told),  cmocka_unit_test(every_part_and_counter_has_its_place),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

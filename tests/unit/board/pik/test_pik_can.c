/* A PIK as its unit and the bus see it: the type's table, and what goes over CAN. */
#include "host_wire.h"
#include "looks.h"

#include "board/pik/board.h"
#include "board/pik/internal.h"
#include "gen/pik_od.h"
#include "unit/boards.h"

#include <string.h>

enum { NODE = 8, SEEN_MAX = 4096 };

struct rig {
    struct sched s;
    struct can_bus bus;
    struct pik b;
    struct pik_can can;
    struct can_node host;
    struct can_msg seen[SEEN_MAX];
    unsigned count;
    double v[PIK_AXES];
};
static struct rig r, other;

static double accel(void *ctx, unsigned axis, int64_t t_ns)
{
    (void)t_ns;
    return ((struct rig *)ctx)->v[axis];
}

LOOKS_ROW(accel_row, accel);

static double degc(void *ctx, unsigned channel, int64_t t_ns)
{
    (void)ctx;
    (void)channel;
    (void)t_ns;
    return 25.0;
}

static void on_rx(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct rig *rig = ctx;
    (void)t_ns;
    if (rig->count < SEEN_MAX) rig->seen[rig->count++] = *m;
}

static void run(struct rig *rig, int64_t ns)
{
    sched_run_until(&rig->s, rig->s.now_ns + ns);
}

static void host_sends(struct rig *rig, uint32_t id, uint8_t len, const uint8_t *data)
{
    host_put(&rig->bus, &rig->host, id, len, data);
    run(rig, 3000000);
}

static void rig_up(struct rig *rig, const char *key, const char *value)
{
    struct pik_profile p;
    struct board_cfg cfg = {.seed = 5, .serial = 42};
    char why[300];
    memset(rig, 0, sizeof *rig);
    fields_default(&pik_fields, &p);
    if (key) assert_true(fields_set(pik_board.fields, &p, key, 0, value, why, sizeof why));
    assert_true(pik_board.profile_check(&p, why, sizeof why));
    for (unsigned i = 0; i < PIK_AXES; i++) cfg.afe[i] = afe_nominal(AFE_VOLTAGE);
    pik_board.cfg_default(&cfg);
    const struct board_io io = {.ctx = rig, .accel = accel_row, .temp_degc = degc};
    sched_init(&rig->s);
    can_bus_init(&rig->bus, &(struct can_bus_cfg){1000000, 0}, &rig->s);
    rig->host = (struct can_node){.name = "host", .rx = on_rx, .ctx = rig};
    can_attach(&rig->bus, &rig->host);
    pik_board.init(&rig->b.base, &p, &cfg, &io, &rig->s);
    const struct board_can_cfg node = {.name = "p", .type = &pik_board, .node_id = NODE};
    pik_board.can->init(&rig->can, &node, &rig->b.base, &rig->bus, &rig->s);
    pik_board.power_up(&rig->b.base, 0);
    pik_board.can->power_up(&rig->can, 0);
    run(rig, 1000000);
}

static void start(struct rig *rig)
{
    host_sends(rig, 0, 2, (const uint8_t[]){1, NODE});
}

static const struct can_msg *last_of(const struct rig *rig, uint32_t id)
{
    for (unsigned i = rig->count; i-- > 0;)
        if (rig->seen[i].id == id) return &rig->seen[i];
    fail_msg("no frame %03X", id);
    return NULL;
}

/* Expedited upload; the four bytes of the answer. */
static uint32_t ask(struct rig *rig, uint16_t index, uint8_t sub)
{
    host_sends(rig, 0x600 + NODE, 8, (const uint8_t[]){0x40, (uint8_t)index, (uint8_t)(index >> 8), sub, 0, 0, 0, 0});
    return (uint32_t)bits_get_le(&last_of(rig, 0x580 + NODE)->data[4], 4);
}

static int64_t s32(const uint8_t *at)
{
    return (int32_t)bits_get_le(at, 4);
}

static void a_reading_goes_out_in_three_frames(void **state)
{
    (void)state;
    rig_up(&r, NULL, NULL);
    start(&r);
    r.v[0] = 10.0;
    r.v[1] = -10.0;
    r.v[2] = 5.0;
    run(&r, NS_PER_S);
    const struct pik_reading *l = &r.b.latched;
    const struct can_msg *counts = last_of(&r, 0x188), *totals = last_of(&r, 0x288), *z = last_of(&r, 0x388);
    assert_int_equal(counts->len, 8);
    for (unsigned i = 0; i < PIK_AXES; i++)
        assert_int_equal((int16_t)bits_get_le(counts->data + 2 * i, 2), l->increment[i]);
    assert_in_range(l->increment[0], 17, 18);
    assert_in_range(-l->increment[1], 17, 18);
    assert_int_equal(counts->data[6], l->seq & 0xFF);
    assert_int_equal(counts->data[7], 0);
    assert_int_equal(s32(totals->data), l->total[0]);
    assert_int_equal(s32(totals->data + 4), l->total[1]);
    assert_int_equal(s32(z->data), l->total[2]);
    assert_int_equal(s32(z->data + 4), l->t_ns / 1000);
    r.count = 0;
    const uint32_t before = r.b.latched.seq;
    run(&r, 100000000);
    unsigned frames = 0;
    for (unsigned i = 0; i < r.count; i++) frames += r.seen[i].id == 0x188;
    assert_int_equal(frames, r.b.latched.seq - before);
}

/* What an object reads, of the state before the question: asking takes time, and a reading may be latched meanwhile. */
static void gives(uint16_t index, uint8_t sub, int64_t want)
{
    assert_int_equal((int32_t)ask(&r, index, sub), (int32_t)want);
}

static void objects(void **state)
{
    (void)state;
    rig_up(&r, NULL, NULL);
    r.v[1] = -10.0;
    run(&r, 99 * INT64_C(1000000));
    gives(PIK_OD_TOTALS, 2, r.b.latched.total[1]);
    assert_int_equal(ask(&r, PIK_OD_TOTALS, 1), 0);
    gives(PIK_OD_READING, 1, r.b.latched.seq);
    gives(PIK_OD_READING, 2, r.b.latched.t_ns / 1000);
    assert_int_equal(ask(&r, PIK_OD_READING, 3) & 0xFF, PIK_ST_NEW);
    assert_int_equal(ask(&r, PIK_OD_PLATE, 1) & 0xFFFFFF, 'p' | 'i' << 8 | 'k' << 16);
    assert_int_equal(ask(&r, PIK_OD_PLATE, 2), 174000);
    assert_int_equal(ask(&r, PIK_OD_PLATE, 3), 1796);
    assert_int_equal(ask(&r, PIK_OD_PLATE, 4) & 0xFFFF, 15);
    assert_int_equal(ask(&r, 0x1018, 4), 42);
    const uint32_t seq = r.b.latched.seq;
    assert_int_equal(ask(&r, PIK_OD_BUS, PIK_REG_SEQ + 1) & 0xFFFF, seq);
    assert_int_equal(ask(&r, PIK_OD_BUS, PIK_REG_LATCH + 1), 0x06010001);
    assert_int_equal(r.b.counters.cycles, 1);
}

/* FF11h, and its end. */
static void saturation_is_an_emergency(void **state)
{
    (void)state;
    rig_up(&r, NULL, NULL);
    start(&r);
    r.v[2] = 10.49;
    run(&r, 200 * INT64_C(1000000));
    const struct can_msg *m = last_of(&r, 0x80 + NODE);
    assert_int_equal(bits_get_le(m->data, 2), 0xFF11);
    assert_int_equal(m->data[2], 0x81);
    assert_int_equal(last_of(&r, 0x188)->data[7], PIK_ST_SATURATED_Z);
    r.v[2] = 1.0;
    run(&r, 200 * INT64_C(1000000));
    assert_int_equal(bits_get_le(last_of(&r, 0x80 + NODE)->data, 2), 0);
    assert_int_equal(last_of(&r, 0x188)->data[7], 0);
}

static bool same_digest(void)
{
    char hex[2][SHA256_HEX];
    const struct rig *rigs[2] = {&r, &other};
    for (unsigned i = 0; i < 2; i++) {
        struct sha256 s;
        sha256_init(&s);
        pik_board.digest(&rigs[i]->b.base, &s);
        sha256_hex(&s, hex[i]);
    }
    return strcmp(hex[0], hex[1]) == 0;
}

static void ignore_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    (void)ctx;
    (void)s;
    (void)n;
}

static void digest_is_of_the_state_not_of_who_looks(void **state)
{
    (void)state;
    rig_up(&r, NULL, NULL);
    rig_up(&other, NULL, NULL);
    r.v[0] = other.v[0] = 3.0;
    struct trace_sink ear = {.mask = PIK_PULSE_LINES, .steps = ignore_steps};
    run(&r, 2345678);
    trace_attach(&r.b.base.trace, &ear);
    run(&r, 10000000);
    run(&other, 12345678);
    assert_true(same_digest());
    other.b.channel[0].axis.charge++;
    assert_false(same_digest());
    other.b.channel[0].axis.charge--;
    assert_true(same_digest());
    other.b.channel[1].plus_from++;
    assert_false(same_digest());
}

static unsigned truths;
static double truth_of_x;

static void on_truth(void *ctx, const char *name, double value)
{
    (void)ctx;
    truths++;
    if (strcmp(name, "x_plus_hz_per_v") == 0) truth_of_x = value;
}

static void what_the_table_says(void **state)
{
    (void)state;
    char text[200];
    rig_up(&r, "latch_us", "0");
    assert_true(pik_board.ready(&r.b.base)); /* it waits for strobes */
    assert_int_equal(pik_board.period_ns(&r.b.profile), 0);
    rig_up(&r, NULL, NULL);
    assert_false(pik_board.ready(&r.b.base));
    run(&r, 10000000);
    assert_true(pik_board.ready(&r.b.base));
    pik_board.about(&r.b.profile, text, sizeof text);
    assert_string_equal(text, "174 Hz/V, a pulse of 5.747 mV s, at most 1.796 kHz, TCLK 287.4 us, latched every 10 ms");
    truths = 0;
    pik_board.truth(&r.b.base, on_truth, NULL);
    assert_int_equal(truths, 20);
    assert_true(truth_of_x == pik_true_k_hz_per_v(&r.b, 0, 1, 25.0));
    struct board_cfg cfg = {.seed = 1};
    struct pik_profile p;
    fields_default(&pik_fields, &p);
    p.ra_ohm = 768.0;
    pik_board.cfg_default(&cfg);
    assert_true(cfg.afe[2].load_ohm == 735.0 && cfg.afe[0].divider_ratio == 1.0);
    pik_board.cfg_profiled(&cfg, &p);
    assert_true(cfg.afe[1].load_ohm == 768.0);
    r.b.base.faults = PIK_FAULT_FROZEN_WORDS;
    assert_true(r.b.base.faults);
    r.b.base.faults = 0;
    assert_false(r.b.base.faults);
    assert_true(pik_board.analog && r.b.base.afe[2].cfg.load_ohm > 0.0);
    for (unsigned i = 0; pik_board.port_lines[i]; i++)
        assert_true(trace_find(&r.b.base.trace, pik_board.port_lines[i]) >= 0);
}

/* Faults of parts go where their names say. */
static void faults_of_parts(void **state)
{
    (void)state;
    static const char *const names[] = {"controller", "conv.x", "conv.y", "conv.z", "clock"};
    rig_up(&r, NULL, NULL);
    assert_int_equal(pik_board.part_count, COUNT(names));
    for (unsigned i = 0; i < COUNT(names); i++) assert_string_equal(pik_board.parts[i].name, names[i]);
    pik_board.parts[3].fault(&r.b.base, 3, &(struct chip_fault){.dout = CHIP_STUCK_LOW}, r.s.now_ns);
    assert_true(r.b.channel[2].stuck && !r.b.channel[0].stuck && !r.b.channel[1].stuck);
    pik_board.parts[4].fault(&r.b.base, 4, &(struct chip_fault){.clock_ppm = 77}, r.s.now_ns);
    assert_int_equal(r.b.clock_fault_ppm, 77);
    assert_true(pik_board.parts[1].flip(&r.b.base, 1, 0, 4, r.s.now_ns));
    r.v[0] = r.v[1] = 10.0;
    run(&r, 30000000);
    const char *part = (const char *)&r.b + pik_board.parts[2].offset;
    uint32_t plus;
    memcpy(&plus, part + pik_board.parts[2].counters[0].offset, sizeof plus);
    assert_in_range(plus, 49, 53);
    assert_in_range(r.b.latched.total[0] - r.b.latched.total[1], 4, 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_reading_goes_out_in_three_frames),
        cmocka_unit_test(objects),
        cmocka_unit_test(saturation_is_an_emergency),
        cmocka_unit_test(digest_is_of_the_state_not_of_who_looks),
        cmocka_unit_test(what_the_table_says),
        cmocka_unit_test(faults_of_parts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

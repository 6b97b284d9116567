/* A unit whose CAN controller or power fails, as a host on the bus sees it. */
#include "base/can/fault.h"
#include "base/rng.h"
#include "board/psa2/board.h"
#include "unit/unit.h"

#include "rig.h"

#include <string.h>

enum { NODE = 5, SEEN_MAX = 8192, BIT_NS = 1000 };
enum { SDO_WRITE_U8 = 0x2F, SDO_READ = 0x40, FRAME_FORM = 0x2020, FAST = 1 };

struct seen {
    struct can_msg m;
    int64_t t_ns;
};

struct bench {
    struct sched s;
    struct lab lab;
    struct unit unit;
    struct can_bus bus;
    struct psa2_can can;
    struct can_node host;
    struct seen seen[SEEN_MAX];
    unsigned count;
};

static struct bench bench;

static void on_any(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct bench *r = ctx;
    if (r->count < SEEN_MAX) r->seen[r->count++] = (struct seen){*m, t_ns};
}

static void run(struct bench *r, int64_t ns)
{
    sched_run_until(&r->s, r->s.now_ns + ns);
}

static void host_sends(struct bench *r, uint32_t id, uint8_t len, const uint8_t *data)
{
    struct can_msg m = {.id = id, .len = len};
    memcpy(m.data, data, len);
    assert_int_equal(can_send(&r->bus, &r->host, &m, r->s.now_ns), CAN_OK);
}

static void start(struct bench *r)
{
    host_sends(r, 0, 2, (const uint8_t[]){1, NODE});
}

static struct bench *up(void)
{
    struct bench *r = &bench;
    memset(r, 0, sizeof *r);
    struct lab_cfg world;
    memset(&world, 0, sizeof world);
    world.site.g_mps2 = 9.8;
    struct unit_cfg cfg = unit_default("a");
    cfg.node = NODE;
    sched_init(&r->s);
    lab_init(&r->lab, &world, 1);
    unit_init(&r->unit, &cfg, &r->lab, &r->s);
    can_bus_init(&r->bus, &(struct can_bus_cfg){.bitrate_hz = 1000000}, &r->s);
    const struct psa2_can_port port = psa2_can_port(&r->unit.store.psa2);
    psa2_can_init(&r->can, &(struct board_can_cfg){.name = "a", .type = &psa2_board, .node_id = NODE}, &port, &r->bus,
                  &r->s);
    r->unit.store.psa2.host = (struct psa2_host){.ctx = &r->can, .frame = psa2_can_frame, .fault = psa2_can_fault};
    r->host = (struct can_node){.name = "host", .rx = on_any, .error = on_any, .ctx = r};
    can_attach(&r->bus, &r->host);
    psa2_power_up(&r->unit.store.psa2, 0);
    board_node_power_up(&r->can, 0);
    run(r, 1000000);
    start(r);
    run(r, 200000000);
    return r;
}

/* Messages of an identifier (error: any class) from `from` on. */
static unsigned seen(const struct bench *r, uint32_t id, unsigned from)
{
    unsigned n = 0;
    for (unsigned i = from; i < r->count; i++) n += r->seen[i].m.id == id && !(r->seen[i].m.flags & CAN_ERROR);
    return n;
}

static unsigned errors(const struct bench *r, unsigned from)
{
    unsigned n = 0;
    for (unsigned i = from; i < r->count; i++) n += (r->seen[i].m.flags & CAN_ERROR) != 0;
    return n;
}

/* Place of an EMCY with that code. */
static unsigned emcy(const struct bench *r, uint16_t code, unsigned from)
{
    for (unsigned i = from; i < r->count; i++) {
        const struct can_msg *m = &r->seen[i].m;
        if (m->id == 0x80 + NODE && !(m->flags & CAN_ERROR) && (m->data[0] | m->data[1] << 8) == code) return i;
    }
    fail_msg("no EMCY %04X", code);
    return 0;
}

static void without_power_the_unit_is_off_the_bus_and_forgets(void **state)
{
    (void)state;
    struct bench *r = up();
    host_sends(r, 0x600 + NODE, 8,
               (const uint8_t[]){SDO_WRITE_U8, FRAME_FORM & 0xFF, FRAME_FORM >> 8, 0, FAST, 0, 0, 0});
    run(r, 10000000);
    assert_int_equal(r->can.set.form, FAST);
    assert_true(seen(r, 0x380 + NODE, 0) > 5);
    run(r, 300000); /* away from a frame */
    psa2_power_down(&r->unit.store.psa2, r->s.now_ns);
    psa2_can_power_down(&r->can);
    const unsigned from = r->count;
    start(r);
    run(r, 100000000);
    assert_int_equal(r->count, from);
    psa2_power_up(&r->unit.store.psa2, r->s.now_ns);
    board_node_power_up(&r->can, r->s.now_ns);
    run(r, 1000000);
    assert_int_equal(seen(r, 0x700 + NODE, from), 1); /* boot-up */
    start(r);
    run(r, 200000000);
    assert_int_equal(seen(r, 0x380 + NODE, from), 0);
    assert_true(seen(r, 0x180 + NODE, from) >= 10); /* the default form, a pair */
    assert_int_equal(seen(r, 0x80 + NODE, 0), 0);
}

static void a_request_under_way_dies_with_the_power(void **state)
{
    (void)state;
    for (int order = 0; order < 2; order++) {
        struct bench *r = up();
        host_sends(r, 0x600 + NODE, 8, (const uint8_t[]){SDO_READ, 0x01, 0x20, 1, 0, 0, 0, 0});
        while (!r->can.request_busy) sched_run_until(&r->s, sched_next_ns(&r->s));
        if (order) psa2_can_power_down(&r->can);
        psa2_power_down(&r->unit.store.psa2, r->s.now_ns);
        if (!order) psa2_can_power_down(&r->can);
        const unsigned from = r->count;
        run(r, 10000000);
        assert_false(r->can.request_busy);
        psa2_power_up(&r->unit.store.psa2, r->s.now_ns);
        board_node_power_up(&r->can, r->s.now_ns);
        run(r, 200000000);
        assert_int_equal(seen(r, 0x80 + NODE, from), 0); /* no EMCY of the old life */
        assert_int_equal(seen(r, 0x580 + NODE, from), 0);
        host_sends(r, 0x600 + NODE, 8, (const uint8_t[]){SDO_READ, 0x01, 0x20, 1, 0, 0, 0, 0});
        run(r, 50000000);
        assert_int_equal(seen(r, 0x580 + NODE, from), 1);
    }
}

static void a_frame_on_the_wire_breaks_off_with_the_power(void **state)
{
    (void)state;
    struct bench *r = up();
    while (r->bus.phase != CAN_FRAME || r->bus.sender != &r->can.node.node.stream)
        sched_run_until(&r->s, sched_next_ns(&r->s));
    run(r, 20000);
    const unsigned from = r->count;
    psa2_power_down(&r->unit.store.psa2, r->s.now_ns);
    psa2_can_power_down(&r->can);
    run(r, 10000000);
    assert_int_equal(errors(r, from), 1);
    assert_int_equal(r->count, from + 1);
    assert_int_equal(r->bus.error_frames, 1);
}

static void a_unit_that_comes_back_from_bus_off_says_so(void **state)
{
    (void)state;
    struct bench *r = up();
    run(r, 300000);
    const unsigned from = r->count;
    const int64_t off_ns = r->s.now_ns;
    can_bus_off(&r->bus, &r->can.node.node.stream, off_ns); /* either queue: they have one controller */
    run(r, 1407 * BIT_NS);
    assert_int_equal(r->count, from);
    run(r, 20000000);
    const unsigned back = emcy(r, PSA2_EMCY_CAN_RECOVERED, from), over = emcy(r, 0, back);
    assert_true(r->seen[back].t_ns >= off_ns + 1408 * BIT_NS);
    assert_true(r->seen[back].t_ns < off_ns + 1408 * BIT_NS + 300000); /* its samples waited, too */
    assert_int_equal(over, back + 1);
    assert_int_equal(r->seen[back].m.data[2], 0x11);
    assert_true(seen(r, 0x180 + NODE, from) >= 18); /* nothing of 20 ms is lost but what the queue could not hold */
}

static void an_error_passive_unit_says_so_and_when_it_is_over(void **state)
{
    (void)state;
    struct bench *r = up();
    can_bus_off(&r->bus, &r->can.node.node.services, r->s.now_ns);
    run(r, 20000000);
    struct can_fault f = {.kind = CAN_FAULT_ERROR,
                          .from = &r->can.node.node.services,
                          .probability = 1.0,
                          .limit = 18,
                          .rng = rng_stream(1, 1, "fault")};
    const unsigned from = r->count;
    can_fault_add(&r->bus, &f);
    run(r, 100000000);
    assert_int_equal(r->bus.error_frames, 18);
    for (unsigned i = from; i < r->count; i++) /* that was long ago */
        assert_false(r->seen[i].m.id == 0x80 + NODE && r->seen[i].m.data[0] == 0x40);
    const unsigned passive = emcy(r, PSA2_EMCY_CAN_PASSIVE, from), over = emcy(r, 0, passive);
    assert_true(over > passive + 10); /* a frame that passes gives back one of 16 */
    assert_true(errors(r, from) >= 18);
    run(r, 100000000);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
    assert_int_equal(r->can.node.node.services.tec, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_power_the_unit_is_off_the_bus_and_forgets),
        cmocka_unit_test(a_request_under_way_dies_with_the_power),
        cmocka_unit_test(a_frame_on_the_wire_breaks_off_with_the_power),
        cmocka_unit_test(a_unit_that_comes_back_from_bus_off_says_so),
        cmocka_unit_test(an_error_passive_unit_says_so_and_when_it_is_over),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* Faults of the bus: frames that are lost, doubled, late, changed or destroyed, error counters, bus-off. */
#include "base/can.h"
#include "base/canbits.h"

#include "rig.h"

#include <string.h>

enum { LOG_MAX = 1024, BIT_NS = 2000 }; /* 500 kbit/s */

struct got {
    char who, what; /* r: received, s: sent, e: error message, a p o: state */
    struct can_msg m;
    int64_t t_ns;
};

struct bench;
struct station {
    struct bench *bench;
    char name;
    struct can_node node;
};

struct bench {
    struct sched s;
    struct can_bus bus;
    struct station a, b, c, second; /* second: another queue of a's controller */
    struct got log[LOG_MAX];
    unsigned logged;
};

static struct bench bench;

static void note(struct station *st, char what, const struct can_msg *m, int64_t t_ns)
{
    struct bench *r = st->bench;
    if (r->logged < LOG_MAX) r->log[r->logged++] = (struct got){st->name, what, m ? *m : (struct can_msg){0}, t_ns};
}

static void on_rx(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    note(ctx, 'r', m, t_ns);
}

static void on_sent(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    note(ctx, 's', m, t_ns);
}

static void on_error(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    assert_true(m->flags & CAN_ERROR);
    assert_int_equal(m->len, 8);
    note(ctx, 'e', m, t_ns);
}

static void on_state(void *ctx, enum can_state s, int64_t t_ns)
{
    note(ctx, "apo"[s], NULL, t_ns);
}

static void join(struct bench *r, struct station *st, char name, struct can_node *of)
{
    st->bench = r;
    st->name = name;
    st->node = (struct can_node){
        .name = "x", .rx = on_rx, .sent = on_sent, .error = on_error, .state = on_state, .of = of, .ctx = st};
    can_attach(&r->bus, &st->node);
}

static struct bench *up(uint32_t bitrate_hz)
{
    struct bench *r = &bench;
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    can_bus_init(&r->bus, &(struct can_bus_cfg){.bitrate_hz = bitrate_hz}, &r->s);
    join(r, &r->a, 'A', NULL);
    join(r, &r->second, 'S', &r->a.node);
    join(r, &r->b, 'B', NULL);
    join(r, &r->c, 'C', NULL);
    return r;
}

static struct can_fault fault(enum can_fault_kind kind)
{
    return (struct can_fault){.kind = kind, .probability = 1.0, .rng = rng_stream(1, 1, "fault")};
}

static struct can_msg frame(uint32_t id)
{
    return (struct can_msg){.id = id, .len = 8, .data = {1, 2, 3, 4, 5, 6, 7, (uint8_t)id}};
}

static void send(struct bench *r, struct station *st, uint32_t id)
{
    const struct can_msg m = frame(id);
    assert_int_equal(can_send(&r->bus, &st->node, &m, r->s.now_ns), CAN_OK);
}

static void run(struct bench *r, int64_t ns)
{
    sched_run_until(&r->s, r->s.now_ns + ns);
}

static unsigned count(const struct bench *r, char who, char what)
{
    unsigned n = 0;
    for (unsigned i = 0; i < r->logged; i++) n += r->log[i].who == who && r->log[i].what == what;
    return n;
}

/* The k-th of its kind, from 0. */
static const struct got *entry(const struct bench *r, char who, char what, unsigned k)
{
    for (unsigned i = 0; i < r->logged; i++)
        if (r->log[i].who == who && r->log[i].what == what && k-- == 0) return &r->log[i];
    fail_msg("no %c %c", who, what);
    return NULL;
}

static int64_t frame_ns(uint32_t id)
{
    const struct can_msg m = frame(id);
    return can_frame_ns(&bench.bus.cfg, &m);
}

/* ---- links and gateways ---- */

static void a_dropped_frame_is_sent_but_nobody_receives_it(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault f = fault(CAN_FAULT_DROP);
    f.limit = 1;
    can_fault_add(&r->bus, &f);
    send(r, &r->a, 0x100);
    send(r, &r->a, 0x101);
    run(r, 10000000);
    assert_int_equal(count(r, 'A', 's'), 2);
    assert_int_equal(count(r, 'B', 'r'), 1);
    assert_int_equal(entry(r, 'B', 'r', 0)->m.id, 0x101);
    assert_int_equal(f.hits, 1);
    assert_int_equal(r->a.node.tx_frames, 2);
}

static void a_fault_picks_by_sender_receiver_and_identifier(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault of_a = fault(CAN_FAULT_DROP), to_c = fault(CAN_FAULT_DROP), of_id = fault(CAN_FAULT_DROP);
    of_a.from = &r->a.node; /* and of the second queue of its controller */
    to_c.to = &r->c.node;
    of_id.id = 0x30;
    of_id.mask = 0x7F0;
    can_fault_add(&r->bus, &of_a);
    send(r, &r->a, 0x10);
    send(r, &r->second, 0x11);
    send(r, &r->b, 0x12);
    run(r, 10000000);
    assert_int_equal(count(r, 'C', 'r'), 1);
    assert_int_equal(entry(r, 'C', 'r', 0)->m.id, 0x12);
    can_fault_remove(&r->bus, &of_a, r->s.now_ns);
    can_fault_add(&r->bus, &to_c);
    send(r, &r->a, 0x13);
    run(r, 10000000);
    assert_int_equal(count(r, 'C', 'r'), 1);
    assert_int_equal(count(r, 'B', 'r'), 1);
    can_fault_remove(&r->bus, &to_c, r->s.now_ns);
    can_fault_add(&r->bus, &of_id);
    send(r, &r->a, 0x3F);
    send(r, &r->a, 0x40);
    run(r, 10000000);
    assert_int_equal(count(r, 'B', 'r'), 2);
    assert_int_equal(entry(r, 'B', 'r', 1)->m.id, 0x40);
    can_fault_remove(&r->bus, &of_id, r->s.now_ns);
    assert_false(r->bus.odd);
}

static void a_doubled_frame_takes_the_wire_twice(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault f = fault(CAN_FAULT_DUPLICATE);
    can_fault_add(&r->bus, &f);
    send(r, &r->a, 0x100);
    run(r, 10000000);
    assert_int_equal(count(r, 'B', 'r'), 2);
    assert_int_equal(count(r, 'A', 's'), 1); /* the sender's program knows of one */
    assert_int_equal(r->a.node.tx_frames, 1);
    assert_int_equal(entry(r, 'B', 'r', 1)->t_ns - entry(r, 'B', 'r', 0)->t_ns, frame_ns(0x100));
    f.limit = 1; /* over */
    send(r, &r->a, 0x101);
    run(r, 10000000);
    assert_int_equal(count(r, 'B', 'r'), 3);
    f.limit = 0;
    f.to = &r->b.node; /* a driver that hands it over twice */
    send(r, &r->a, 0x102);
    run(r, 10000000);
    assert_int_equal(count(r, 'B', 'r'), 5);
    assert_int_equal(count(r, 'C', 'r'), 4);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
}

static void a_late_frame_is_received_after_its_delay(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault f = fault(CAN_FAULT_DELAY);
    f.delay_ns = 5000000;
    f.limit = 2;
    can_fault_add(&r->bus, &f);
    send(r, &r->a, 0x100);
    run(r, 1000000);
    send(r, &r->a, 0x101);
    run(r, 1000000);
    send(r, &r->a, 0x102);
    run(r, 20000000);
    const int64_t end_ns = frame_ns(0x100) - 3 * BIT_NS;
    assert_int_equal(count(r, 'B', 'r'), 3);
    assert_int_equal(count(r, 'A', 'r'), 0); /* not its own */
    assert_int_equal(entry(r, 'B', 'r', 0)->m.id, 0x102);
    assert_int_equal(entry(r, 'B', 'r', 1)->t_ns, end_ns + 5000000);
    assert_int_equal(entry(r, 'B', 'r', 2)->m.id, 0x101);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
    assert_int_equal(count(r, 'B', 'r'), 3);
}

static void what_a_removed_fault_holds_is_received(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault f = fault(CAN_FAULT_DELAY);
    f.delay_ns = 50000000;
    can_fault_add(&r->bus, &f);
    send(r, &r->a, 0x100);
    run(r, 10000000);
    assert_int_equal(count(r, 'B', 'r'), 0);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
    assert_int_equal(count(r, 'B', 'r'), 1);
    run(r, 100000000);
    assert_int_equal(count(r, 'B', 'r'), 1);
}

static void frames_that_find_no_room_to_wait_are_counted(void **state)
{
    (void)state;
    struct bench *r = up(0);
    struct can_fault f = fault(CAN_FAULT_DELAY);
    f.delay_ns = 1000000;
    can_fault_add(&r->bus, &f);
    for (unsigned i = 0; i < CAN_HELD_MAX + 3; i++) send(r, &r->a, 0x100 + i);
    run(r, 2000000);
    assert_int_equal(count(r, 'B', 'r'), CAN_HELD_MAX);
    assert_int_equal(f.lost, 3);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
}

static void two_frames_change_places(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault f = fault(CAN_FAULT_REORDER);
    f.limit = 1;
    can_fault_add(&r->bus, &f);
    for (uint32_t i = 0; i < 3; i++) send(r, &r->a, 0x100 + i);
    run(r, 10000000);
    assert_int_equal(entry(r, 'B', 'r', 0)->m.id, 0x101);
    assert_int_equal(entry(r, 'B', 'r', 1)->m.id, 0x100);
    assert_int_equal(entry(r, 'B', 'r', 1)->t_ns, entry(r, 'B', 'r', 0)->t_ns);
    assert_int_equal(entry(r, 'B', 'r', 2)->m.id, 0x102);
    f.limit = 0;
    f.delay_ns = 3000000; /* no other comes in time */
    send(r, &r->a, 0x103);
    run(r, 2000000);
    assert_int_equal(count(r, 'B', 'r'), 3);
    run(r, 2000000);
    assert_int_equal(count(r, 'B', 'r'), 4);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
}

static void frames_change_places_two_by_two(void **state)
{
    (void)state;
    static const uint32_t want[] = {0x101, 0x100, 0x103, 0x102};
    struct bench *r = up(500000);
    struct can_fault f = fault(CAN_FAULT_REORDER);
    can_fault_add(&r->bus, &f);
    for (uint32_t i = 0; i < 5; i++) send(r, &r->a, 0x100 + i);
    run(r, 10000000);
    assert_int_equal(count(r, 'B', 'r'), 4);
    for (unsigned i = 0; i < 4; i++) assert_int_equal(entry(r, 'B', 'r', i)->m.id, want[i]);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
    assert_int_equal(count(r, 'B', 'r'), 5);
}

static void a_changed_frame_differs_in_one_bit(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault f = fault(CAN_FAULT_ALTER);
    can_fault_add(&r->bus, &f);
    bool differ = false;
    for (unsigned k = 0; k < 8; k++) {
        send(r, &r->a, 0x100);
        run(r, 1000000);
        const struct can_msg want = frame(0x100), *got = &entry(r, 'B', 'r', k)->m;
        unsigned bits = 0;
        for (unsigned i = 0; i < 8; i++) bits += (unsigned)__builtin_popcount(got->data[i] ^ want.data[i]);
        assert_int_equal(bits, 1);
        assert_int_equal(got->id, want.id);
        assert_memory_equal(got->data, entry(r, 'C', 'r', k)->m.data, 8); /* all see the same */
        differ |= k > 0 && memcmp(got->data, entry(r, 'B', 'r', k - 1)->m.data, 8) != 0;
    }
    assert_true(differ);
    assert_int_equal(r->bus.error_frames, 0);
    const struct can_msg empty = {.id = 0x55};
    assert_int_equal(can_send(&r->bus, &r->a.node, &empty, r->s.now_ns), CAN_OK);
    run(r, 1000000);
    assert_int_equal(f.hits, 8); /* nothing there to change */
    can_fault_remove(&r->bus, &f, r->s.now_ns);
}

static void a_probability_hits_its_share_and_a_seed_the_same_frames(void **state)
{
    (void)state;
    uint32_t hits[2];
    uint32_t first[2];
    for (int k = 0; k < 2; k++) {
        struct bench *r = up(0);
        struct can_fault f = fault(CAN_FAULT_DROP);
        f.probability = 0.25;
        can_fault_add(&r->bus, &f);
        first[k] = 0;
        for (unsigned i = 0; i < 1000; i++) {
            send(r, &r->a, 0x100);
            run(r, 1000);
            if (i < 32) first[k] = first[k] << 1 | (f.hits & 1);
        }
        hits[k] = f.hits;
        can_fault_remove(&r->bus, &f, r->s.now_ns);
    }
    assert_in_range(hits[0], 200, 300); /* 250 +- 3.6 standard deviations */
    assert_int_equal(hits[0], hits[1]);
    assert_int_equal(first[0], first[1]);
}

/* ---- errors on the wire ---- */

static void a_destroyed_frame_is_sent_again(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault f = fault(CAN_FAULT_ERROR);
    f.limit = 1;
    can_fault_add(&r->bus, &f);
    send(r, &r->a, 0x100);
    run(r, 10000000);
    assert_int_equal(r->bus.error_frames, 1);
    assert_int_equal(count(r, 'B', 'r'), 1);
    assert_int_equal(count(r, 'B', 'e'), 1);
    assert_int_equal(count(r, 'A', 'e'), 1);
    const struct got *e = entry(r, 'B', 'e', 0), *own = entry(r, 'A', 'e', 0);
    assert_int_equal(e->m.id, CAN_CLASS_PROTOCOL | CAN_CLASS_BUS_ERROR | 0x200);
    assert_int_equal(e->m.data[2], 0x04);
    assert_int_equal(e->m.data[7], 1); /* ISO 11898-1: receivers 1, the sender 8 */
    assert_int_equal(own->m.data[2], 0x81);
    assert_int_equal(own->m.data[6], 8);
    assert_true(entry(r, 'B', 'r', 0)->t_ns == e->t_ns + frame_ns(0x100)); /* 3 bits, the frame without its 3 */
    assert_true(e->t_ns >= frame_ns(0x100) / 8 + 20 * BIT_NS && e->t_ns <= frame_ns(0x100) + 20 * BIT_NS);
    assert_int_equal(r->a.node.tec, 7); /* the frame that passed gave 1 back */
    assert_int_equal(r->b.node.rec, 0);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
    assert_true(r->bus.odd);
    for (unsigned i = 0; i < 7; i++) send(r, &r->a, 0x101);
    run(r, 10000000);
    assert_int_equal(r->a.node.tec, 0);
    assert_false(r->bus.odd);
}

/* 16 errors: 128, error-passive; 32: 256, off the bus; 128 x 11 bits: back, and what has waited goes. */
static void a_node_whose_frames_all_fail_leaves_the_bus_and_comes_back(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault f = fault(CAN_FAULT_ERROR);
    f.from = &r->a.node;
    f.limit = 32;
    can_fault_add(&r->bus, &f);
    send(r, &r->second, 0x100); /* the other queue of the same controller */
    run(r, 30000000);
    assert_int_equal(r->bus.error_frames, 32);
    assert_int_equal(count(r, 'A', 'p'), 1);
    assert_int_equal(count(r, 'A', 'o'), 1);
    assert_int_equal(count(r, 'S', 'o'), 1);
    assert_int_equal(entry(r, 'A', 'o', 0)->t_ns, entry(r, 'B', 'e', 31)->t_ns);
    assert_int_equal(count(r, 'A', 'a'), 1);
    assert_int_equal(entry(r, 'A', 'a', 0)->t_ns, entry(r, 'A', 'o', 0)->t_ns + INT64_C(1408) * BIT_NS);
    assert_int_equal(count(r, 'B', 'r'), 1);
    assert_int_equal(entry(r, 'B', 'r', 0)->t_ns, entry(r, 'A', 'a', 0)->t_ns + frame_ns(0x100) - 3 * BIT_NS);
    assert_int_equal(r->a.node.tec, 0);
    assert_int_equal(can_controller(&r->second.node)->now, CAN_ACTIVE);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
}

static void the_states_are_told_in_classes_of_the_kernel(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault f = fault(CAN_FAULT_ERROR);
    f.limit = 32;
    f.from = &r->a.node;
    can_fault_add(&r->bus, &f);
    send(r, &r->a, 0x100);
    run(r, 30000000);
    uint32_t seen = 0;
    for (unsigned k = 0; k < count(r, 'A', 'e'); k++) {
        const struct can_msg *m = &entry(r, 'A', 'e', k)->m;
        seen |= m->id;
        if (m->id == (CAN_CLASS_CONTROLLER | 0x200)) assert_int_equal(m->data[1], 0x20);
        if (m->id == (CAN_CLASS_CONTROLLER | 0x200)) assert_int_equal(m->data[6], 128);
        if (m->id == (CAN_CLASS_RESTARTED | 0x200)) assert_int_equal(m->data[1], 0x40);
    }
    assert_int_equal(seen, 0x200 | CAN_CLASS_CONTROLLER | CAN_CLASS_PROTOCOL | CAN_CLASS_BUS_ERROR | CAN_CLASS_BUS_OFF |
                               CAN_CLASS_RESTARTED);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
}

static void an_error_passive_sender_waits_eight_bits_more(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault f = fault(CAN_FAULT_ERROR);
    f.limit = 17;
    can_fault_add(&r->bus, &f);
    send(r, &r->a, 0x100);
    run(r, 20000000);
    assert_int_equal(r->a.node.now, CAN_PASSIVE);
    const int64_t last_ns = entry(r, 'B', 'e', 16)->t_ns;
    assert_int_equal(entry(r, 'B', 'r', 0)->t_ns, last_ns + frame_ns(0x100) + 8 * BIT_NS);
    r->logged = 0;
    send(r, &r->a, 0x100);
    send(r, &r->a, 0x101);
    send(r, &r->b, 0x200); /* gets in between, though a's is more urgent */
    run(r, 20000000);
    assert_int_equal(entry(r, 'C', 'r', 0)->m.id, 0x100);
    assert_int_equal(entry(r, 'C', 'r', 1)->m.id, 0x200);
    assert_int_equal(entry(r, 'C', 'r', 2)->m.id, 0x101);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
}

static void bus_off_counts_eleven_bits_at_each_end_of_a_frame(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    send(r, &r->a, 0x300);
    run(r, 1000);
    can_bus_off(&r->bus, &r->b.node, r->s.now_ns);
    assert_int_equal(r->b.node.now, CAN_BUS_OFF);
    for (unsigned i = 0; i < 100; i++) send(r, &r->c, 0x100);
    send(r, &r->b, 0x050);
    run(r, 60000000);
    assert_int_equal(count(r, 'B', 'r'), 0); /* deaf */
    /* 101 frames without a gap, each worth one, then idle */
    const int64_t idle_ns = entry(r, 'A', 'r', 99)->t_ns + 3 * BIT_NS;
    assert_int_equal(entry(r, 'B', 'a', 0)->t_ns, idle_ns + (128 - 101) * 11 * BIT_NS);
    assert_int_equal(entry(r, 'C', 'r', 1)->m.id, 0x050);
}

static void a_sender_that_goes_off_the_bus_breaks_its_frame(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    send(r, &r->a, 0x300);
    run(r, 50000);
    can_bus_off(&r->bus, &r->a.node, r->s.now_ns);
    run(r, 1000000);
    assert_int_equal(count(r, 'B', 'r'), 0);
    assert_int_equal(entry(r, 'B', 'e', 0)->t_ns, 50000 + 20 * BIT_NS);
    run(r, 5000000);
    assert_int_equal(count(r, 'B', 'r'), 1); /* after all */
    assert_int_equal(r->a.node.now, CAN_ACTIVE);
}

static void a_sender_without_power_breaks_its_frame(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    send(r, &r->a, 0x300);
    send(r, &r->a, 0x301);
    run(r, 50000);
    can_unplug(&r->bus, &r->a.node, r->s.now_ns);
    run(r, 5000000);
    assert_int_equal(count(r, 'B', 'r'), 0);
    assert_int_equal(entry(r, 'B', 'e', 0)->t_ns, 50000 + 20 * BIT_NS);
    assert_int_equal(r->b.node.rec, 1);
    send(r, &r->c, 0x302);
    send(r, &r->b, 0x303);
    run(r, 5000000);
    assert_int_equal(count(r, 'B', 'r'), 1);
    assert_false(r->bus.odd);
}

static void an_ideal_bus_has_no_error_frames_but_bus_off(void **state)
{
    (void)state;
    struct bench *r = up(0);
    struct can_fault f = fault(CAN_FAULT_ERROR);
    can_fault_add(&r->bus, &f);
    send(r, &r->a, 0x100);
    run(r, 1000);
    assert_int_equal(count(r, 'B', 'r'), 1);
    assert_int_equal(f.hits, 0);
    can_bus_off(&r->bus, &r->a.node, r->s.now_ns);
    send(r, &r->a, 0x101);
    run(r, 1407000);
    assert_int_equal(count(r, 'B', 'r'), 1);
    run(r, 1000);
    assert_int_equal(count(r, 'B', 'r'), 2);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
}

static void off_now(void *ctx, int64_t t_ns)
{
    struct bench *r = ctx;
    assert_int_equal(r->bus.phase, CAN_FRAME);
    can_bus_off(&r->bus, &r->a.node, t_ns);
}

/* The frame is out before it can break, and gives nothing back to a controller that has left. */
static void on_an_ideal_bus_bus_off_comes_after_the_frame(void **state)
{
    (void)state;
    struct bench *r = up(0);
    struct sched_ev ev;
    sched_ev(&ev, off_now, r);
    send(r, &r->a, 0x100);
    sched_at(&r->s, &ev, r->s.now_ns);
    run(r, 1000);
    assert_int_equal(count(r, 'B', 'r'), 1);
    assert_int_equal(r->a.node.now, CAN_BUS_OFF);
    assert_int_equal(r->a.node.tec, 256);
}

static void a_node_that_leaves_takes_its_faults_along(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault late = fault(CAN_FAULT_DELAY), drop = fault(CAN_FAULT_DROP);
    late.delay_ns = 5000000;
    late.to = &r->c.node;
    drop.from = &r->c.node;
    can_fault_add(&r->bus, &late);
    can_fault_add(&r->bus, &drop);
    send(r, &r->a, 0x100);
    run(r, 2000000);
    can_detach(&r->bus, &r->c.node);
    can_fault_forget(&r->bus, &r->c.node);
    run(r, 10000000);
    assert_int_equal(count(r, 'C', 'r'), 0);
    send(r, &r->a, 0x101);
    run(r, 2000000);
    assert_int_equal(count(r, 'B', 'r'), 2); /* neither fault turned to everybody */
    assert_int_equal(late.held, 0);
    can_fault_remove(&r->bus, &late, r->s.now_ns);
    can_fault_remove(&r->bus, &drop, r->s.now_ns);
    assert_false(r->bus.odd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_dropped_frame_is_sent_but_nobody_receives_it),
        cmocka_unit_test(a_fault_picks_by_sender_receiver_and_identifier),
        cmocka_unit_test(a_doubled_frame_takes_the_wire_twice),
        cmocka_unit_test(a_late_frame_is_received_after_its_delay),
        cmocka_unit_test(what_a_removed_fault_holds_is_received),
        cmocka_unit_test(frames_that_find_no_room_to_wait_are_counted),
        cmocka_unit_test(two_frames_change_places),
        cmocka_unit_test(frames_change_places_two_by_two),
        cmocka_unit_test(a_changed_frame_differs_in_one_bit),
        cmocka_unit_test(a_probability_hits_its_share_and_a_seed_the_same_frames),
        cmocka_unit_test(a_destroyed_frame_is_sent_again),
        cmocka_unit_test(a_node_whose_frames_all_fail_leaves_the_bus_and_comes_back),
        cmocka_unit_test(the_states_are_told_in_classes_of_the_kernel),
        cmocka_unit_test(an_error_passive_sender_waits_eight_bits_more),
        cmocka_unit_test(bus_off_counts_eleven_bits_at_each_end_of_a_frame),
        cmocka_unit_test(a_sender_that_goes_off_the_bus_breaks_its_frame),
        cmocka_unit_test(a_sender_without_power_breaks_its_frame),
        cmocka_unit_test(an_ideal_bus_has_no_error_frames_but_bus_off),
        cmocka_unit_test(on_an_ideal_bus_bus_off_comes_after_the_frame),
        cmocka_unit_test(a_node_that_leaves_takes_its_faults_along),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

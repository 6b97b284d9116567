/* Faults of the bus: frames that are lost, doubled, late or changed. */
#include "can_fault_rig.h"

#include "base/can/bits.h"

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
    assert_false(r->bus.degraded);
}

static void a_fault_at_any_queue_is_one_at_its_controller(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault of_second = fault(CAN_FAULT_DROP);
    of_second.from = &r->second.node;
    can_fault_add(&r->bus, &of_second);
    send(r, &r->a, 0x10);
    send(r, &r->second, 0x11);
    send(r, &r->b, 0x12);
    run(r, 10000000);
    assert_int_equal(count(r, 'C', 'r'), 1);
    assert_int_equal(entry(r, 'C', 'r', 0)->m.id, 0x12);
    assert_int_equal(of_second.hits, 2);
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
    assert_false(r->bus.degraded);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_dropped_frame_is_sent_but_nobody_receives_it),
        cmocka_unit_test(a_fault_picks_by_sender_receiver_and_identifier),
        cmocka_unit_test(a_fault_at_any_queue_is_one_at_its_controller),
        cmocka_unit_test(a_doubled_frame_takes_the_wire_twice),
        cmocka_unit_test(a_late_frame_is_received_after_its_delay),
        cmocka_unit_test(what_a_removed_fault_holds_is_received),
        cmocka_unit_test(frames_that_find_no_room_to_wait_are_counted),
        cmocka_unit_test(two_frames_change_places),
        cmocka_unit_test(frames_change_places_two_by_two),
        cmocka_unit_test(a_changed_frame_differs_in_one_bit),
        cmocka_unit_test(a_probability_hits_its_share_and_a_seed_the_same_frames),
        cmocka_unit_test(a_node_that_leaves_takes_its_faults_along),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

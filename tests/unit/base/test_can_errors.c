/* Errors on the wire of the bus: destroyed frames, error counters, bus-off. */
#include "can_fault_rig.h"

#include "base/can/bits.h"

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
    assert_true(r->bus.degraded);
    for (unsigned i = 0; i < 7; i++) send(r, &r->a, 0x101);
    run(r, 10000000);
    assert_int_equal(r->a.node.tec, 0);
    assert_false(r->bus.degraded);
}

/* 12 errors: 96, error warning; 16: 128, error-passive; 32: 256, off the bus; 128 x 11 bits: back, and what has waited goes. */
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
    assert_int_equal(count(r, 'A', 'w'), 1);
    assert_int_equal(entry(r, 'A', 'w', 0)->t_ns, entry(r, 'B', 'e', 11)->t_ns);
    assert_int_equal(count(r, 'A', 'p'), 1);
    assert_int_equal(entry(r, 'A', 'p', 0)->t_ns, entry(r, 'B', 'e', 15)->t_ns);
    assert_int_equal(count(r, 'A', 'o'), 1);
    assert_int_equal(count(r, 'S', 'o'), 1);
    assert_int_equal(entry(r, 'A', 'o', 0)->t_ns, entry(r, 'B', 'e', 31)->t_ns);
    assert_int_equal(count(r, 'A', 'a'), 1);
    assert_int_equal(entry(r, 'A', 'a', 0)->t_ns, entry(r, 'A', 'o', 0)->t_ns + INT64_C(1408) * BIT_NS);
    assert_int_equal(count(r, 'B', 'r'), 1);
    assert_int_equal(entry(r, 'B', 'r', 0)->t_ns, entry(r, 'A', 'a', 0)->t_ns + frame_ns(0x100) - 3 * BIT_NS);
    assert_int_equal(r->a.node.tec, 0);
    assert_int_equal(can_controller(&r->second.node)->error_state, CAN_STATE_ERROR_ACTIVE);
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
        if (m->id == (CAN_CLASS_CONTROLLER | 0x200)) assert_int_equal(m->data[1], m->data[6] == 96 ? 0x08 : 0x20);
        if (m->id == (CAN_CLASS_CONTROLLER | 0x200)) assert_true(m->data[6] == 96 || m->data[6] == 128);
        if (m->id == (CAN_CLASS_RESTARTED | 0x200)) assert_int_equal(m->data[1], 0x40);
    }
    assert_int_equal(seen, 0x200 | CAN_CLASS_CONTROLLER | CAN_CLASS_PROTOCOL | CAN_CLASS_BUS_ERROR | CAN_CLASS_BUS_OFF |
                               CAN_CLASS_RESTARTED);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
}

/* The k-th message to this station about the state of its controller. */
static const struct can_msg *controller_message(const struct bench *r, char who, unsigned k)
{
    for (unsigned i = 0; i < count(r, who, 'e'); i++) {
        const struct can_msg *m = &entry(r, who, 'e', i)->m;
        if (m->id == (CAN_CLASS_CONTROLLER | 0x200) && k-- == 0) return m;
    }
    fail_msg("%c: no such message", who);
    return NULL;
}

static void send_some(struct bench *r, struct station *st, unsigned frames)
{
    for (unsigned i = 0; i < frames; i++) send(r, st, 0x100);
    run(r, 20000000);
}

/* A sender: 11 errors 88, 12 errors 96; a frame that passes gives 95. */
static void transmit_errors_cross_96_up_and_down(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault f = fault(CAN_FAULT_ERROR);
    f.from = &r->a.node;
    f.limit = 11;
    can_fault_add(&r->bus, &f);
    send_some(r, &r->a, 1);
    assert_int_equal(r->a.node.tec, 87);
    assert_int_equal(count(r, 'A', 'w'), 0);
    f.limit = 12;
    send_some(r, &r->a, 1); /* 95 */
    assert_int_equal(count(r, 'A', 'w'), 0);
    f.limit = 13;
    send_some(r, &r->a, 1); /* 94 + 8 = 102, 101 */
    assert_int_equal(r->a.node.error_state, CAN_STATE_ERROR_WARNING);
    assert_int_equal(count(r, 'A', 'w'), 1);
    assert_int_equal(count(r, 'S', 'w'), 1); /* the other queue of the same controller */
    assert_int_equal(controller_message(r, 'A', 0)->data[1], CAN_CONTROLLER_TX_WARNING);
    send_some(r, &r->a, 5);
    assert_int_equal(r->a.node.tec, 96);
    assert_int_equal(r->a.node.error_state, CAN_STATE_ERROR_WARNING);
    send_some(r, &r->a, 1);
    assert_int_equal(r->a.node.error_state, CAN_STATE_ERROR_ACTIVE);
    assert_int_equal(count(r, 'A', 'a'), 1);
    assert_int_equal(controller_message(r, 'A', 1)->data[1], CAN_CONTROLLER_ACTIVE);
    assert_int_equal(controller_message(r, 'A', 1)->data[6], 95);
    can_fault_remove(&r->bus, &f, r->s.now_ns);
}

/* A receiver: 95 + 1 = 96; error-passive goes back to 120, which is in warning. */
static void receive_errors_cross_96_and_end_error_passive_in_warning(void **state)
{
    (void)state;
    struct bench *r = up(500000);
    struct can_fault f = fault(CAN_FAULT_ERROR);
    f.limit = 1;
    can_fault_add(&r->bus, &f);
    r->b.node.rec = 95;
    r->c.node.rec = 127;
    send_some(r, &r->a, 1);
    assert_int_equal(controller_message(r, 'B', 0)->data[1], CAN_CONTROLLER_RX_WARNING);
    assert_int_equal(controller_message(r, 'B', 0)->data[7], 96);
    assert_int_equal(controller_message(r, 'B', 1)->data[1], CAN_CONTROLLER_ACTIVE);
    assert_int_equal(controller_message(r, 'C', 0)->data[1], CAN_CONTROLLER_RX_PASSIVE);
    assert_int_equal(controller_message(r, 'C', 1)->data[1], CAN_CONTROLLER_RX_WARNING);
    assert_int_equal(controller_message(r, 'C', 1)->data[7], 120);
    assert_int_equal(r->c.node.error_state, CAN_STATE_ERROR_WARNING);
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
    assert_int_equal(r->a.node.error_state, CAN_STATE_ERROR_PASSIVE);
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
    assert_int_equal(r->b.node.error_state, CAN_STATE_BUS_OFF);
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
    assert_int_equal(r->a.node.error_state, CAN_STATE_ERROR_ACTIVE);
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
    assert_false(r->bus.degraded);
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
    assert_int_equal(r->a.node.error_state, CAN_STATE_BUS_OFF);
    assert_int_equal(r->a.node.tec, 256);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_destroyed_frame_is_sent_again),
        cmocka_unit_test(a_node_whose_frames_all_fail_leaves_the_bus_and_comes_back),
        cmocka_unit_test(the_states_are_told_in_classes_of_the_kernel),
        cmocka_unit_test(transmit_errors_cross_96_up_and_down),
        cmocka_unit_test(receive_errors_cross_96_and_end_error_passive_in_warning),
        cmocka_unit_test(an_error_passive_sender_waits_eight_bits_more),
        cmocka_unit_test(bus_off_counts_eleven_bits_at_each_end_of_a_frame),
        cmocka_unit_test(a_sender_that_goes_off_the_bus_breaks_its_frame),
        cmocka_unit_test(a_sender_without_power_breaks_its_frame),
        cmocka_unit_test(an_ideal_bus_has_no_error_frames_but_bus_off),
        cmocka_unit_test(on_an_ideal_bus_bus_off_comes_after_the_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

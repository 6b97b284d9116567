#include "base/can/bits.h"
#include "base/can/can.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

enum { LOG_MAX = 512 };

struct got {
    char to, from; /* first letters of receiver and, for its own end of frame, 's' */
    uint32_t id;
    int64_t t_ns;
};

struct rig;
struct station {
    struct rig *rig;
    struct can_node node;
    uint32_t answer_id; /* not 0: answers every frame received, at most `answers` times */
    unsigned answers;
    struct station *leaves; /* whom it detaches when it receives */
};

struct rig {
    struct sched s;
    struct can_bus bus;
    struct station a, b, c;
    struct got log[LOG_MAX];
    unsigned logged;
};

static void note(struct station *st, char kind, const struct can_msg *m, int64_t t_ns)
{
    struct rig *r = st->rig;
    if (r->logged < LOG_MAX) r->log[r->logged++] = (struct got){st->node.name[0], kind, m->id, t_ns};
}

static void on_rx(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct station *st = ctx;
    note(st, 'r', m, t_ns);
    if (st->answers > 0) {
        st->answers--;
        const struct can_msg answer = {.id = st->answer_id, .len = 8};
        assert_int_equal(can_send(&st->rig->bus, &st->node, &answer, t_ns), CAN_OK);
    }
    if (st->leaves) can_detach(&st->rig->bus, &st->leaves->node);
}

static void on_sent(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    note(ctx, 's', m, t_ns);
}

static void join(struct rig *r, struct station *st, const char *name)
{
    st->rig = r;
    st->node = (struct can_node){.name = name, .fd = true, .rx = on_rx, .ctx = st};
    can_attach(&r->bus, &st->node);
}

static struct rig *rig_up(struct rig *r, uint32_t bitrate_hz, uint32_t data_bitrate_hz)
{
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    const struct can_bus_cfg cfg = {bitrate_hz, data_bitrate_hz};
    can_bus_init(&r->bus, &cfg, &r->s);
    join(r, &r->a, "a");
    join(r, &r->b, "b");
    join(r, &r->c, "c");
    return r;
}

static struct rig rig;

static enum can_result send_id(struct station *st, uint32_t id)
{
    const struct can_msg m = {.id = id, .len = 8};
    return can_send(&st->rig->bus, &st->node, &m, st->rig->s.now_ns);
}

static void a_frame_reaches_the_others_at_its_end_and_not_its_sender(void **state)
{
    (void)state;
    struct rig *r = rig_up(&rig, 1000000, 0);
    r->a.node.sent = on_sent;
    send_id(&r->a, 0x185); /* 124 bits with interframe space (test_canbits) */
    sched_run_until(&r->s, 120999);
    assert_int_equal(r->logged, 0);
    sched_run_until(&r->s, 121000);
    assert_int_equal(r->logged, 3);
    assert_int_equal(r->log[0].from, 's');
    assert_int_equal(r->log[1].to, 'b');
    assert_int_equal(r->log[2].to, 'c');
    assert_int_equal(r->log[2].t_ns, 121000);
    assert_int_equal(r->a.node.rx_frames, 0);
    assert_int_equal(r->b.node.rx_frames, 1);
    assert_int_equal(r->a.node.tx_frames, 1);
}

static void lowest_identifier_of_one_instant_wins_whoever_spoke_first(void **state)
{
    (void)state;
    struct rig *r = rig_up(&rig, 1000000, 0);
    send_id(&r->a, 0x285);
    send_id(&r->b, 0x085);
    send_id(&r->c, 0x185);
    sched_run_until(&r->s, 1000000);
    static const uint32_t want[] = {0x085, 0x085, 0x185, 0x185, 0x285, 0x285};
    assert_int_equal(r->logged, 6);
    for (unsigned i = 0; i < 6; i++) assert_int_equal(r->log[i].id, want[i]);
}

/* ISO 11898-1: SRR and IDE of an extended frame are recessive, RTR of a remote frame too. */
static void arbitration_field_orders_base_extended_and_remote_frames(void **state)
{
    (void)state;
    static const struct can_msg order[] = {
        {.id = 0x000},
        {.id = 0x123},
        {.id = 0x123, .flags = CAN_RTR},
        {.id = 0x123u << 18, .flags = CAN_EXT},
        {.id = 0x123u << 18, .flags = CAN_EXT | CAN_RTR},
        {.id = 0x123u << 18 | 1u, .flags = CAN_EXT},
        {.id = 0x124},
        {.id = 0x1FFFFFFF, .flags = CAN_EXT},
    };
    for (size_t i = 1; i < sizeof order / sizeof order[0]; i++) {
        assert_true(can_arbitration(&order[i - 1]) < can_arbitration(&order[i]));
    }
}

static void a_frame_on_the_wire_is_not_interrupted(void **state)
{
    (void)state;
    struct rig *r = rig_up(&rig, 1000000, 0);
    send_id(&r->a, 0x700);
    sched_run_until(&r->s, 10000);
    send_id(&r->b, 0x001);
    sched_run_until(&r->s, 1000000);
    assert_int_equal(r->log[0].id, 0x700);
    assert_int_equal(r->log[2].id, 0x001);
}

static void own_frames_go_by_identifier_or_in_order_as_the_node_says(void **state)
{
    (void)state;
    static const struct {
        enum can_order order;
        uint32_t want[4];
    } row[] = {
        {CAN_ORDER_PRIORITY, {0x100, 0x200, 0x200, 0x300}},
        {CAN_ORDER_FIFO, {0x200, 0x300, 0x100, 0x200}},
    };
    for (unsigned k = 0; k < 2; k++) {
        struct rig *r = rig_up(&rig, 1000000, 0);
        r->a.node.order = row[k].order;
        send_id(&r->a, 0x200);
        send_id(&r->a, 0x300);
        send_id(&r->a, 0x100);
        send_id(&r->a, 0x200);
        sched_run_until(&r->s, 1000000);
        assert_int_equal(r->logged, 8);
        for (unsigned i = 0; i < 4; i++) assert_int_equal(r->log[2 * i].id, row[k].want[i]);
    }
}

static void an_answer_waits_for_the_interframe_space(void **state)
{
    (void)state;
    struct rig *r = rig_up(&rig, 500000, 0);
    r->b.answer_id = 0x185;
    r->b.answers = 1;
    send_id(&r->a, 0x185);
    sched_run_until(&r->s, 2 * 124 * 2000 - 6000 - 1);
    assert_int_equal(r->logged, 2);
    sched_run_until(&r->s, 2 * 124 * 2000 - 6000);
    assert_int_equal(r->logged, 4);
}

static void an_ideal_bus_keeps_order_and_takes_no_time(void **state)
{
    (void)state;
    struct rig *r = rig_up(&rig, 0, 0);
    r->b.answer_id = 0x001;
    r->b.answers = 1;
    send_id(&r->a, 0x300);
    send_id(&r->c, 0x200);
    assert_int_equal(r->logged, 0); /* not from inside can_send() */
    sched_run_until(&r->s, 0);
    static const uint32_t want[] = {0x300, 0x300, 0x200, 0x200, 0x001, 0x001};
    assert_int_equal(r->logged, 6);
    for (unsigned i = 0; i < 6; i++) assert_int_equal(r->log[i].id, want[i]);
    assert_int_equal(r->bus.busy_ns, 0);
}

static void a_full_queue_is_refused_and_counted(void **state)
{
    (void)state;
    struct rig *r = rig_up(&rig, 1000000, 0);
    for (unsigned i = 0; i < CAN_QUEUE_MAX; i++) assert_int_equal(send_id(&r->a, 0x10), CAN_OK);
    assert_int_equal(can_room(&r->a.node), 0);
    assert_int_equal(send_id(&r->a, 0x10), CAN_FULL);
    assert_int_equal(r->a.node.tx_overflow, 1);
    sched_run_until(&r->s, NS_PER_S);
    assert_int_equal(r->a.node.tx_frames, CAN_QUEUE_MAX);
    assert_int_equal(can_room(&r->a.node), CAN_QUEUE_MAX);
}

static void only_frames_that_a_controller_could_send_are_taken(void **state)
{
    (void)state;
    static const struct {
        struct can_msg m;
        uint32_t data_bitrate_hz;
        enum can_result want;
    } row[] = {
        {{.id = 0x7FF, .len = 8}, 0, CAN_OK},
        {{.id = 0x800, .len = 8}, 0, CAN_BAD},
        {{.id = 0x800, .len = 8, .flags = CAN_EXT}, 0, CAN_OK},
        {{.id = 0x20000000, .flags = CAN_EXT}, 0, CAN_BAD},
        {{.id = 1, .len = 9}, 0, CAN_BAD},
        {{.id = 1, .len = 8, .flags = CAN_BRS}, 0, CAN_BAD},
        {{.id = 1, .len = 8, .flags = CAN_RTR}, 0, CAN_OK},
        {{.id = 1, .len = 8, .flags = CAN_ERROR}, 0, CAN_BAD},
        {{.id = 1, .len = 16, .flags = CAN_FD}, 0, CAN_NO_FD},
        {{.id = 1, .len = 16, .flags = CAN_FD}, 5000000, CAN_OK},
        {{.id = 1, .len = 64, .flags = CAN_FD | CAN_BRS}, 5000000, CAN_OK},
        {{.id = 1, .len = 13, .flags = CAN_FD}, 5000000, CAN_BAD},
        {{.id = 1, .len = 40, .flags = CAN_FD}, 5000000, CAN_BAD},
        {{.id = 1, .len = 80, .flags = CAN_FD}, 5000000, CAN_BAD},
        {{.id = 1, .len = 8, .flags = CAN_FD | CAN_RTR}, 5000000, CAN_BAD},
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct rig *r = rig_up(&rig, 1000000, row[i].data_bitrate_hz);
        assert_int_equal(can_send(&r->bus, &r->a.node, &row[i].m, 0), row[i].want);
    }
}

static void a_classic_node_is_spared_fd_frames_and_counts_them(void **state)
{
    (void)state;
    struct rig *r = rig_up(&rig, 1000000, 5000000);
    r->b.node.fd = false;
    const struct can_msg m = {.id = 0x205, .len = 16, .flags = CAN_FD | CAN_BRS};
    assert_int_equal(can_send(&r->bus, &r->b.node, &m, 0), CAN_NO_FD);
    assert_int_equal(can_send(&r->bus, &r->a.node, &m, 0), CAN_OK);
    sched_run_until(&r->s, NS_PER_S);
    assert_int_equal(r->logged, 1);
    assert_int_equal(r->log[0].to, 'c');
    assert_int_equal(r->b.node.fd_refused, 2);
    assert_int_equal(r->log[0].t_ns, 31000 + 185 * 200 - 3000); /* lengths of test_canbits */
}

static void load_is_the_share_of_time_since_the_last_look(void **state)
{
    (void)state;
    struct rig *r = rig_up(&rig, 1000000, 0);
    for (int i = 0; i < 4; i++) send_id(&r->a, 0x185);
    sched_run_until(&r->s, 62000); /* half of the first frame */
    assert_int_equal(can_busy_ns(&r->bus, 62000), 62000);
    sched_run_until(&r->s, 992000);
    assert_int_equal(can_busy_ns(&r->bus, 992000), 496000); /* 4 * 124 us of 992 us */
    sched_run_until(&r->s, 2000000);
    assert_int_equal(can_busy_ns(&r->bus, 2000000), 496000);
}

static void a_node_may_leave_while_it_receives_or_sends(void **state)
{
    (void)state;
    struct rig *r = rig_up(&rig, 1000000, 0);
    r->b.leaves = &r->b;
    send_id(&r->a, 0x10);
    send_id(&r->a, 0x11);
    sched_run_until(&r->s, 150000);
    can_detach(&r->bus, &r->a.node); /* its second frame is on the wire and is finished */
    sched_run_until(&r->s, NS_PER_S);
    assert_int_equal(r->b.node.rx_frames, 1);
    assert_int_equal(r->c.node.rx_frames, 2);
}

static void a_node_taken_off_by_the_one_before_receives_nothing(void **state)
{
    (void)state;
    struct rig *r = rig_up(&rig, 1000000, 0);
    r->b.leaves = &r->c;
    send_id(&r->a, 0x10);
    sched_run_until(&r->s, NS_PER_S);
    assert_int_equal(r->b.node.rx_frames, 1);
    assert_int_equal(r->c.node.rx_frames, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_frame_reaches_the_others_at_its_end_and_not_its_sender),
        cmocka_unit_test(lowest_identifier_of_one_instant_wins_whoever_spoke_first),
        cmocka_unit_test(arbitration_field_orders_base_extended_and_remote_frames),
        cmocka_unit_test(a_frame_on_the_wire_is_not_interrupted),
        cmocka_unit_test(own_frames_go_by_identifier_or_in_order_as_the_node_says),
        cmocka_unit_test(an_answer_waits_for_the_interframe_space),
        cmocka_unit_test(an_ideal_bus_keeps_order_and_takes_no_time),
        cmocka_unit_test(a_full_queue_is_refused_and_counted),
        cmocka_unit_test(only_frames_that_a_controller_could_send_are_taken),
        cmocka_unit_test(a_classic_node_is_spared_fd_frames_and_counts_them),
        cmocka_unit_test(load_is_the_share_of_time_since_the_last_look),
        cmocka_unit_test(a_node_may_leave_while_it_receives_or_sends),
        cmocka_unit_test(a_node_taken_off_by_the_one_before_receives_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

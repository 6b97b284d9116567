#include "rig.h"

#include "link/can/can_hub.h"

#include <string.h>

#define HEARD_MAX 32

static struct {
    struct sched sched;
    struct can_bus bus;
    struct can_hub hub;
    struct can_client a, b;
    struct can_node ear;
    uint32_t heard[HEARD_MAX]; /* identifiers, in order */
    int64_t heard_ns[HEARD_MAX];
    unsigned count;
    char events[512];
} rig;

static void on_heard(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)ctx;
    rig.heard_ns[rig.count] = t_ns;
    rig.heard[rig.count++] = m->id;
}

static void on_sent(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)m;
    (void)t_ns;
    ++*(unsigned *)ctx;
}

static void on_bus_event(void *ctx, const struct can_hub *h, const struct can_client *c, enum can_hub_event event,
                         const struct can_msg *m)
{
    static const char *const name[] = {"came", "went", "sent"};
    const size_t at = strlen(rig.events);
    assert_ptr_equal(h, &rig.hub);
    (void)ctx;
    snprintf(rig.events + at, sizeof rig.events - at, "%u %s", c->number, name[event]);
    if (m) snprintf(rig.events + strlen(rig.events), 8, " %03X", m->id);
    strcat(rig.events, "; ");
}

static void come(struct can_client *c, const char *name, void *ctx)
{
    strcpy(c->name, name);
    c->adapter = "test";
    c->node = (struct can_node){.order = CAN_ORDER_FIFO, .rx = NULL, .sent = on_sent, .ctx = ctx};
    can_hub_join(&rig.hub, c);
}

static int fresh(void **state)
{
    static unsigned sent[2];
    const struct can_bus_cfg cfg = {.bitrate_hz = 1000000};
    (void)state;
    memset(&rig, 0, sizeof rig);
    memset(sent, 0, sizeof sent);
    sched_init(&rig.sched);
    can_bus_init(&rig.bus, &cfg, &rig.sched);
    rig.ear = (struct can_node){.name = "ear", .rx = on_heard};
    can_attach(&rig.bus, &rig.ear);
    rig.hub = (struct can_hub){.bus = &rig.bus, .tap.event = on_bus_event};
    come(&rig.a, "a", &sent[0]);
    come(&rig.b, "b", &sent[1]);
    return 0;
}

static int clean(void **state)
{
    (void)state;
    can_hub_sweep_detached(&rig.hub, true);
    return 0;
}

static void send(struct can_client *c, uint32_t id, bool taken)
{
    const struct can_msg m = {.id = id, .len = id > 0x7FF ? 9 : 1};
    assert_int_equal(can_hub_send(&rig.hub, c, &m, rig.sched.now_ns), taken);
}

static void send_all(void)
{
    static const uint32_t ids[] = {0x300, 0x301, 0x302};
    for (size_t i = 0; i < COUNT(ids); i++) send(&rig.a, ids[i], true);
    send(&rig.b, 0x200, true);
    send(&rig.a, 0x900, false);
}

static void what_clients_do_is_told(void **state)
{
    (void)state;
    send_all();
    can_hub_leave(&rig.hub, &rig.b);
    assert_string_equal(rig.events, "1 came; 2 came; 1 sent 300; 1 sent 301; 1 sent 302; 2 sent 200; 2 went; ");
}

static void the_bus_sees_no_difference_between_a_client_and_its_detached_one(void **state)
{
    uint32_t alive[HEARD_MAX];
    int64_t alive_ns[HEARD_MAX];
    (void)state;
    send_all();
    sched_run_until(&rig.sched, 1000000);
    assert_int_equal(rig.count, 4);
    memcpy(alive, rig.heard, sizeof alive);
    memcpy(alive_ns, rig.heard_ns, sizeof alive_ns);
    for (int64_t at_ns = 0; at_ns < 300000; at_ns += 10000) { /* before, in and between the frames */
        fresh(NULL);
        send_all();
        sched_run_until(&rig.sched, at_ns);
        const unsigned sent = *(unsigned *)rig.a.node.ctx;
        assert_true(can_hub_detach(&rig.hub, &rig.a));
        assert_false(rig.a.up);
        sched_run_until(&rig.sched, 1000000);
        assert_memory_equal(rig.heard, alive, sizeof alive);
        assert_memory_equal(rig.heard_ns, alive_ns, sizeof alive_ns);
        assert_int_equal(*(unsigned *)rig.a.node.ctx, sent); /* who left is not called any more */
        can_hub_sweep_detached(&rig.hub, true);
    }
}

static void a_detached_client_leaves_when_its_frames_are_sent(void **state)
{
    (void)state;
    send_all();
    sched_run_until(&rig.sched, 1000);
    assert_true(can_hub_detach(&rig.hub, &rig.a));
    can_hub_sweep_detached(&rig.hub, false);
    assert_ptr_not_equal(rig.hub.clients, &rig.b); /* in its client's place, before b */
    assert_true(rig.hub.clients->leaving);
    assert_int_equal(rig.hub.clients->number, 1);
    assert_ptr_equal(rig.hub.clients->next, &rig.b);
    sched_run_until(&rig.sched, 1000000);
    can_hub_sweep_detached(&rig.hub, false);
    assert_ptr_equal(rig.hub.clients, &rig.b);
    assert_int_equal(rig.hub.gone.taken, 3);
    assert_int_equal(rig.hub.gone.refused, 1);
    assert_non_null(strstr(rig.events, "1 went; "));
    assert_false(can_hub_detach(&rig.hub, &rig.a)); /* not there */
}

static void an_added_detached_client_sends_what_its_client_sent(void **state)
{
    (void)state;
    can_hub_leave(&rig.hub, &rig.a);
    can_hub_leave(&rig.hub, &rig.b);
    struct can_client *d = can_hub_add_detached(&rig.hub, 9, "old", false);
    assert_non_null(d);
    send(d, 0x123, true);
    can_hub_sweep_detached(&rig.hub, false);
    assert_ptr_equal(rig.hub.clients, d);
    sched_run_until(&rig.sched, 1000000);
    can_hub_sweep_detached(&rig.hub, false);
    assert_null(rig.hub.clients);
    assert_int_equal(rig.heard[0], 0x123);
    come(&rig.a, "a", rig.a.node.ctx);
    assert_non_null(strstr(rig.events, "2 went; 9 came; 9 sent 123; 9 went; 10 came; "));
}

/* A host that comes back before time moves goes on where it was: its frames keep their order, and it does not hear them. */
static void the_next_client_adopts_the_slot_of_a_detached_one(void **state)
{
    static unsigned sent;
    struct can_client again = {.adapter = "test", .name = "again"}, other = {.adapter = "test", .name = "other"};
    (void)state;
    sent = 0;
    send_all();
    sched_run_until(&rig.sched, 1000);
    assert_true(can_hub_detach(&rig.hub, &rig.a));
    again.node = (struct can_node){.order = CAN_ORDER_FIFO, .rx = on_heard, .sent = on_sent, .ctx = &sent};
    can_hub_join(&rig.hub, &again);
    can_hub_join(&rig.hub, &other);
    assert_int_equal(again.adopts, 1);
    assert_int_equal(again.number, 3);
    assert_int_equal(other.adopts, 0);
    assert_int_equal(again.slot, 1); /* a's */
    assert_int_equal(other.slot, other.connection);
    assert_false(again.leaving);
    assert_ptr_equal(rig.hub.clients, &again); /* before b, as a was */
    assert_ptr_equal(again.next, &rig.b);
    assert_ptr_equal(rig.b.next, &other);
    send(&again, 0x001, true);
    sched_run_until(&rig.sched, 1000000);
    static const uint32_t order[] = {0x200, 0x200, 0x300, 0x301, 0x302, 0x001}; /* b's heard by two */
    assert_int_equal(rig.count, COUNT(order));
    for (size_t i = 0; i < COUNT(order); i++) assert_int_equal(rig.heard[i], order[i]);
    assert_int_equal(sent, 4);
    assert_int_equal(rig.hub.gone.taken, 3); /* what the detached client had sent */
    can_hub_leave(&rig.hub, &again);
    can_hub_leave(&rig.hub, &other);
}

static void a_slot_is_not_free_once_time_has_moved(void **state)
{
    struct can_client late = {.adapter = "test", .name = "late"};
    (void)state;
    send_all();
    sched_run_until(&rig.sched, 1000);
    assert_true(can_hub_detach(&rig.hub, &rig.a));
    can_hub_sweep_detached(&rig.hub, false);
    can_hub_join(&rig.hub, &late);
    assert_int_equal(late.adopts, 0);
    can_hub_leave(&rig.hub, &late);
    can_hub_free_slots(&rig.hub);
    can_hub_join(&rig.hub, &late);
    assert_int_equal(late.adopts, 1);
    can_hub_leave(&rig.hub, &late);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_clients_do_is_told, fresh, clean),
        cmocka_unit_test_setup_teardown(the_bus_sees_no_difference_between_a_client_and_its_detached_one, fresh, clean),
        cmocka_unit_test_setup_teardown(a_detached_client_leaves_when_its_frames_are_sent, fresh, clean),
        cmocka_unit_test_setup_teardown(the_next_client_adopts_the_slot_of_a_detached_one, fresh, clean),
        cmocka_unit_test_setup_teardown(a_slot_is_not_free_once_time_has_moved, fresh, clean),
        cmocka_unit_test_setup_teardown(an_added_detached_client_sends_what_its_client_sent, fresh, clean),
    };
    return cmocka_run_group_tests_name("detached", tests, NULL, NULL);
}

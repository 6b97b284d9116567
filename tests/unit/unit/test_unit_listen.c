/* Who listens to a unit's events hears them in turn, and may leave at any time. */
#include "unit/unit.h"

#include "rig.h"

#include <string.h>

struct ear {
    struct unit_observer l;
    unsigned heard;
    unsigned order; /* of the latest event among all ears */
    struct ear *ends;
};

static struct unit unit;
static struct sched sched;
static struct lab lab;
static unsigned order;

static void hear(void *ctx, unsigned e, int64_t t_ns)
{
    struct ear *ear = ctx;
    (void)e;
    assert_int_equal(t_ns, sched.now_ns);
    ear->heard++;
    ear->order = ++order;
    if (ear->ends) unit_unsubscribe(&unit, &ear->ends->l);
}

static struct ear ear(void)
{
    return (struct ear){.l = {.fn = hear}};
}

static void listen(struct ear *e)
{
    e->l.ctx = e;
    unit_subscribe(&unit, &e->l);
}

static bool heard(void)
{
    return unit.board->observed;
}

static void up(void)
{
    const struct unit_cfg cfg = unit_default("a");
    struct lab_cfg world;
    memset(&world, 0, sizeof world);
    world.site.g_mps2 = 9.8;
    sched_init(&sched);
    order = 0;
    lab_init(&lab, &world, 1);
    unit_init(&unit, &cfg, &lab, &sched);
}

static void listeners_hear_in_order_of_coming(void **state)
{
    (void)state;
    up();
    struct ear a = ear(), b = ear();
    listen(&a);
    listen(&b);
    psa2_power_up(&unit.store.psa2, 0);
    assert_int_equal(a.heard, 1);
    assert_int_equal(b.heard, 1);
    assert_true(a.order < b.order);
    unit_unsubscribe(&unit, &a.l);
    unit_unsubscribe(&unit, &a.l); /* harmless */
    sched_run_until(&sched, 70000000);
    assert_int_equal(a.heard, 1);
    assert_true(b.heard > 1);
}

static void the_board_computes_no_events_for_nobody(void **state)
{
    (void)state;
    up();
    assert_false(heard());
    struct ear a = ear();
    listen(&a);
    assert_true(heard());
    unit_unsubscribe(&unit, &a.l);
    assert_false(heard());
    psa2_power_up(&unit.store.psa2, 0);
    assert_int_equal(a.heard, 0);
}

static void a_listener_may_end_its_own_listening_or_the_next(void **state)
{
    (void)state;
    up();
    struct ear a = ear(), b = ear(), c = ear();
    listen(&a);
    listen(&b);
    listen(&c);
    a.ends = &b; /* who is next */
    c.ends = &c;
    psa2_power_up(&unit.store.psa2, 0);
    assert_int_equal(a.heard, 1);
    assert_int_equal(b.heard, 0);
    assert_int_equal(c.heard, 1);
    a.ends = &a;
    psa2_power_down(&unit.store.psa2, 0); /* Res, and the power */
    assert_int_equal(a.heard, 2);
    assert_int_equal(c.heard, 1);
    assert_false(heard());
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(listeners_hear_in_order_of_coming),
        cmocka_unit_test(the_board_computes_no_events_for_nobody),
        cmocka_unit_test(a_listener_may_end_its_own_listening_or_the_next),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

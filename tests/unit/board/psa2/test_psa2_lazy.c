/* A few lives, lazy and eager. */
#include "lazy_lives.h"

static void lazy_is_eager_to_the_byte(void **state)
{
    (void)state;
    live_lives(40u, (struct kind){LIFE_NS, NULL});
}

static void long_sleep_is_eager_to_the_byte(void **state)
{
    (void)state;
    live_lives(12u, (struct kind){LONG_NS, NULL});
}

/* Its events look at nothing of the unit that sleeps. */
static void it_sleeps_beside_each_other_type(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) live_lives(10u, (struct kind){LIFE_NS, *t});
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(lazy_is_eager_to_the_byte),
                                       cmocka_unit_test(long_sleep_is_eager_to_the_byte),
                                       cmocka_unit_test(it_sleeps_beside_each_other_type)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

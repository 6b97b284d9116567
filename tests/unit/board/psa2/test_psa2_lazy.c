/* A few lives, lazy and eager. */
#include "lazy_lives.h"

static void lazy_is_eager_to_the_byte(void **state)
{
    (void)state;
    live_lives(40u, LIFE_NS);
}

static void long_sleep_is_eager_to_the_byte(void **state)
{
    (void)state;
    live_lives(12u, LONG_NS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(lazy_is_eager_to_the_byte),
                                       cmocka_unit_test(long_sleep_is_eager_to_the_byte)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

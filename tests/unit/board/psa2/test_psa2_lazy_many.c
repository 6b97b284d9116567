/* Many lives, lazy and eager. */
#include "lazy_lives.h"

#ifdef __SANITIZE_ADDRESS__
#define LIVES 50u /* ten times as slow */
#else
#define LIVES 500u
#endif

static void lazy_is_eager_to_the_byte(void **state)
{
    (void)state;
    live_lives(LIVES, (struct kind){LIFE_NS, NULL});
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(lazy_is_eager_to_the_byte)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

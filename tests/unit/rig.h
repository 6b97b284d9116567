/* What every C test needs from cmocka, in the order cmocka wants it. */
#ifndef PSABENCH_TESTS_RIG_H
#define PSABENCH_TESTS_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#define COUNT(table) (sizeof(table) / sizeof *(table))

/* Seed of random tests: TEST_SEED if set, else the default; printed so that a failure can be replayed. */
static inline uint64_t rig_seed(uint64_t standard)
{
    const char *s = getenv("TEST_SEED");
    const uint64_t seed = s ? strtoull(s, NULL, 0) : standard;
    print_message("TEST_SEED=%llu\n", (unsigned long long)seed);
    return seed;
}

#endif

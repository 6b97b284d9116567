/* Four numbers side by side, by the compiler's portable vectors: each lane holds what the same operations give one by one, to the
 * bit, with the vector instructions of any machine or with none.
 *
 * A function that works on rows is written once, LANES_BODY, and compiled twice: for every machine, and for those that have
 * AVX2. Functions take vectors by pointer: how they would be passed differs between the two. */
#ifndef PSABENCH_BASE_LANES_H
#define PSABENCH_BASE_LANES_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define LANES 4u

typedef double lanes_f64 __attribute__((vector_size(32)));
typedef int64_t lanes_i64 __attribute__((vector_size(32)));
typedef uint64_t lanes_u64 __attribute__((vector_size(32)));

#define LANES_BODY static inline __attribute__((always_inline))

/* Whether vector instructions may be used where the machine has them: yes. A test has a function of its own in its place. */
bool lanes_allowed(void);

#if defined __x86_64__
#define LANES_AVX2 __attribute__((target("avx2")))
#define LANES_BMI2 __attribute__((target("bmi2")))
static inline bool lanes_avx2(void)
{
    return lanes_allowed() && __builtin_cpu_supports("avx2");
}

static inline bool lanes_bmi2(void)
{
    return lanes_allowed() && __builtin_cpu_supports("bmi2");
}
#else
#define LANES_AVX2
#define LANES_BMI2
static inline bool lanes_avx2(void)
{
    return false;
}

static inline bool lanes_bmi2(void)
{
    return false;
}
#endif

/* Any place in a row, aligned or not. */
#define LANES_LOAD(v, from) memcpy(&(v), (from), sizeof(v))
#define LANES_STORE(to, v)  memcpy((to), &(v), sizeof(v))

#define LANES_ALL(x)                                                                                                   \
    {                                                                                                                  \
        (x), (x), (x), (x)                                                                                             \
    }

/* By a mask of comparison: a where it is true, else b. */
#define LANES_PICK(mask, a, b) ((lanes_f64)(((mask) & (lanes_i64)(a)) | (~(mask) & (lanes_i64)(b))))

#endif

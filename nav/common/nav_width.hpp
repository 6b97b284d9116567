/* The same source compiled for vectors of 2, 4 or 8 doubles, and which of them this processor can run. No fused operations in
 * any: the same bytes from all. */
#ifndef PSABENCH_NAV_WIDTH_HPP
#define PSABENCH_NAV_WIDTH_HPP

/* Into code for a newer processor, too. */
#define INLINE __attribute__((always_inline)) static inline

#ifdef __x86_64__
#define TARGET_WIDE   __attribute__((target("avx2")))
#define TARGET_WIDEST __attribute__((target("avx512f,avx512dq,avx512vl")))
inline int random_width(void)
{
    if (__builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")) return 2;
    return __builtin_cpu_supports("avx2") ? 1 : 0;
}
#else
#define TARGET_WIDE
#define TARGET_WIDEST
inline int random_width(void)
{
    return 0;
}
#endif

/* name_by_width[random_width()] has these parameters and is the call, inlined and compiled for that width. */
#define BY_WIDTH(name, parameters, ...)                                                                                \
    static void name##_any parameters                                                                                  \
    {                                                                                                                  \
        __VA_ARGS__;                                                                                                   \
    }                                                                                                                  \
    TARGET_WIDE static void name##_wide parameters                                                                     \
    {                                                                                                                  \
        __VA_ARGS__;                                                                                                   \
    }                                                                                                                  \
    TARGET_WIDEST static void name##_widest parameters                                                                 \
    {                                                                                                                  \
        __VA_ARGS__;                                                                                                   \
    }                                                                                                                  \
    static void(*const name##_by_width[]) parameters = {name##_any, name##_wide, name##_widest};

#endif

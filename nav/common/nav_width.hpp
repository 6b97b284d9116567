/* The same source compiled for vectors of 2, 4 or 8 doubles, and which of them this processor can run. No fused operations in
 * any: the same bytes from all. */
#ifndef PSABENCH_NAV_WIDTH_HPP
#define PSABENCH_NAV_WIDTH_HPP

/* Into code for a newer processor, too. */
#define INLINE __attribute__((always_inline)) static inline

#ifdef __x86_64__
#define TARGET_WIDE   __attribute__((target("avx2")))
#define TARGET_WIDEST __attribute__((target("avx512f,avx512dq,avx512vl")))
inline int nav_width(void)
{
    if (__builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")) return 2;
    return __builtin_cpu_supports("avx2") ? 1 : 0;
}
#else
#define TARGET_WIDE
#define TARGET_WIDEST
inline int nav_width(void)
{
    return 0;
}
#endif

#define COMPILE_FOR(name, parameters, lanes, ...)                                                                      \
    static void name##_##lanes parameters                                                                              \
    {                                                                                                                  \
        [[maybe_unused]] constexpr int WIDTH = lanes;                                                                  \
        __VA_ARGS__;                                                                                                   \
    }

/* name_by_width[nav_width()] has these parameters and is the call, compiled for that width; it may name WIDTH. */
#define BY_WIDTH(name, parameters, ...)                                                                                \
    COMPILE_FOR(name, parameters, 2, __VA_ARGS__)                                                                      \
    TARGET_WIDE COMPILE_FOR(name, parameters, 4, __VA_ARGS__)                                                          \
    TARGET_WIDEST COMPILE_FOR(name, parameters, 8, __VA_ARGS__) static void(*const name##_by_width[])                  \
        parameters = {name##_2, name##_4, name##_8};

#endif

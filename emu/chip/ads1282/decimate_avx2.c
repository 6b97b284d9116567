#include "chip/ads1282/decimate.h"

#include "base/bits.h"

/* Four sums side by side: of four outputs in a row, or parts of one. AVX2 multiplies 32 by 32 bits with sign: a sample
 * x = h 2^32 + l, l with sign, enters by two products. Nothing here knows what overflows: sums are modulo 2^64, as the
 * plain ones would be if they did. */

#if defined __x86_64__

#include <immintrin.h>

#define AVX2 __attribute__((target("avx2")))
#define FAST static inline __attribute__((always_inline, target("avx2")))

struct sums {
    __m256i low, high;
};

FAST __m256i load_four(const int64_t *x)
{
    return _mm256_loadu_si256((const __m256i *)(const void *)x);
}

FAST void store_four(int64_t *x, __m256i v)
{
    _mm256_storeu_si256((__m256i *)(void *)x, v);
}

/* h of x; the upper half of a lane does not matter to a product. */
FAST __m256i high_half(__m256i x)
{
    return _mm256_srli_epi64(_mm256_add_epi64(x, _mm256_set1_epi64x(INT64_C(1) << 31)), 32);
}

FAST void add_product(struct sums *s, __m256i tap, __m256i x, __m256i x_high)
{
    s->low = _mm256_add_epi64(s->low, _mm256_mul_epi32(tap, x));
    s->high = _mm256_add_epi64(s->high, _mm256_mul_epi32(tap, x_high));
}

FAST __m256i join_halves(const struct sums *s)
{
    return _mm256_add_epi64(s->low, _mm256_slli_epi64(s->high, 32));
}

/* As bits_round_shift(). */
FAST __m256i round_shift(__m256i v, unsigned shift)
{
    const __m256i bias = _mm256_set1_epi64x((int64_t)(INT64_MIN + (INT64_C(1) << (shift - 1))));
    const __m256i zero = _mm256_set1_epi64x(1LL << (63 - shift));
    return _mm256_sub_epi64(_mm256_srl_epi64(_mm256_add_epi64(v, bias), _mm_cvtsi32_si128((int)shift)), zero);
}

/* Eight samples in a row to four at even places and four at odd ones. */
FAST void part_places(__m256i first, __m256i then, int64_t *even, int64_t *odd)
{
    const __m256i low = _mm256_permute2x128_si256(first, then, 0x20);
    const __m256i high = _mm256_permute2x128_si256(first, then, 0x31);
    store_four(even, _mm256_unpacklo_epi64(low, high));
    store_four(odd, _mm256_unpackhi_epi64(low, high));
}

FAST __m256i sinc_outputs(const __m256i tap[ADS1282_SINC_TAPS], const int64_t *x, const int64_t *x_high, unsigned shift)
{
    struct sums s = {_mm256_mul_epi32(tap[0], load_four(x)), _mm256_mul_epi32(tap[0], load_four(x_high))};
#pragma GCC unroll 4
    for (int j = 1; j < ADS1282_SINC_TAPS; j++) add_product(&s, tap[j], load_four(x - j), load_four(x_high - j));
    return round_shift(join_halves(&s), shift);
}

FAST void sinc_stage(struct ads1282_filter *f, const int64_t block[ADS1282_BLOCKS])
{
    enum { PAST = ADS1282_SINC_TAPS - 1 };
    const unsigned shift = 4 * (unsigned)__builtin_ctz(f->sinc_ratio);
    int64_t high[PAST + ADS1282_BLOCKS];
    __m256i tap[ADS1282_SINC_TAPS];
    for (int j = 0; j < ADS1282_SINC_TAPS; j++) tap[j] = _mm256_set1_epi64x(f->sinc_tap[j]);
    store_four(high, high_half(load_four(f->sinc)));
#pragma GCC unroll 8
    for (unsigned n = 0; n < ADS1282_BLOCKS; n += 4) {
        const __m256i x = load_four(block + n);
        store_four(f->sinc + PAST + n, x);
        store_four(high + PAST + n, high_half(x));
    }
    for (unsigned n = 0; n < ADS1282_BLOCKS; n += 8)
        part_places(sinc_outputs(tap, f->sinc + PAST + n, high + PAST + n, shift),
                    sinc_outputs(tap, f->sinc + PAST + n + 4, high + PAST + n + 4, shift), f->even1 + 2 + n / 2,
                    f->odd1 + 5 + n / 2);
    store_four(f->sinc, load_four(f->sinc + ADS1282_BLOCKS));
}

/* Four outputs of a half-band filter of 4 pairs - 1 taps; odd: the newest sample of the first. */
FAST __m256i half_band(const int32_t *tap, unsigned pairs, const int64_t *odd, const int64_t *middle, unsigned shift)
{
    const __m256i m = load_four(middle);
    struct sums s = {_mm256_setzero_si256(), _mm256_setzero_si256()};
    add_product(&s, _mm256_set1_epi64x(tap[2 * pairs - 1]), m, high_half(m));
#pragma GCC unroll 4
    for (unsigned i = 0; i < pairs; i++) {
        const __m256i pair = _mm256_add_epi64(load_four(odd - i), load_four(odd - (2 * pairs - 1) + i));
        add_product(&s, _mm256_set1_epi64x(tap[2 * i]), pair, high_half(pair));
    }
    return round_shift(join_halves(&s), shift);
}

FAST __m256i load_eight(const int32_t *x)
{
    return _mm256_loadu_si256((const __m256i *)(const void *)x);
}

FAST void store_eight(int32_t *x, __m256i v)
{
    _mm256_storeu_si256((__m256i *)(void *)x, v);
}

FAST __m256i four_taps(const int32_t *tap)
{
    return _mm256_cvtepi32_epi64(_mm_loadu_si128((const __m128i *)(const void *)tap));
}

/* Of a window, n being whole groups of eight: the products of the high halves, of which 32 bits count, by themselves. */
FAST uint64_t high_part(const int32_t *tap, const int32_t *x_high, unsigned n)
{
    __m256i s = _mm256_setzero_si256();
#pragma GCC unroll 14
    for (unsigned i = 0; i < n; i += 8)
        s = _mm256_add_epi32(s, _mm256_mullo_epi32(load_eight(tap + i), load_eight(x_high + i)));
    __m128i four = _mm_add_epi32(_mm256_castsi256_si128(s), _mm256_extracti128_si256(s, 1));
    four = _mm_add_epi32(four, _mm_shuffle_epi32(four, 0x4E));
    return (uint64_t)_mm_cvtsi128_si64(_mm_add_epi32(four, _mm_shuffle_epi32(four, 0xB1))) << 32;
}

FAST int64_t round_sum(__m256i low, uint64_t high, unsigned shift)
{
    const __m128i two = _mm_add_epi64(_mm256_castsi256_si128(low), _mm256_extracti128_si256(low, 1));
    const uint64_t sum = (uint64_t)_mm_cvtsi128_si64(_mm_add_epi64(two, _mm_unpackhi_epi64(two, two))) + high;
    return bits_round_shift((int64_t)sum, shift);
}

FAST __m256i tap_products(__m256i tap, const int64_t *x)
{
    return _mm256_mul_epi32(tap, load_four(x));
}

/* Two outputs, the windows of which lie four samples apart. */
FAST void stage_3(const int32_t *tap, const int64_t *x, const int32_t *x_high, int64_t out[2])
{
    __m256i first = _mm256_setzero_si256(), second = first;
#pragma GCC unroll 13
    for (unsigned i = 0; i < ADS1282_WINDOW_3; i += 4) {
        const __m256i t = four_taps(tap + i);
        first = _mm256_add_epi64(first, tap_products(t, x + i));
        second = _mm256_add_epi64(second, tap_products(t, x + i + 4));
    }
    out[0] = round_sum(first, high_part(tap, x_high, ADS1282_WINDOW_3 + 4), ADS1282_SHIFT_3);
    out[1] = round_sum(second, high_part(tap, x_high + 4, ADS1282_WINDOW_3 + 4), ADS1282_SHIFT_3);
}

FAST int64_t stage_4(const int32_t *tap, const int64_t *x, const int32_t *x_high)
{
    __m256i s = _mm256_setzero_si256();
#pragma GCC unroll 28
    for (unsigned i = 0; i < ADS1282_WINDOW_4; i += 4) s = _mm256_add_epi64(s, tap_products(four_taps(tap + i), x + i));
    return round_sum(s, high_part(tap, x_high, ADS1282_WINDOW_4), ADS1282_SHIFT_4);
}

/* Stage 2: eight samples for stage 3, whole and their high halves. */
FAST void stage_2(const struct ads1282_filter *f, int64_t *x, int32_t *x_high)
{
    const int32_t *tap = ads1282_fir[f->phase][1].tap;
    const __m256i first = half_band(tap, 4, f->odd2 + 7, f->even2, ADS1282_SHIFT_2);
    const __m256i then = half_band(tap, 4, f->odd2 + 11, f->even2 + 4, ADS1282_SHIFT_2);
    const __m256i mixed = _mm256_unpacklo_epi64(_mm256_shuffle_epi32(high_half(first), 0x88),
                                                _mm256_shuffle_epi32(high_half(then), 0x88));
    store_four(x, first);
    store_four(x + 4, then);
    store_eight(x_high, _mm256_permute4x64_epi64(mixed, 0xD8));
}

FAST void stage_1(struct ads1282_filter *f)
{
    const int32_t *tap = ads1282_fir[f->phase][0].tap;
#pragma GCC unroll 2
    for (unsigned n = 0; n < 16; n += 8)
        part_places(half_band(tap, 3, f->odd1 + 5 + n, f->even1 + n, ADS1282_SHIFT_1),
                    half_band(tap, 3, f->odd1 + 9 + n, f->even1 + n + 4, ADS1282_SHIFT_1), f->even2 + 3 + n / 2,
                    f->odd2 + 7 + n / 2);
}

FAST int64_t fir_stages(struct ads1282_filter *f)
{
    int64_t *const x3 = ads1282_window_3(f), *const x4 = ads1282_window_4(f);
    int32_t *const high3 = f->high3 + (x3 - f->fir3), *const high4 = f->high4 + (x4 - f->fir4);
    int64_t *const fresh4 = x4 + ADS1282_WINDOW_4 - 2;
    stage_1(f);
    stage_2(f, x3 + ADS1282_WINDOW_3 - 4, high3 + ADS1282_WINDOW_3 - 4);
    stage_3(f->tap3, x3, high3, fresh4);
    for (unsigned n = 0; n < 2; n++) high4[ADS1282_WINDOW_4 - 2 + n] = (int32_t)bits_round_shift(fresh4[n], 32);
    const int64_t y = stage_4(f->tap4, x4, high4);
    ads1282_next_period(f);
    return y;
}

AVX2 static int64_t avx2_fir(struct ads1282_filter *f, const int64_t sinc[ADS1282_BLOCKS])
{
    for (unsigned n = 0; n < ADS1282_BLOCKS; n += 8)
        part_places(load_four(sinc + n), load_four(sinc + n + 4), f->even1 + 2 + n / 2, f->odd1 + 5 + n / 2);
    return fir_stages(f);
}

AVX2 static int64_t avx2_period(struct ads1282_filter *f, const int64_t block[ADS1282_BLOCKS])
{
    sinc_stage(f, block);
    return fir_stages(f);
}

const struct ads1282_decimator *ads1282_avx2(void)
{
    static const struct ads1282_decimator decimator = {avx2_period, avx2_fir};
    return __builtin_cpu_supports("avx2") ? &decimator : NULL;
}

#else

const struct ads1282_decimator *ads1282_avx2(void)
{
    return NULL;
}

#endif

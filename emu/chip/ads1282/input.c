#include "chip/ads1282/input.h"

#include "base/lanes.h"

#include <stddef.h>

/* 2^52 + n has n in its last bits, for n from 0 to 2^52. */
#define ONE_52  0x1p52
#define BITS_52 INT64_C(0x4330000000000000)

/* As ads1282_sum_draw(). */
LANES_BODY void sum_draws(const uint64_t *u, lanes_f64 *out)
{
    lanes_u64 v;
    LANES_LOAD(v, u);
    const lanes_u64 pairs = (v & ADS1282_DRAW_PAIRS) + (v >> 16 & ADS1282_DRAW_PAIRS);
    const lanes_u64 sum = (pairs & 0xFFFFFFFF) + (pairs >> 32);
    *out = (lanes_f64)(sum | (uint64_t)BITS_52) - (ONE_52 + 131070.0);
}

/* As ads1282_saturate_lsb(): rounds to an integer, and down by one where that was up. */
LANES_BODY void saturate_lanes(const lanes_f64 *in, lanes_i64 *lsb)
{
    const lanes_f64 max = LANES_ALL(ADS1282_INPUT_MAX_LSB), min = LANES_ALL(-ADS1282_INPUT_MAX_LSB);
    lanes_f64 x = LANES_PICK(*in < max, *in, max);
    x = LANES_PICK(x < min, min, x);
    const lanes_f64 y = x + 0x1p36 + 0.5;
    const lanes_f64 nearest = y + ONE_52;
    *lsb = (lanes_i64)nearest + (nearest - ONE_52 > y) - (BITS_52 + (INT64_C(1) << 36));
}

LANES_BODY void input_row(struct ads1282_scale scale, const double *vin_v, const uint64_t *u, unsigned n, int64_t *lsb)
{
    unsigned i = 0;
    for (; i + LANES <= n; i += LANES) {
        lanes_f64 x, draw;
        lanes_i64 out;
        LANES_LOAD(x, vin_v + i);
        x *= scale.lsb_per_v;
        if (u) {
            sum_draws(u + i, &draw);
            x += scale.noise_lsb * draw;
        }
        saturate_lanes(&x, &out);
        LANES_STORE(lsb + i, out);
    }
    for (; i < n; i++) {
        double x = vin_v[i] * scale.lsb_per_v;
        if (u) x += scale.noise_lsb * ads1282_sum_draw(u[i]);
        lsb[i] = ads1282_saturate_lsb(x);
    }
}

LANES_AVX2 static void input_row_avx2(struct ads1282_scale scale, const double *vin_v, const uint64_t *u, unsigned n,
                                      int64_t *lsb)
{
    input_row(scale, vin_v, u, n, lsb);
}

void ads1282_input_row(struct ads1282_scale scale, const double *vin_v, const uint64_t *u, unsigned n, int64_t *lsb)
{
    if (lanes_avx2()) input_row_avx2(scale, vin_v, u, n, lsb);
    else input_row(scale, vin_v, u, n, lsb);
}

static double limit_v(struct ads1282_range range, double v)
{
    return v < range.min_v ? range.min_v : v > range.max_v ? range.max_v : v;
}

unsigned ads1282_limit_row(struct ads1282_range range, double common_mode_v, double *vin_v, unsigned n)
{
    unsigned beyond = 0;
    for (unsigned i = 0; i < n; i++) {
        const double p_v = common_mode_v + 0.5 * vin_v[i], n_v = common_mode_v - 0.5 * vin_v[i];
        const double highest_v = p_v > n_v ? p_v : n_v, lowest_v = p_v > n_v ? n_v : p_v;
        if (lowest_v >= range.min_v && highest_v <= range.max_v) continue;
        vin_v[i] = limit_v(range, p_v) - limit_v(range, n_v);
        beyond++;
    }
    return beyond;
}

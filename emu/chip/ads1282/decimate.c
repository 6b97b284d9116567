#include "chip/ads1282/decimate.h"

#include "base/bits.h"

static void part_places(const int64_t sinc[ADS1282_BLOCKS], struct ads1282_filter *f)
{
    for (unsigned n = 0; n < 16; n++) {
        f->even1[2 + n] = sinc[2 * n];
        f->odd1[5 + n] = sinc[2 * n + 1];
    }
}

static void sinc_stage(struct ads1282_filter *f, const int64_t block[ADS1282_BLOCKS])
{
    const int64_t t0 = f->sinc_tap[0], t1 = f->sinc_tap[1], t2 = f->sinc_tap[2], t3 = f->sinc_tap[3],
                  t4 = f->sinc_tap[4];
    const unsigned shift = 4 * bits_log2(f->sinc_ratio);
    const int64_t *x = f->sinc + ADS1282_SINC_TAPS - 1;
    int64_t out[ADS1282_BLOCKS];
    memcpy(f->sinc + ADS1282_SINC_TAPS - 1, block, ADS1282_BLOCKS * sizeof *block);
    for (unsigned n = 0; n < ADS1282_BLOCKS; n++, x++)
        out[n] = bits_round_shift(t0 * x[0] + t1 * x[-1] + t2 * x[-2] + t3 * x[-3] + t4 * x[-4], shift);
    memcpy(f->sinc, f->sinc + ADS1282_BLOCKS, (ADS1282_SINC_TAPS - 1) * sizeof *f->sinc);
    part_places(out, f);
}

static int64_t stage_1(const int32_t *tap, const int64_t *odd, int64_t middle)
{
    const int64_t sum = tap[0] * (odd[0] + odd[-5]) + tap[2] * (odd[-1] + odd[-4]) + tap[4] * (odd[-2] + odd[-3]);
    return bits_round_shift(sum + tap[5] * middle, ADS1282_SHIFT_1);
}

static int64_t stage_2(const int32_t *tap, const int64_t *odd, int64_t middle)
{
    const int64_t sum = tap[0] * (odd[0] + odd[-7]) + tap[2] * (odd[-1] + odd[-6]) + tap[4] * (odd[-2] + odd[-5]) +
                        tap[6] * (odd[-3] + odd[-4]);
    return bits_round_shift(sum + tap[7] * middle, ADS1282_SHIFT_2);
}

static int64_t dot_product(const int32_t *tap, const int64_t *x, unsigned n)
{
    int64_t sum = 0;
    for (unsigned i = 0; i < n; i += 4)
        sum += tap[i] * x[i] + tap[i + 1] * x[i + 1] + tap[i + 2] * x[i + 2] + tap[i + 3] * x[i + 3];
    return sum;
}

static int64_t fir_stages(struct ads1282_filter *f)
{
    const struct ads1282_fir *fir = ads1282_fir[f->phase];
    int64_t *const x3 = ads1282_window_3(f), *const x4 = ads1282_window_4(f);
    for (unsigned n = 0; n < 8; n++) {
        f->even2[3 + n] = stage_1(fir[0].tap, f->odd1 + 5 + 2 * n, f->even1[2 * n]);
        f->odd2[7 + n] = stage_1(fir[0].tap, f->odd1 + 6 + 2 * n, f->even1[2 * n + 1]);
    }
    for (unsigned n = 0; n < 8; n++) x3[ADS1282_WINDOW_3 - 4 + n] = stage_2(fir[1].tap, f->odd2 + 7 + n, f->even2[n]);
    for (unsigned n = 0; n < 2; n++)
        x4[ADS1282_WINDOW_4 - 2 + n] =
            bits_round_shift(dot_product(f->tap3, x3 + 4 * n, ADS1282_WINDOW_3), ADS1282_SHIFT_3);
    const int64_t y = bits_round_shift(dot_product(f->tap4, x4, ADS1282_WINDOW_4), ADS1282_SHIFT_4);
    ads1282_next_period(f);
    return y;
}

static int64_t plain_fir(struct ads1282_filter *f, const int64_t sinc[ADS1282_BLOCKS])
{
    part_places(sinc, f);
    return fir_stages(f);
}

static int64_t plain_period(struct ads1282_filter *f, const int64_t block[ADS1282_BLOCKS])
{
    sinc_stage(f, block);
    return fir_stages(f);
}

const struct ads1282_decimator ads1282_plain = {plain_period, plain_fir};

const struct ads1282_decimator *ads1282_decimator(void)
{
    const struct ads1282_decimator *avx2 = ads1282_avx2();
    return avx2 ? avx2 : &ads1282_plain;
}

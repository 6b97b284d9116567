#include "chip/ads1282/cal.h"

#include "base/bits.h"

#define LOG2_READINGS 4
#define OFC_LSB       128 /* one count of OFC, in LSB of 2^-30 full scale */

bool ads1282_cal_take(struct ads1282_cal *c, int64_t y_lsb)
{
    c->sum += y_lsb;
    return --c->left == 0;
}

int32_t ads1282_cal_ofc(const struct ads1282_cal *c)
{
    return (int32_t)bits_clip(bits_round_shift(c->sum, LOG2_READINGS + 7), 24);
}

/* 400000h full scale / mean = 2^22 2^30 16 / sum. */
uint32_t ads1282_cal_fsc(const struct ads1282_cal *c, int32_t ofc)
{
    const int64_t sum = c->sum - (int64_t)ofc * OFC_LSB * ADS1282_CAL_READINGS;
    if (sum <= 0) return 0xFFFFFF;
    const int64_t fsc = ((INT64_C(1) << 56) + sum / 2) / sum;
    return fsc > 0xFFFFFF ? 0xFFFFFF : (uint32_t)fsc;
}

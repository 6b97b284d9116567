#include "chip/ads1282/hpf.h"

#include "base/bits.h"

#define FRACTION 20 /* bits of the state below the LSB */
#define SPLIT    28 /* y d has up to 87 bits: taken in two parts */

void ads1282_hpf_clear(struct ads1282_hpf *h)
{
    *h = (struct ads1282_hpf){0, 0};
}

/* y d / 2^33, rounded to nearest, for |y| < 2^55 and 0 <= d <= 2^32. */
static int64_t fraction_of(int64_t y, int64_t d)
{
    const int64_t high = bits_round_shift(y - (INT64_C(1) << (SPLIT - 1)), SPLIT); /* floor */
    const int64_t low = y - high * (INT64_C(1) << SPLIT);
    const int64_t carry = (low * d + (INT64_C(1) << 32)) >> SPLIT; /* a half for the rounding */
    return bits_round_shift(high * d + carry - (1 << (33 - SPLIT - 1)), 33 - SPLIT);
}

int64_t ads1282_hpf_step(struct ads1282_hpf *h, int64_t x, uint16_t hpf)
{
    const int64_t g = 131072 - hpf;                     /* (2 - a)/2 in 2^-17 */
    const int64_t left = 65536 - hpf;                   /* 1 - a in 2^-16 */
    const int64_t d = (INT64_C(1) << 32) - left * left; /* 1 - b in 2^-33 */
    h->y += (x - h->x) * g * (1 << (FRACTION - 17)) - fraction_of(h->y, d);
    h->x = x;
    return bits_round_shift(h->y, FRACTION);
}

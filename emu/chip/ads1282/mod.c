#include "chip/ads1282/mod.h"

/* Weight of the first loop's inner integrator at its quantiser: keeps w2 within 10 ONE for any input up to 106 %, slams
 * between the ends included; below 3 the second loop overloads there. E0: not published. */
#define DAMPING 4

void ads1282_mod_clear(struct ads1282_mod *m)
{
    *m = (struct ads1282_mod){{0, 0}, {0, 0}, 0, 0};
}

/* First loop: (1 - z^-1)^2 w2 = z^-2 (x - M0). The second takes w2 - 3 M0, nine times too large: its feedback is nine
 * times as large, too, and no division rounds. M1 = z^-2 (w2 - 3 M0)/9 + (1 - z^-1)^2 e. */
void ads1282_mod_step(struct ads1282_mod *m, int64_t x)
{
    const int64_t m0 = DAMPING * m->first[0] + m->first[1] >= 0 ? ADS1282_MOD_ONE : -ADS1282_MOD_ONE;
    const int64_t m1 = m->second[1] >= 0 ? 9 * ADS1282_MOD_ONE : -9 * ADS1282_MOD_ONE;
    m->second[1] += m->second[0] - 2 * m1;
    m->second[0] += m->first[1] - 3 * m0 - m1;
    m->first[1] += m->first[0];
    m->first[0] += x - m0;
    m->m0 = (m->m0 << 1 | (m0 > 0)) & 0x1F;
    m->m1 = (m->m1 << 1 | (m1 > 0)) & 0x1F;
}

static int32_t bit_sign(unsigned bits, unsigned ago)
{
    return (bits >> ago & 1) ? 1 : -1;
}

int32_t ads1282_mod_decode(const struct ads1282_mod *m)
{
    return 3 * bit_sign(m->m0, 2) - 6 * bit_sign(m->m0, 3) + 4 * bit_sign(m->m0, 4) +
           9 * (bit_sign(m->m1, 0) - 2 * bit_sign(m->m1, 1) + bit_sign(m->m1, 2));
}

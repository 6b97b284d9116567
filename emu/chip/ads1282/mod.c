#include "chip/ads1282/mod.h"

#include <string.h>

/* Weight of the first loop's inner integrator at its quantiser: keeps w2 within 13 ONE for any input up to 106 %, slams
 * between the ends included; below 3 the second loop overloads there. E0: not published. */
#define DAMPING 4

void ads1282_mod_clear(struct ads1282_mod *m)
{
    *m = (struct ads1282_mod){{0, 0}, {0, 0}, 0, 0};
}

static void push_bits(struct ads1282_mod *m, bool m0, bool m1)
{
    m->m0 = (m->m0 << 1 | m0) & 0x1F;
    m->m1 = (m->m1 << 1 | m1) & 0x1F;
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
    push_bits(m, m0 > 0, m1 > 0);
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

/* The decode formula is M0[n-4] + (1 - z^-1)^2 u[n], u[n] = 3 M0[n-2] + 9 M1[n]: two differences, which undo the first two
 * integrators of the sinc. So u enters behind them. */
static int32_t late_part(const struct ads1282_mod *m, unsigned ago)
{
    return 3 * bit_sign(m->m0, 2 + ago) + 9 * bit_sign(m->m1, ago);
}

/* The differences that the two integrators would have missed: those from before they began. */
void ads1282_mod_start(const struct ads1282_mod *m, struct ads1282_cic *c)
{
    const int64_t last = late_part(m, 0), before = late_part(m, 1);
    c->integrator[0] = (uint64_t)(before - last);
    c->integrator[1] = (uint64_t)-last;
}

/* What a clock adds by its bits: 1 for M0 = -1 and 2 for M1 = -1; from ONE_BIT on M0 alone. No branch could be foretold. */
#define ONE ADS1282_MOD_ONE
enum { ONE_BIT = 4 };
static const struct {
    int64_t second0[4];                   /* to an integrator of the loops: -3 m0 - m1 */
    int64_t early[6], late0[6], late1[6]; /* to those of the sinc: M0, 3 M0, 9 M1 */
} add = {{-12 * ONE, -6 * ONE, 6 * ONE, 12 * ONE}, {1, -1, 1, -1, 1, -1}, {3, -3, 3, -3, 0, 0}, {9, 9, -9, -9, 0, 0}};

/* -feedback of a positive bit, or of a negative one. By mask, and added last: the next clock waits for
 * it, and for a table it would wait longer. */
static inline int64_t feed_back(uint64_t negative, int64_t feedback)
{
    return (int64_t)(-negative & (uint64_t)(2 * feedback)) - feedback;
}

/* As ads1282_mod_step(). */
static void run_loops(struct ads1282_mod *m, const int64_t *x, unsigned n, uint8_t *bits)
{
    int64_t f0 = m->first[0], f1 = m->first[1], s0 = m->second[0], s1 = m->second[1];
#pragma GCC unroll 4
    for (unsigned i = 0; i < n; i++) {
        const uint64_t b0 = (uint64_t)(DAMPING * f0 + f1) >> 63, b1 = (uint64_t)s1 >> 63;
        bits[i] = (uint8_t)(b0 + 2 * b1);
        s1 += s0;
        s1 += feed_back(b1, 18 * ONE);
        s0 += f1 + add.second0[b0 + 2 * b1];
        f1 += f0;
        f0 += x[i];
        f0 += feed_back(b0, ONE);
    }
    m->first[0] = f0, m->first[1] = f1, m->second[0] = s0, m->second[1] = s1;
}

/* bits[-4] is the oldest that counts. */
static void integrate_bits(struct ads1282_cic *c, unsigned n, const uint8_t *bits)
{
    uint64_t i0 = c->integrator[0], i1 = c->integrator[1], i2 = c->integrator[2], i3 = c->integrator[3],
             i4 = c->integrator[4];
#pragma GCC unroll 4
    for (const uint8_t *b = bits; b < bits + n; b++) {
        i0 += (uint64_t)add.early[b[-4]];
        i1 += i0;
        i2 += i1 + (uint64_t)add.late0[b[-2]] + (uint64_t)add.late1[b[0]];
        i3 += i2;
        i4 += i3;
    }
    const uint64_t sum[5] = {i0, i1, i2, i3, i4};
    memcpy(c->integrator, sum, sizeof sum);
    c->n += n;
}

/* Those of the last clocks, in the place before the next. */
static uint8_t *recall_bits(const struct ads1282_mod *m, unsigned kind, uint8_t bits[ADS1282_MOD_DELAY])
{
    for (unsigned i = 0; i < ADS1282_MOD_DELAY; i++)
        bits[ADS1282_MOD_DELAY - 1 - i] = (uint8_t)(kind | !(m->m0 >> i & 1));
    return bits + ADS1282_MOD_DELAY;
}

void ads1282_mod_run(struct ads1282_mod *m, struct ads1282_cic *c, const int64_t *x, unsigned n)
{
    uint8_t room[ADS1282_MOD_DELAY + ADS1282_MOD_RUN];
    uint8_t *bits = recall_bits(m, 0, room);
    run_loops(m, x, n, bits);
    integrate_bits(c, n, bits);
    for (unsigned i = n < 5 ? 0 : n - 5; i < n; i++) push_bits(m, !(bits[i] & 1), !(bits[i] & 2));
}

void ads1282_mod_take(struct ads1282_mod *m, uint8_t bits)
{
    push_bits(m, bits & 1, bits & 2);
}

void ads1282_mod_play(struct ads1282_mod *m, struct ads1282_cic *c, const uint8_t *bits, unsigned n, bool one_bit)
{
    uint8_t room[ADS1282_MOD_DELAY + ADS1282_MOD_RUN];
    const unsigned kind = one_bit ? ONE_BIT : 0, used = one_bit ? 1 : 3;
    uint8_t *negative = recall_bits(m, kind, room);
    for (unsigned i = 0; i < n; i++) negative[i] = (uint8_t)(kind | (~bits[i] & used));
    integrate_bits(c, n, negative);
    for (unsigned i = n < 5 ? 0 : n - 5; i < n; i++) ads1282_mod_take(m, bits[i]);
}

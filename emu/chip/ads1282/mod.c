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

/* Signs of the clocks of a run and before it, bit 0 the newest: set where the bit is -1. */
struct signs {
    uint64_t m0, m1;
};

static struct signs recall_signs(const struct ads1282_mod *m)
{
    return (struct signs){~m->m0 & 0x1F, ~m->m1 & 0x1F};
}

static void keep_signs(struct ads1282_mod *m, const struct signs *s)
{
    m->m0 = ~s->m0 & 0x1F;
    m->m1 = ~s->m1 & 0x1F;
}

/* As ads1282_mod_step(), modulo 2^64. No branch could be foretold: a negative bit is a mask, and what both signs feed back is in
 * constants. */
static struct signs run_loops(struct ads1282_mod *m, const int64_t *x, unsigned n, struct signs s)
{
    const uint64_t one = (uint64_t)ADS1282_MOD_ONE;
    uint64_t f0 = (uint64_t)m->first[0], f1 = (uint64_t)m->first[1];
    uint64_t s0 = (uint64_t)m->second[0], s1 = (uint64_t)m->second[1];
#pragma GCC unroll 4
    for (unsigned i = 0; i < n; i++) {
        const uint64_t sum = DAMPING * f0 + f1;
        const uint64_t all0 = -(sum >> 63), all1 = -(s1 >> 63), back0 = all0 & 2 * one, back1 = all1 & 18 * one;
        s.m0 = 2 * s.m0 - all0;
        s.m1 = 2 * s.m1 - all1;
        s1 += s0 - 18 * one + 2 * back1;
        s0 += f1 - 12 * one + 3 * back0 + back1;
        f1 += f0;
        f0 += (uint64_t)x[i] - one + back0;
    }
    const uint64_t first[2] = {f0, f1}, second[2] = {s0, s1};
    memcpy(m->first, first, sizeof first); /* two's complement, whatever the compiler makes of a cast */
    memcpy(m->second, second, sizeof second);
    return s;
}

/* ---- Eight clocks of the integrators at once ---- */

/* What signs of eight clocks, bit 0 the newest, add to an integrator and to the four behind it: a clock j ago counts once in the
 * first, and (j + k over k) times in the one k behind. */
#define SIGN(p, j) ((p) >> (j)&1 ? -1 : 1)
#define WEIGH(p, a, b, c, d, e, f, g, h)                                                                               \
    (SIGN(p, 0) * (a) + SIGN(p, 1) * (b) + SIGN(p, 2) * (c) + SIGN(p, 3) * (d) + SIGN(p, 4) * (e) + SIGN(p, 5) * (f) + \
     SIGN(p, 6) * (g) + SIGN(p, 7) * (h))
#define ROW(p)                                                                                                         \
    {                                                                                                                  \
        WEIGH(p, 1, 1, 1, 1, 1, 1, 1, 1), WEIGH(p, 1, 2, 3, 4, 5, 6, 7, 8), WEIGH(p, 1, 3, 6, 10, 15, 21, 28, 36),     \
            WEIGH(p, 1, 4, 10, 20, 35, 56, 84, 120), WEIGH(p, 1, 5, 15, 35, 70, 126, 210, 330)                         \
    }
#define ROWS_4(p)  ROW(p), ROW((p) + 1), ROW((p) + 2), ROW((p) + 3)
#define ROWS_16(p) ROWS_4(p), ROWS_4((p) + 4), ROWS_4((p) + 8), ROWS_4((p) + 12)
#define ROWS_64(p) ROWS_16(p), ROWS_16((p) + 16), ROWS_16((p) + 32), ROWS_16((p) + 48)

static const int64_t added[256][5] = {ROWS_64(0), ROWS_64(64), ROWS_64(128), ROWS_64(192)};

/* M0 into the first integrator, u into the third; signs whose bit 0 is the newest of the eight clocks. */
static inline void integrate_eight(uint64_t i[5], struct signs s, bool one_bit)
{
    const int64_t *early = added[s.m0 >> 4 & 0xFF], *late0 = added[s.m0 >> 2 & 0xFF], *late1 = added[s.m1 & 0xFF];
    const uint64_t i0 = i[0], i1 = i[1], i2 = i[2], i3 = i[3];
    const uint64_t late = one_bit ? 0 : 3;
    i[0] = i0 + (uint64_t)early[0];
    i[1] += 8 * i0 + (uint64_t)early[1];
    i[2] += 8 * i1 + 36 * i0 + (uint64_t)early[2] + late * (uint64_t)(late0[0] + 3 * late1[0]);
    i[3] += 8 * i2 + 36 * i1 + 120 * i0 + (uint64_t)early[3] + late * (uint64_t)(late0[1] + 3 * late1[1]);
    i[4] += 8 * i3 + 36 * i2 + 120 * i1 + 330 * i0 + (uint64_t)early[4] + late * (uint64_t)(late0[2] + 3 * late1[2]);
}

/* The same of the newest clock alone. */
static void integrate_one(uint64_t i[5], struct signs s, bool one_bit)
{
    const uint64_t late = one_bit ? 0 : 3 * (1 - 2 * (s.m0 >> 2 & 1)) + 9 * (1 - 2 * (s.m1 & 1));
    i[0] += 1 - 2 * (s.m0 >> 4 & 1);
    i[1] += i[0];
    i[2] += i[1] + late;
    i[3] += i[2];
    i[4] += i[3];
}

/* The n newest clocks. */
static void integrate_bits(struct ads1282_cic *c, unsigned n, struct signs s, bool one_bit)
{
    uint64_t i[5];
    memcpy(i, c->integrator, sizeof i);
    c->n += n;
    for (; n >= 8; n -= 8) integrate_eight(i, (struct signs){s.m0 >> (n - 8), s.m1 >> (n - 8)}, one_bit);
    while (n-- > 0) integrate_one(i, (struct signs){s.m0 >> n, s.m1 >> n}, one_bit);
    memcpy(c->integrator, i, sizeof i);
}

void ads1282_mod_run(struct ads1282_mod *m, struct ads1282_cic *c, const int64_t *x, unsigned n)
{
    const struct signs s = run_loops(m, x, n, recall_signs(m));
    integrate_bits(c, n, s, false);
    keep_signs(m, &s);
}

void ads1282_mod_take(struct ads1282_mod *m, uint8_t bits)
{
    push_bits(m, bits & 1, bits & 2);
}

void ads1282_mod_play(struct ads1282_mod *m, struct ads1282_cic *c, const uint8_t *bits, unsigned n, bool one_bit)
{
    struct signs s = recall_signs(m);
    for (unsigned i = 0; i < n; i++) {
        s.m0 = s.m0 << 1 | !(bits[i] & 1);
        s.m1 = s.m1 << 1 | !(bits[i] & 2);
    }
    integrate_bits(c, n, s, one_bit);
    keep_signs(m, &s);
}

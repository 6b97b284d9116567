#include "chip/ads1282/cic.h"

#include <string.h>

void ads1282_cic_init(struct ads1282_cic *c, unsigned ratio)
{
    *c = (struct ads1282_cic){.ratio = ratio};
}

bool ads1282_cic_take(struct ads1282_cic *c, int64_t x, int64_t *y)
{
    uint64_t sum = (uint64_t)x;
    for (int s = 0; s < 5; s++) sum = c->integrator[s] += sum;
    if (++c->n < c->ratio) return false;
    c->n = 0;
    for (int s = 0; s < 5; s++) {
        const uint64_t was = c->comb[s];
        c->comb[s] = sum;
        sum -= was;
    }
    memcpy(y, &sum, sizeof sum); /* two's complement, whatever the compiler makes of a cast */
    return true;
}

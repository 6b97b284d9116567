/* An ADS1255/ADS1256 driven by SPI bytes and pins at any instants: what must hold at every moment is in ads1256_world.c. */
#include "ads1256_world.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct w1256 w;
    struct script s = script_of(data, size);
    w1256_init(&w, &s, W1256_BYTES);
    while (w1256_step(&w, &s)) continue;
    return 0;
}

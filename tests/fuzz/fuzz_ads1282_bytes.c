/* An ADS1281/ADS1282 driven by SPI bytes and pins at any instants: what must hold at every moment is in ads1282_world.c. */
#include "ads1282_world.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct w1282 w;
    struct script s = script_of(data, size);
    w1282_init(&w, &s, W1282_BYTES);
    while (w1282_step(&w, &s)) continue;
    return 0;
}

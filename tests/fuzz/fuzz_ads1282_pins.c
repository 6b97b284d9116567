/* An ADS1281/ADS1282 driven edge by edge at its pins: alone, with any edges at all, or beside one that gets the same bytes
 * as bytes, and then they cannot be told apart. */
#include "ads1282_world.h"

static void alone(struct script *s)
{
    static struct w1282 w;
    w1282_init(&w, s, W1282_PINS);
    while (w1282_step(&w, s)) continue;
}

static void beside_bytes(struct script *s)
{
    static struct w1282 pins, bytes;
    struct script t = *s;
    w1282_init(&pins, s, W1282_TWIN_PINS);
    w1282_init(&bytes, &t, W1282_TWIN_BYTES);
    while (w1282_step(&pins, s)) {
        w1282_step(&bytes, &t);
        w1282_same(&pins, &bytes);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct script s = script_of(data, size);
    if (script_byte(&s) & 1) alone(&s);
    else beside_bytes(&s);
    return 0;
}

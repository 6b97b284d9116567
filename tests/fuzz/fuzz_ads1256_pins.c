/* An ADS1255/ADS1256 driven edge by edge at its pins: alone, with any edges at all, or beside one that gets the same bytes
 * as bytes, and then they cannot be told apart. */
#include "ads1256_world.h"

static void alone(struct script *s)
{
    static struct w1256 w;
    w1256_init(&w, s, W1256_PINS);
    while (w1256_step(&w, s)) continue;
}

static void beside_bytes(struct script *s)
{
    static struct w1256 pins, bytes;
    struct script t = *s;
    w1256_init(&pins, s, W1256_TWIN_PINS);
    w1256_init(&bytes, &t, W1256_TWIN_BYTES);
    while (w1256_step(&pins, s)) {
        w1256_step(&bytes, &t);
        w1256_same(&pins, &bytes);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct script s = script_of(data, size);
    if (script_byte(&s) & 1) alone(&s);
    else beside_bytes(&s);
    return 0;
}

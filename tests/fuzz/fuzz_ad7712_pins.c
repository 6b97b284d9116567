/* An AD7710..AD7712 driven at its pins: alone, with any edges at all, or beside one that gets the same frames as words, and
 * then they cannot be told apart. */
#include "ad7712_world.h"

static void alone(struct script *s)
{
    static struct w7712 w;
    w7712_init(&w, s, W7712_PINS, false);
    while (w7712_step(&w, s)) continue;
}

static void beside_words(struct script *s)
{
    static struct w7712 pins, words;
    struct script t = *s;
    w7712_init(&pins, s, W7712_PINS, true);
    w7712_init(&words, &t, W7712_WORDS, true);
    while (w7712_step(&pins, s)) {
        w7712_step(&words, &t);
        w7712_same(&pins, &words);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct script s = script_of(data, size);
    if (script_byte(&s) & 1) alone(&s);
    else beside_words(&s);
    return 0;
}

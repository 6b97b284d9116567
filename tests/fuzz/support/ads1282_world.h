/* One ADS1281/ADS1282 on a bench of its own, driven by a script, and what must hold after every operation. */
#ifndef PSABENCH_TESTS_FUZZ_ADS1282_WORLD_H
#define PSABENCH_TESTS_FUZZ_ADS1282_WORLD_H

#include "fuzz.h"

#include "chip/ads1282/ads1282.h"

/* How bytes reach the chip. Of two worlds driven by one script none gets a byte while something is due, nor after a gap that
 * is too short from rise to rise and long enough from rise to fall: what a word that comes inside a byte tears, and what
 * such a gap is, only the pins show. */
enum w1282_drive { W1282_BYTES, W1282_PINS, W1282_TWIN_BYTES, W1282_TWIN_PINS };

struct w1282 {
    struct sched s;
    struct ads1282 a;
    enum w1282_drive drive;
    double v;
    int64_t asked_ns; /* last instant at which the input was looked at */
    bool drdy, mflag, fallen;
    int64_t drdy_ns, fall_ns, restart_ns; /* last change, last fall; last restart that a pin brought */
    int64_t bits_ns;                      /* last bits of the modulator */
    unsigned bits;
    uint32_t conversions; /* as counted at the last fall */
    uint64_t trail;       /* of all changes of outputs: equal worlds have equal trails */
    struct ads1282_counters seen;
    unsigned quiet;      /* bytes of zeros since the word changed last */
    uint32_t quiet_word; /* its number */
};

/* From the script's first bytes: everything that is soldered; powered up at 0. */
void w1282_init(struct w1282 *w, struct script *s, enum w1282_drive drive);

/* Carries out the next operation and asserts what must hold at any moment; false at the end of the script or of the time. */
bool w1282_step(struct w1282 *w, struct script *s);

/* Asserts that two worlds driven by the same script, one by bytes and one by pins, cannot be told apart. */
void w1282_same(const struct w1282 *a, const struct w1282 *b);

#endif

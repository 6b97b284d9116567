/* One ADS1255/ADS1256 on a bench of its own, driven by a script, and what must hold after every operation. */
#ifndef PSABENCH_TESTS_FUZZ_ADS1256_WORLD_H
#define PSABENCH_TESTS_FUZZ_ADS1256_WORLD_H

#include "fuzz.h"

#include "chip/ads1256/ads1256.h"

/* How bytes reach the chip. Of two worlds driven by one script none gets a byte while something is due: what a word that
 * comes inside a byte tears, only the pins show. */
enum w1256_drive { W1256_BYTES, W1256_PINS, W1256_TWIN_BYTES, W1256_TWIN_PINS };

struct w1256 {
    struct sched s;
    struct ads1256 a;
    enum w1256_drive drive;
    double v[ADS1256_INPUTS];
    bool drdy;
    int64_t drdy_ns, fall_ns, restart_ns; /* last change, last fall; last restart that we asked for at a pin */
    int64_t period_ns, settle_ns;         /* least data period since the fall; least settling time since the restart */
    uint32_t conversions;                 /* as counted at the last fall */
    uint64_t trail;                       /* of all changes of outputs: equal worlds have equal trails */
    struct ads1256_counters seen;
    unsigned quiet;      /* bytes of zeros that the chip took since its word or CS changed last */
    uint32_t quiet_word; /* its number */
};

/* From the script's first bytes: everything that is soldered; powered up at 0. */
void w1256_init(struct w1256 *w, struct script *s, enum w1256_drive drive);

/* Carries out the next operation and asserts what must hold at any moment; false at the end of the script or of the time. */
bool w1256_step(struct w1256 *w, struct script *s);

/* Asserts that two worlds driven by the same script, one by bytes and one by pins, cannot be told apart. */
void w1256_same(const struct w1256 *a, const struct w1256 *b);

#endif

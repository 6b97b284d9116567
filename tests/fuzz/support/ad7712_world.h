/* One AD7710..AD7712 on a bench of its own, driven by a script, and what must hold after every operation. */
#ifndef PSABENCH_TESTS_FUZZ_AD7712_WORLD_H
#define PSABENCH_TESTS_FUZZ_AD7712_WORLD_H

#include "fuzz.h"

#include "chip/ad7712/ad7712.h"

/* How frames reach the chip: edge by edge, or as words. */
enum w7712_drive { W7712_PINS, W7712_WORDS };

struct w7712 {
    struct sched s;
    struct ad7712 a;
    enum w7712_drive drive;
    bool twin; /* two worlds follow one script: frames only, no loose edges of SCLK and SDATA */
    double v[AD7712_CHANNELS], ohm;
    bool drdy, sclk;
    int64_t drdy_ns, fall_ns, look_ns;
    uint32_t conversions; /* as counted at the last fall */
    uint64_t trail;       /* of all changes of DRDY and all that was read: equal worlds have equal trails */
    struct ad7712_counters seen;
};

/* From the script's first bytes: everything that is soldered; powered up at 0. */
void w7712_init(struct w7712 *w, struct script *s, enum w7712_drive drive, bool twin);

/* Carries out the next operation and asserts what must hold at any moment; false at the end of the script or of the time. */
bool w7712_step(struct w7712 *w, struct script *s);

/* Asserts that two worlds driven by the same script, one by edges and one by words, cannot be told apart. */
void w7712_same(const struct w7712 *a, const struct w7712 *b);

#endif

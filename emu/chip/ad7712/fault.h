/* Faults of an AD7712, at its pins and in its clock: included by chip/ad7712/ad7712.h. All zero: none. */
#ifndef PSABENCH_CHIP_AD7712_FAULT_H
#define PSABENCH_CHIP_AD7712_FAULT_H

#include <stdbool.h>
#include <stdint.h>

enum { AD7712_FLIP_REGS = 15 }; /* bytes, high first: control, then zero and full scale of AIN1, then of AIN2 */

enum ad7712_stuck { AD7712_FREE, AD7712_STUCK_HIGH, AD7712_STUCK_LOW };

struct ad7712_fault {
    enum ad7712_stuck drdy;  /* the pin; inside, conversions go on */
    enum ad7712_stuck sdata; /* as an output: what is read is ones or zeros; writes arrive */
    bool lost_sync;          /* the SYNC pin stays high inside */
    int32_t clock_ppm;       /* of the chip's clock against the board's, -500000 .. 500000; rounded to a hertz of it */
};

struct ad7712;

/* From t_ns on, in place of the faults that were; outlives power. Not from inside a callback of the chip. */
void ad7712_fault(struct ad7712 *a, const struct ad7712_fault *f, int64_t t_ns);

/* Inverts bits of a register's byte, as a particle or a bad supply does; the chip acts on what it finds there as if it had
 * been written. False: no such byte, or no power. */
bool ad7712_flip(struct ad7712 *a, unsigned reg, uint8_t mask, int64_t t_ns);

#endif

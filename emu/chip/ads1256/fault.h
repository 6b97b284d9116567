/* Faults of an ADS1255/ADS1256, at its pins and in its clock: included by chip/ads1256/ads1256.h. All zero: none. */
#ifndef PSABENCH_CHIP_ADS1256_FAULT_H
#define PSABENCH_CHIP_ADS1256_FAULT_H

#include <stdbool.h>
#include <stdint.h>

enum ads1256_stuck { ADS1256_FREE, ADS1256_STUCK_HIGH, ADS1256_STUCK_LOW };

struct ads1256_fault {
    enum ads1256_stuck drdy; /* the pin; inside, conversions go on */
    enum ads1256_stuck dout; /* dead: what is read is FFh or 00h */
    bool lost_sync;          /* the SYNC/PDWN pin stays high inside, the command does nothing */
    int32_t clock_ppm;       /* of the chip's clock against the board's, -500000 .. 500000; rounded to a hertz of it */
};

struct ads1256;

/* From t_ns on, in place of the faults that were; outlives resets and power. Not from inside a callback of the chip. */
void ads1256_fault(struct ads1256 *a, const struct ads1256_fault *f, int64_t t_ns);

/* Inverts bits of a register, as a particle or a bad supply does, read-only ones too; the chip acts on what it finds there
 * as if it had been written. False: no such register. */
bool ads1256_flip(struct ads1256 *a, unsigned reg, uint8_t mask, int64_t t_ns);

#endif

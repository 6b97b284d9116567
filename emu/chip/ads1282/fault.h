/* Faults of an ADS1281/ADS1282, at its pins and in its clock: included by chip/ads1282/ads1282.h. All zero: none. */
#ifndef PSABENCH_CHIP_ADS1282_FAULT_H
#define PSABENCH_CHIP_ADS1282_FAULT_H

#include <stdbool.h>
#include <stdint.h>

enum ads1282_stuck { ADS1282_FREE, ADS1282_STUCK_HIGH, ADS1282_STUCK_LOW };

struct ads1282_fault {
    enum ads1282_stuck drdy; /* the pin; inside, conversions go on */
    enum ads1282_stuck dout; /* dead: what is read is FFh or 00h */
    bool lost_sync;          /* SYNC, pin and command, does nothing */
    int32_t clock_ppm;       /* of the chip's clock against the board's, -500000 .. 500000; rounded to a hertz of it */
};

struct ads1282;

/* From t_ns on, in place of the faults that were; outlives resets and power. Not from inside a callback of the chip. */
void ads1282_fault(struct ads1282 *a, const struct ads1282_fault *f, int64_t t_ns);

/* Inverts bits of a register, as a particle or a bad supply does, read-only ones too; the chip acts on what it finds there
 * as if it had been written. False: no such register. */
bool ads1282_flip(struct ads1282 *a, unsigned reg, uint8_t mask, int64_t t_ns);

#endif

/* OFSCAL and GANCAL of the ADS1281 / ADS1282: the mean of sixteen readings becomes OFC or FSC. Sources 1.7. Pure. */
#ifndef PSABENCH_CHIP_ADS1282_CAL_H
#define PSABENCH_CHIP_ADS1282_CAL_H

#include <stdbool.h>
#include <stdint.h>

#define ADS1282_CAL_READINGS 16 /* M80 */

struct ads1282_cal {
    enum { ADS1282_CAL_NONE, ADS1282_CAL_OFFSET, ADS1282_CAL_GAIN } kind;
    unsigned left; /* readings still wanted */
    int64_t sum;   /* of those taken, in LSB of 2^-30 full scale */
};

/* Takes a reading; true when it was the last. */
bool ads1282_cal_take(struct ads1282_cal *c, int64_t y_lsb);

/* OFC that makes the mean zero: 24 bits, saturating. */
int32_t ads1282_cal_ofc(const struct ads1282_cal *c);

/* FSC that makes the mean, less ofc, full scale: saturates at FFFFFFh, also where it would not be positive (E0). */
uint32_t ads1282_cal_fsc(const struct ads1282_cal *c, int32_t ofc);

#endif

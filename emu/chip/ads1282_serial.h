/* Where the two columns of the ADS1282 model meet: private to ads1282.c (converter) and ads1282_serial.c (serial port).
 * The serial column decodes commands and holds the output register; it never touches the filter. */
#ifndef PSABENCH_CHIP_ADS1282_SERIAL_H
#define PSABENCH_CHIP_ADS1282_SERIAL_H

#include "chip/ads1282.h"

/* Of ads1282_serial.c, called by the converter column. */
void ads1282_serial_init(struct ads1282 *a);
void ads1282_serial_reset(struct ads1282 *a); /* RDATAC, no command under way, DOUT low */
void ads1282_serial_deliver(struct ads1282 *a, uint32_t word, int64_t t_ns); /* a conversion has ended */
void ads1282_serial_period(struct ads1282 *a); /* a data period has ended, settled or not: interface time-out */

/* Of ads1282.c, called by the serial column. */
void ads1282_set_drdy(struct ads1282 *a, bool level, int64_t t_ns);
void ads1282_sync(struct ads1282 *a, int64_t t_ns);
void ads1282_reset(struct ads1282 *a, int64_t t_ns);

#endif

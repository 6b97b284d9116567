/* Where the columns of the ADS1282 model meet: private to ads1282*.c. The serial column (ads1282/port.c, ads1282/pins.c)
 * decodes commands and holds the output register; it never touches a filter. The converter column (ads1282/conv.c: data
 * periods; ads1282/chain.c: input samples to results) never looks at a command. ads1282/regs.c holds registers and power. */
#ifndef PSABENCH_CHIP_ADS1282_INTERNAL_H
#define PSABENCH_CHIP_ADS1282_INTERNAL_H

#include "chip/ads1282/ads1282.h"
#include "chip/ads1282/input.h"

#define ADS1282_PULSE_TCLK 4 /* DRDY high when no one read; E2 ADS1287, M80 */

/* Rate code of CONFIG0; 5 to 7 are reserved. */
static inline unsigned ads1282_rate(const struct ads1282 *a)
{
    return (a->config0 & ADS1282_CONFIG0_DR) >> 3;
}

/* tCLK from the restart to the end of data period p. */
static inline int64_t ads1282_due_tclk(const struct ads1282 *a, int64_t p)
{
    return a->timing.first_tclk + p * a->timing.period_tclk;
}

/* ---- Serial column ---- */

void ads1282_serial_init(struct ads1282 *a);
void ads1282_serial_reset(struct ads1282 *a); /* RDATAC, no command under way, DOUT low */
void ads1282_serial_times(struct ads1282 *a); /* the clock's rate has changed */
void ads1282_serial_stuck(struct ads1282 *a); /* DOUT has got stuck, in mid-byte too */
void ads1282_serial_clear(struct ads1282 *a); /* no word in the output register */
void ads1282_serial_deliver(struct ads1282 *a, uint32_t word, int64_t t_ns); /* a conversion has ended */
void ads1282_serial_period(struct ads1282 *a); /* a data period has ended, settled or not: interface time-out */
void ads1282_serial_gap(struct ads1282 *a, int64_t t_ns);  /* a byte begins: how long since a command's last? */
void ads1282_serial_fall(struct ads1282 *a, int64_t t_ns); /* SCLK falls, first of a byte or not */

/* ---- Converter column: ads1282/conv.c ---- */

void ads1282_conv_init(struct ads1282 *a);
void ads1282_configure(struct ads1282 *a);             /* everything from CONFIG0, CONFIG1 or the mode pins */
void ads1282_configure_input(struct ads1282 *a);       /* gain, multiplexer, noise */
void ads1282_restart(struct ads1282 *a, int64_t t_ns); /* clears the filter, starts it at the next CLK edge */
void ads1282_sync(struct ads1282 *a, int64_t t_ns);    /* SYNC: opcode or pin */
void ads1282_calibrate(struct ads1282 *a, bool gain, int64_t t_ns);
void ads1282_set_drdy(struct ads1282 *a, bool level, int64_t t_ns);
void ads1282_retime(struct ads1282 *a); /* the clock's rate has changed */

/* ---- Converter column: ads1282/chain.c ---- */

void ads1282_chain_configure(struct ads1282 *a); /* origin, step, lag, sample function and filter of the present mode */
void ads1282_chain_restart(struct ads1282 *a);   /* from sync_count on */
bool ads1282_chain_forgets(const struct ads1282 *a);         /* its past is finite */
void ads1282_chain_resume(struct ads1282 *a, int64_t index); /* samples again, from this one on, without a past */
double ads1282_chain_noise_lsb(const struct ads1282 *a, double output_lsb); /* scale of its draws */
struct ads1282_range ads1282_input_range(const struct ads1282 *a);

unsigned ads1282_sinc_ratio(const struct ads1282 *a); /* N of the present rate; of 1000 words/s where it is reserved */
bool ads1282_sinc_only(const struct ads1282 *a);      /* FILTR = 01 */
bool ads1282_bits_only(const struct ads1282 *a);      /* FILTR = 00 */

/* ---- Registers and power: ads1282/regs.c ---- */

void ads1282_reset(struct ads1282 *a, int64_t t_ns);
void ads1282_standby(struct ads1282 *a, int64_t t_ns);
void ads1282_wakeup(struct ads1282 *a, int64_t t_ns);

#endif

/* Between the files of the ADS1255/ADS1256; no other file includes it.
 *
 * ads1256/regs.c registers, reset and power; ads1256/port.c bytes to commands; ads1256/pins.c edges of SCLK and DIN;
 * ads1256/gpio.c D0..D3 and CLKOUT; ads1256/input.c pins to volts; ads1256/conv.c conversions and calibrations on the
 * clock's grid; ads1256/filter.c the arithmetic, pure.
 * A run is a row of conversions on one time grid: it begins at a CLKIN edge, DRDY falls t18 later and then every data
 * period. A calibration is a wait whose end begins a run. */
#ifndef PSABENCH_CHIP_ADS1256_INTERNAL_H
#define PSABENCH_CHIP_ADS1256_INTERNAL_H

#include "chip/ads1256/ads1256.h"

enum { ADS1256_POWER_DOWN_PERIODS = 20, ADS1256_WAKE_TAU = 256 /* more after standby: modulator up, SBAS288 p. 22 */ };

#define ADS1256_AVDD_LESS_V 2.0 /* range of the buffer, and the clamp of the sensor-detect current: 3 V of 5 */

static inline uint8_t ads1256_value(const struct ads1256 *a, enum ads1256_reg r)
{
    return a->value[r];
}

static inline unsigned ads1256_pga_log2(const struct ads1256 *a)
{
    return ads1256_gain_log2(a->value[ADS1256_ADCON] & ADS1256_ADCON_PGA);
}

static inline int64_t ads1256_tau_ns(const struct ads1256 *a, int64_t tau)
{
    return clk_span_ns(a->clkin.hz, tau);
}

/* No clock or in reset: the serial port is deaf. */
static inline bool ads1256_deaf(const struct ads1256 *a)
{
    return a->mode == ADS1256_OFF || a->mode == ADS1256_IN_RESET;
}

/* What DOUT makes of a byte. */
static inline uint8_t ads1256_on_wire(const struct ads1256 *a, uint8_t byte)
{
    return (uint8_t)chip_fault_word(a->fault.dout, byte, 0xFF);
}

static inline void ads1256_refuse(struct ads1256 *a, uint8_t opcode)
{
    a->n.refused++;
    a->refused_opcode = opcode;
}

/* ---- ads1256/regs.c ---- */

/* Registers to default, the converter halted in mode, a self-calibration due. keep: bits of ADCON that survive. */
void ads1256_reset_chip(struct ads1256 *a, enum ads1256_mode mode, uint8_t keep, int64_t t_ns);

/* Begins what is due: nothing while RESET or SYNC/PDWN is low, a calibration that waits, or a run. */
void ads1256_go(struct ads1256 *a, int64_t t_ns);

/* ---- ads1256/port.c ---- */

void ads1256_serial_init(struct ads1256 *a);
void ads1256_port_idle(struct ads1256 *a);       /* forgets a command in progress and RDATAC */
bool ads1256_half_read(const struct ads1256 *a); /* some bytes of the word are read or on their way, others not */
void ads1256_port_drop(struct ads1256 *a); /* what CS high does: a partial command or read is dropped and counted */
bool ads1256_has_output(const struct ads1256 *a); /* the next byte comes from a register or the word */

/* ---- ads1256/pins.c ---- */

void ads1256_pins_init(struct ads1256 *a);
void ads1256_pins_refresh(struct ads1256 *a, int64_t t_ns); /* DOUT has got stuck, or free */
void ads1256_pins_release(struct ads1256 *a, int64_t t_ns); /* DOUT to high impedance, the bits realigned */

/* ---- ads1256/gpio.c ---- */

void ads1256_gpio_written(void *chip, uint8_t was, uint8_t now, int64_t t_ns); /* hook of IO */
void ads1256_gpio_show(struct ads1256 *a, int64_t t_ns); /* DIO as a read shows it; reports outputs that changed */

/* ---- ads1256/input.c ---- */

/* AINP - AINN as the PGA sees them. */
double ads1256_input_v(struct ads1256 *a, int64_t t_ns);

/* ---- ads1256/conv.c ---- */

void ads1256_conv_init(struct ads1256 *a);
void ads1256_retime(struct ads1256 *a); /* the clock's rate has changed */

/* A run of conversions that began at CLKIN count start_tau: the first DRDY is t18 later. */
void ads1256_start_run(struct ads1256 *a, int64_t start_tau);

/* No code of these volts reaches a limit, whatever the noise draws. */
bool ads1256_in_range(const struct ads1256 *a, double low_v, double high_v);

/* Moves the pin and the DRDY bit of STATUS. */
void ads1256_set_drdy(struct ads1256 *a, bool level, int64_t t_ns);

/* Stops whatever runs. */
void ads1256_freeze(struct ads1256 *a, enum ads1256_mode mode);

/* And DRDY goes high. */
void ads1256_halt(struct ads1256 *a, enum ads1256_mode mode, int64_t t_ns);

/* A new run from the first CLKIN edge at or after t_ns, extra_tau later. */
void ads1256_restart(struct ads1256 *a, int64_t extra_tau, int64_t t_ns);

/* DRDY high, measure, store OFC and FSC, settle, DRDY low after the printed duration. Waits while the converter is held. */
void ads1256_calibrate(struct ads1256 *a, enum ads1256_cal kind, int64_t t_ns);

#endif

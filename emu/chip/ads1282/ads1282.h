/* ADS1281 / ADS1282: delta-sigma converter for energy exploration.
 *
 * Two columns that meet in the register file and the output word: SPI -> commands -> registers, and input voltage ->
 * modulator -> sinc5 -> FIR -> high-pass -> OFC/FSC -> clip -> word -> DRDY. No chip select on this part: everything
 * clocked on SCLK reaches it. The struct is owned and embedded by the board and must not move after ads1282_init(); no
 * allocation, one thread. Whatever happens at a moment takes t_ns, simulated nanoseconds, which may not run back; the
 * scheduler must have been run up to it. docs/chips/ads1282.md holds the fidelity table; origin of the numbers:
 * docs/sources.md section 1. */
#ifndef PSABENCH_CHIP_ADS1282_ADS1282_H
#define PSABENCH_CHIP_ADS1282_ADS1282_H

#include "base/draws.h"
#include "base/sched.h"
#include "chip/ads1282/cfg.h"
#include "chip/ads1282/state.h"

#include <stdbool.h>
#include <stdint.h>

void ads1282_init(struct ads1282 *a, const struct ads1282_cfg *cfg, const struct ads1282_io *io, struct sched *s,
                  struct draws noise);

/* Supplies and clock are good at t_ns: registers to default, RDATAC, first settled DRDY after cfg.power_up_tclk and t_DR. */
void ads1282_power_up(struct ads1282 *a, int64_t t_ns);

/* They fail: everything is forgotten but the counters, DRDY and DOUT mean nothing. */
void ads1282_power_off(struct ads1282 *a, int64_t t_ns);

/* ---- Input pins. The same level again changes nothing. ---- */

void ads1282_reset_pin(struct ads1282 *a, bool level, int64_t t_ns); /* active low; t_DR counts from its rise */
void ads1282_sync_pin(struct ads1282 *a, bool level, int64_t t_ns);  /* rising edge synchronises */
void ads1282_pwdn_pin(struct ads1282 *a, bool level, int64_t t_ns);  /* active low; its rise is a power-up */
void ads1282_sclk_pin(struct ads1282 *a, bool level, int64_t t_ns);  /* rest low; DIN is taken at the rise */
void ads1282_din_pin(struct ads1282 *a, bool level, int64_t t_ns);

/* Only with cfg.pin_mode: what DR[1:0] and the other mode pins say from now on. A change restarts. All low before. */
void ads1282_mode_pins(struct ads1282 *a, const struct ads1282_mode_pins *pins, int64_t t_ns);

/* ---- Output pins ---- */

bool ads1282_dout(const struct ads1282 *a);  /* changes at SCLK falls, and with DRDY's fall while SCLK is low */
bool ads1282_drdy(const struct ads1282 *a);  /* active low */
bool ads1282_mflag(const struct ads1282 *a); /* the newest input sample was at or beyond full scale */

/* ---- The serial port byte by byte, or bit by bit without SCLK ---- */

/* Instead of the SCLK and DIN pins, not mixed with them inside a byte: a->spi, driven with spi_first() and spi_byte(), or
 * bit by bit (mode 0: spi_miso and spi_sample at each rising edge, spi_first after the first of each byte). The state is
 * the same; only the pins show the limits of struct ads1282_limits. */

/* For a bus that reads a word at one go, nothing being due before its end: whether bytes of zeros only shift the output
 * register out, asked after spi_first() of the first; if so, n of them in place of spi_byte() and of the other
 * spi_first(), the last ended at t_ns. */
bool ads1282_only_shifts(const struct ads1282 *a);
void ads1282_shift(struct ads1282 *a, uint8_t *out, unsigned n, int64_t t_ns);

/* ---- For the owner ---- */

/* Samples the input up to and including t_ns. For a caller about to change the input abruptly: it is otherwise sampled,
 * each sample at its own instant, when a data period ends. */
void ads1282_sample_until(struct ads1282 *a, int64_t t_ns);

/* From a restart at t_ns on the words come from these bits, at the modulator's rate whatever cfg.chain is; volts and noise do
 * not matter, MFLAG stays low. Its clocks go by with MCLK, resets and later restarts or not; those past its end are counted. */
void ads1282_play(struct ads1282 *a, const struct ads1282_recording *r, int64_t t_ns);

/* ---- Words that no one looks at ---- */

/* Why each word has to be computed, for volts at the input within a range; NULL: it need not. A sentence's end. */
const char *ads1282_why_eager(const struct ads1282 *a, struct looks_range vin_v);

/* Settled, its last word read, nothing under way: put_off() may come. more_periods: as of ads1282_resume(). */
bool ads1282_rests(const struct ads1282 *a, int64_t more_periods);

void ads1282_put_off(struct ads1282 *a);          /* words are 0 from here on, no samples are taken */
void ads1282_skip(struct ads1282 *a, uint32_t n); /* n data periods pass, each word read in time; between two ends */

/* Words are computed again. The samples that the filter still holds, and those of more_periods before, are to be taken by ads1282_sample_until() the ends of
 * the data periods from the returned one to the last; *before_ns: of the sample before these. */
int64_t ads1282_resume(struct ads1282 *a, int64_t more_periods, int64_t *before_ns);
int64_t ads1282_end_ns(const struct ads1282 *a, int64_t period); /* DRDY falls, if the word is settled */

/* CONFIG0 gives one settled FIR word a data period and nothing else: pulse sync, sinc + FIR, a published rate. What a
 * controller can read that knows no other mode. */
bool ads1282_models(uint8_t config0);

int64_t
ads1282_settle_ns(const struct ads1282 *a); /* restart to first settled DRDY with the present CONFIG0; 0: none */
int64_t ads1282_period_ns(const struct ads1282 *a); /* DRDY to DRDY with the present CONFIG0, rounded down; 0: none */
int64_t ads1282_delay_ns(const struct ads1282 *a);  /* group delay at DC, input to DRDY, with the present CONFIG0 */
double ads1282_dc_gain(const struct ads1282 *a);    /* of the filter's integer taps; 1 of the sinc alone */

/* ---- Faults ---- */

/* From t_ns on, in place of the faults that were; outlives resets and power. Not from inside a callback of the chip. */
void ads1282_fault(struct ads1282 *a, const struct chip_fault *f, int64_t t_ns);

/* A register is flipped by reg_flip() on a->regs: the chip acts on what it finds there as if it had been written. */

#endif

/* ADS1255 / ADS1256: 24-bit delta-sigma converter with multiplexer, buffer, PGA, self- and system calibration, GPIO.
 *
 * Two columns that meet in the register file and the output word: SPI bytes -> commands -> registers, and pin voltages ->
 * multiplexer, buffer, PGA -> sinc5 and mean -> OFC/FSC -> clip -> word -> DRDY. SPI mode 1 with chip select: with CS high
 * the chip ignores the bus. There is no data on DOUT without RDATA or RDATAC. The struct is owned and embedded by the
 * board and must not move after init; no allocation, one thread. docs/chips/ads1256.md holds the fidelity table and the
 * readings we chose, docs/sources.md section 2 their origin. */
#ifndef PSABENCH_CHIP_ADS1256_ADS1256_H
#define PSABENCH_CHIP_ADS1256_ADS1256_H

#include "base/chip_fault.h"
#include "base/clk.h"
#include "base/draws.h"
#include "base/reg.h"
#include "base/sched.h"
#include "base/spi.h"
#include "chip/ads1256/cfg.h"
#include "chip/ads1256/filter.h"

#include <stdbool.h>
#include <stdint.h>

enum ads1256_mode {
    ADS1256_OFF,         /* no clock: before power-up, power-down, or the oscillator is starting */
    ADS1256_IN_RESET,    /* RESET low */
    ADS1256_CALIBRATING, /* measuring; its settling is already a normal run */
    ADS1256_RUNNING,
    ADS1256_SYNC_WAIT, /* SYNC command given, WAKEUP awaited: only with sync_halts */
    ADS1256_SYNC_LOW,  /* SYNC/PDWN pin low */
    ADS1256_STANDBY    /* STANDBY command given, WAKEUP awaited */
};

enum ads1256_port { ADS1256_OPCODE, ADS1256_COUNT, ADS1256_WRITE, ADS1256_READ, ADS1256_WORD, ADS1256_PORTS };

/* SCLK, DIN and DOUT while they are driven as pins. */
struct ads1256_pins {
    bool sclk, din, din_was; /* levels; din_was: before the latest change */
    bool dout, driven;       /* DOUT: level on the wire, and whether it is ours */
    bool open;               /* the first SCLK edge of the present byte has been seen */
    bool lost;               /* the present SCLK pulse is not seen */
    uint8_t pattern;         /* pulses of the reset pattern so far */
    int64_t rise_ns, fall_ns, din_ns;
    struct sched_ev hiz_ev;
};

/* Plain; read-only outside ads1256*.c. */
struct ads1256 {
    struct ads1256_cfg cfg;
    struct ads1256_io io;
    struct chip_fault fault;
    void (*notify_drdy)(void *ctx, bool level, int64_t t_ns); /* io.drdy, which is ignored while DRDY is stuck */
    struct sched *sched;
    struct draws noise;
    struct clk clkin;
    struct ads1256_counters n;
    uint8_t refused_opcode; /* the latest one, for the shell */

    struct reg_file regs;
    uint8_t value[ADS1256_REGS];
    uint8_t dio_latch, dio_in, dio_notified; /* D3..D0: written, seen at the pins, levels last reported to io.gpio */

    /* serial port */
    struct spi spi;
    struct ads1256_pins pins;
    bool cs, sync, reset, drdy; /* pin levels */
    enum ads1256_port port;
    uint8_t opcode, addr, left;   /* of the command in progress; left: bytes to come */
    uint8_t before[ADS1256_REGS]; /* registers before the WREG in progress */
    uint8_t word_left;            /* bytes of the word not yet shifted out, 3..0 */
    bool begun, in_word;          /* one of them is on its way, loaded at its first SCLK; has just been shifted out */
    bool rdatac, after_sdatac, awaiting_data, garbled, first_drdy;
    bool early;         /* the present byte began before next_ok_ns */
    int64_t first_ns;   /* first SCLK edge of the present byte */
    int64_t command_ns; /* end of the latest byte */
    int64_t next_ok_ns; /* no command before (t11) */

    /* conversion */
    enum ads1256_mode mode;
    const struct ads1256_rate *rate, *rate_next; /* next: from the end of the running conversion */
    struct ads1256_mean mean;
    struct sched_ev cell_ev, ready_ev, pulse_ev, cal_ev, start_ev, power_down_ev;
    int64_t start_tau;   /* CLKIN count where the present run began */
    int64_t cell, ready; /* next cell and conversion of the run */
    enum ads1256_cal cal;
    bool sync_due, cal_due; /* a SYNC waits for WAKEUP; a calibration for the converter to start */
    bool updating;          /* in the 16 tau before a new word */
    int32_t word;           /* 24-bit code */
    bool unread;
    bool powered_down;  /* by SYNC/PDWN, which is still low */
    int64_t pin_low_ns; /* when SYNC or RESET went low */
};

void ads1256_init(struct ads1256 *a, const struct ads1256_cfg *cfg, const struct ads1256_io *io, struct sched *s,
                  struct draws noise);

/* Supplies are good: after the time of cfg.start registers to default, self-calibration at default settings, then DRDY
 * falls. */
void ads1256_power_up(struct ads1256 *a, int64_t t_ns);

/* They fail: everything is forgotten but the counters. */
void ads1256_power_off(struct ads1256 *a, int64_t t_ns);

void ads1256_reset_pin(struct ads1256 *a, bool level, int64_t t_ns); /* active low */
void ads1256_sync_pin(struct ads1256 *a, bool level, int64_t t_ns);  /* SYNC/PDWN: restart on the rising edge */
void ads1256_cs_pin(struct ads1256 *a, bool level, int64_t t_ns);    /* active low; high drops a partial command */

/* Serial port, two ways to one state, to be mixed at byte boundaries only.
 * Bytes: spi_first() at the first SCLK edge of a byte (rising; who knows only the falling one is judged half a period
 * late), spi_byte() at its last falling edge, both on a->spi; or bit by bit with spi_sample().
 * Pins: SCLK idles low, DIN is taken on its falling edge, DOUT changes on its rising edge. Here t1, t2, t4, t5 are
 * judged and the reset pattern is seen. */
void ads1256_sclk_pin(struct ads1256 *a, bool level, int64_t t_ns);
void ads1256_din_pin(struct ads1256 *a, bool level, int64_t t_ns);
bool ads1256_dout(const struct ads1256 *a); /* level on the wire; low in high impedance, where not a->pins.driven */

/* D0..D3 (ADS1255: D0, D1; others are ignored and read low). */
void ads1256_gpio_pin(struct ads1256 *a, unsigned d, bool level, int64_t t_ns); /* what drives an input; at first low */
bool ads1256_gpio(const struct ads1256 *a, unsigned d);                         /* level on the wire now, CLKOUT too */
bool ads1256_gpio_is_output(const struct ads1256 *a, unsigned d);
uint32_t ads1256_clkout_hz(const struct ads1256 *a); /* 0: D0 is no clock. Its edges are not reported to io.gpio */

bool ads1256_drdy(const struct ads1256 *a);
int64_t ads1256_settle_ns(const struct ads1256 *a); /* t18 of the present DRATE */

/* ---- Words that no one looks at ---- */

/* One conversion after another, each begun by SYNC/PDWN and read before the next is there. */
struct ads1256_run {
    int64_t start_tau; /* CLKIN count */
    int64_t ready_ns;  /* the first word */
    int64_t again_ns;  /* t17 before the second */
};

/* The present run may be replaced by a later one: its first word is still to come, and with volts of the inputs between these
 * no counter would move but those of conversions and restarts. */
bool ads1256_may_skip(const struct ads1256 *a, double low_v, double high_v);
struct ads1256_run ads1256_run_now(const struct ads1256 *a);
struct ads1256_run ads1256_run_from(const struct ads1256 *a, int64_t t_ns); /* SYNC/PDWN rises at t_ns */

/* n runs have passed, each of one word that was read; the last has just begun, with that MUX. It may lie ahead. */
void ads1256_skip(struct ads1256 *a, uint32_t n, uint8_t mux, const struct ads1256_run *last);

/* ---- Faults ---- */

/* From t_ns on, in place of the faults that were; outlives resets and power. Not from inside a callback of the chip. */
void ads1256_fault(struct ads1256 *a, const struct chip_fault *f, int64_t t_ns);

/* A register is flipped by reg_flip() on a->regs: the chip acts on what it finds there as if it had been written. */

#endif

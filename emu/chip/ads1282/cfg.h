/* What an ADS1281/ADS1282 is given and what it counts: register names, soldered configuration, callbacks, counters. */
#ifndef PSABENCH_CHIP_ADS1282_CFG_H
#define PSABENCH_CHIP_ADS1282_CFG_H

#include "base/looks.h"

#include <stdbool.h>
#include <stdint.h>

enum ads1282_reg {
    ADS1282_ID,
    ADS1282_CONFIG0,
    ADS1282_CONFIG1,
    ADS1282_HPF0,
    ADS1282_HPF1,
    ADS1282_OFC0,
    ADS1282_OFC1,
    ADS1282_OFC2,
    ADS1282_FSC0,
    ADS1282_FSC1,
    ADS1282_FSC2,
    ADS1282_REGS
};

/* Fields. */
#define ADS1282_CONFIG0_SYNC  0x80u /* 1 continuous, 0 pulse synchronisation */
#define ADS1282_CONFIG0_DR    0x38u /* 000 250 .. 010 1000 .. 100 4000 words/s at 4.096 MHz */
#define ADS1282_CONFIG0_PHASE 0x04u /* 1 minimum phase */
#define ADS1282_CONFIG0_FILTR 0x03u /* 00 modulator bits, 01 sinc, 10 sinc and FIR, 11 these and the high-pass */
#define ADS1282_CONFIG1_MUX   0x70u
#define ADS1282_CONFIG1_PGA   0x07u

enum ads1282_part { ADS1282_PART_1281, ADS1282_PART_1282 };

/* How volts become words. Registers, times, DRDY and the serial port are the same with all three. */
enum ads1282_chain {
    ADS1282_CHAIN_EXACT,     /* ideal modulator, bit-true sinc5 and FIR: the default */
    ADS1282_CHAIN_MODULATOR, /* bit-true fourth-order modulator at CLK/4, sinc5 at its rate, the same FIR */
    ADS1282_CHAIN_DIRECT     /* no chain: the input of one chain delay ago and the published noise, for long runs */
};

/* Soldered: set once. */
struct ads1282_cfg {
    enum ads1282_part part;
    uint32_t clk_hz;    /* 1 MHz .. 4.096 MHz; its edge 0 is at simulated time 0, so that chips with one clock agree */
    double vref_v;      /* VREFP - VREFN */
    double noise_scale; /* 1: published noise, 0: noiseless converter, nothing drawn */
    /* Middle of both inputs over ground, the signal half on each. 0: their range is not looked at, else avss_v and avdd_v limit it. */
    double common_mode_v, avss_v, avdd_v;

    /* Where sources disagree or practice is kinder than the data sheet. All false: the kind reading. */
    bool strict_sdatac; /* in RDATAC obey only WAKEUP, SDATAC and RESET (sources 1.3) */
    bool strict_gap;    /* a byte sooner than 24 tCLK after a command's last is lost, and its command with it (1.3) */
    bool wreg_gap_free; /* bytes of WREG, command bytes of RREG need no gap: neither counted nor lost (1.3, TI's own) */
    bool strict_sync; /* a SYNC rise within 30 ns before a CLK edge is taken by the one after it, a rise after less than
                            2 tCLK low by none (1.4) */
    bool strict_config0; /* each write to CONFIG0 restarts, even one that changes nothing (1.6) */
    bool cal_corrected;  /* OFSCAL and GANCAL measure with OFC and FSC acting, not the raw filter output (1.7) */

    bool pin_mode;          /* ADS1281 with PINMODE high: ads1282_mode_pins() in place of registers and commands */
    uint32_t power_up_tclk; /* internal reset after power-up and PWDN: 65536 in the data sheet (1.6, M75); 0: none */
    enum ads1282_chain chain;
};

/* Everything the chip can reach. Only the input must be there. */
struct ads1282_io {
    void *ctx;
    /* Differential input of multiplexer code mux (0 AIN1, 1 AIN2, 3 both, 4 AINN2 short; code 2 is shorted inside), volts,
     * at t_ns: up to one data period ago, never earlier than the last call. */
    double (*vin_v)(void *ctx, unsigned mux, int64_t t_ns);
    /* The same for a row of samples, in place of vin_v; may be NULL. */
    void (*vin_row_v)(void *ctx, unsigned mux, const struct looks *at, double *vin_v);
    void (*drdy)(void *ctx, bool level, int64_t t_ns);  /* DRDY pin, active low; called on changes only */
    void (*mflag)(void *ctx, bool level, int64_t t_ns); /* MFLAG pin; costs an event for each input sample */
    /* Pins M0 and M1 at each MCLK (CLK/4) while CONFIG0 FILTR = 00; not given: the bits are not computed. */
    void (*modulator)(void *ctx, bool m0, bool m1, int64_t t_ns);
};

/* What the bus asked for and the chip rejected or suffered. Never cleared. */
struct ads1282_counters {
    uint32_t conversions, overruns; /* settled words; overrun: a word was replaced before it was read */
    uint32_t torn_reads;            /* a word was replaced while it was being read */
    uint32_t late_reads;            /* SCLK moved in the last 4 tCLK before a word under way was replaced */
    uint32_t bad_opcodes;
    uint32_t refused; /* RREG or RDATA in RDATAC, what a strict switch forbids, reserved codes of CONFIG0, CONFIG1 */
    uint32_t gap_violations; /* less than 24 tCLK between command bytes */
    uint32_t restarts;       /* SYNC, and writes that change CONFIG0 */
    uint32_t clipped;        /* words at the limit of the format */
    uint32_t range_exceeded; /* samples of which one input was outside its range over the supplies */
    uint32_t realigned;      /* SCLK rested for 64 data periods inside a byte or command: interface time-out */
    uint32_t calibrations;   /* OFSCAL and GANCAL carried to their end */
    uint32_t bits_missing;   /* clocks of the modulator past the end of a recording */
};

/* Limits of sources 1.4 that the pins broke: counted, without effect. Only the pin-level functions can see them. */
struct ads1282_limits {
    uint32_t sclk_period;  /* below 2 tCLK, or above 16 tCLK inside a byte */
    uint32_t sclk_width;   /* high or low below 0.8 tCLK; high, or low inside a byte, above 10 tCLK */
    uint32_t din_setup;    /* DIN moved less than 50 ns before an SCLK rise */
    uint32_t din_hold;     /* or less than 50 ns after one */
    uint32_t drdy_to_sclk; /* first SCLK rise of a word less than 100 ns after DRDY fell */
    uint32_t sync_width;   /* SYNC high or low for less than 2 tCLK */
    uint32_t sync_keepout; /* SYNC rise closer than 30 ns to a CLK edge */
    uint32_t reset_width;  /* RESET low for less than 2 tCLK */
};

/* Bits of another modulator, that of a real chip for instance, in place of ours. They are the caller's, and stay. */
struct ads1282_recording {
    const uint8_t
        *bits; /* a byte a clock of the modulator: bit 0 M0, bit 1 M1, as the pins show them; NULL: our modulator */
    int64_t count;
    bool one_bit; /* bit 0 alone, the input itself: +-1 is +-5/4 of full scale, as in M0 */
    int64_t edge; /* CLK edge of its first clock; -1: the next that is sampled */
};

/* ADS1281 with PINMODE high. */
struct ads1282_mode_pins {
    uint8_t dr; /* DR[1:0]: 00 250, 01 500, 10 1000, 11 2000 words/s at 4.096 MHz */
    bool minimum_phase, high_pass, continuous_sync;
};

#endif

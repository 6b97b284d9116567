/* ADS1281 / ADS1282: delta-sigma converter for energy exploration, register mode.
 *
 * Two columns that meet in the register file and the output word: SPI bytes -> commands -> registers, and input voltage
 * -> ideal modulator -> sinc5 -> FIR -> OFC/FSC -> clip -> word -> DRDY. No chip select on this part: everything clocked
 * on SCLK reaches it. The struct is owned and embedded by the board and must not move after ads1282_init(); no allocation,
 * one thread. Not modelled: STANDBY, OFSCAL, GANCAL (counted in `refused`, no effect); continuous sync, high-pass,
 * sinc-only and modulator output (CONFIG0 is stored, counted in `refused`, and the converter stands still with DRDY high
 * until CONFIG0 names a modelled mode); pin mode, MFLAG, power-down. docs/chips/ads1282.md holds the fidelity table.
 * Origin of the numbers: docs/sources.md section 1. */
#ifndef PSABENCH_CHIP_ADS1282_H
#define PSABENCH_CHIP_ADS1282_H

#include "base/clk.h"
#include "base/reg.h"
#include "base/rng.h"
#include "base/sched.h"
#include "base/spi.h"
#include "chip/ads1282_filter.h"

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
#define ADS1282_CONFIG0_FILTR 0x03u /* 10 sinc and FIR low-pass */
#define ADS1282_CONFIG1_MUX   0x70u
#define ADS1282_CONFIG1_PGA   0x07u

enum ads1282_part { ADS1282_PART_1281, ADS1282_PART_1282 };

/* Soldered: set once. */
struct ads1282_cfg {
    enum ads1282_part part;
    uint32_t clk_hz;    /* 1 MHz .. 4.096 MHz; its edge 0 is at simulated time 0, so that chips with one clock agree */
    double vref_v;      /* VREFP - VREFN */
    double noise_scale; /* 1: published noise, 0: noiseless converter, nothing drawn */
    bool strict_sdatac; /* in RDATAC obey only SDATAC and RESET (vendors disagree: sources 1.3) */
};

/* Everything the chip can reach. */
struct ads1282_io {
    void *ctx;
    /* Differential input of multiplexer code mux (0 AIN1, 1 AIN2, 3 both, 4 AINN2 short; code 2 is shorted inside), volts,
     * at t_ns: up to one data period ago, never earlier than the last call. */
    double (*vin_v)(void *ctx, unsigned mux, int64_t t_ns);
    void (*drdy)(void *ctx, bool level, int64_t t_ns); /* DRDY pin, active low; called on changes only; may be NULL */
};

/* What the bus asked for and the chip refused or suffered. Never cleared. */
struct ads1282_counters {
    uint32_t conversions, overruns; /* settled words; overrun: a word was replaced before it was read */
    uint32_t torn_reads;            /* a word was replaced while it was being read */
    uint32_t bad_opcodes;
    uint32_t refused;        /* RREG or RDATA in RDATAC, anything strict_sdatac forbids, whatever is not modelled */
    uint32_t gap_violations; /* less than 24 tCLK between command bytes: a warning, the bytes count */
    uint32_t restarts;       /* SYNC, and writes that change CONFIG0 */
    uint32_t clipped;        /* words at the limit of the format */
    uint32_t realigned;      /* SCLK rested for 64 data periods inside a byte or command: interface time-out */
};

struct ads1282; /* definition below: plain, embedded by the board, read-only outside ads1282*.c */

void ads1282_init(struct ads1282 *a, const struct ads1282_cfg *cfg, const struct ads1282_io *io, struct sched *s,
                  struct rng noise);

/* Supplies and clock are good at t_ns: registers to default, RDATAC, first settled DRDY after t_DR. */
void ads1282_power_up(struct ads1282 *a, int64_t t_ns);

void ads1282_reset_pin(struct ads1282 *a, bool level, int64_t t_ns); /* active low; t_DR counts from its rise */
void ads1282_sync_pin(struct ads1282 *a, bool level, int64_t t_ns);  /* rising edge synchronises */

/* The serial port is a->spi: drive it with spi_first() and spi_byte(), or bit by bit (mode 0: spi_miso and spi_sample at
 * each rising edge, spi_first after the first of each byte). */

/* Samples the input up to and including t_ns. For a caller about to change the input abruptly: blocks are otherwise
 * sampled, each at its own instant, when their data period ends. */
void ads1282_sample_until(struct ads1282 *a, int64_t t_ns);

bool ads1282_drdy(const struct ads1282 *a);         /* level of the pin */
bool ads1282_models(uint8_t config0);               /* pulse sync, sinc + FIR, a published rate: what is modelled */
bool ads1282_running(const struct ads1282 *a);      /* powered, not in reset, CONFIG0 names a modelled mode */
int64_t ads1282_settle_ns(const struct ads1282 *a); /* t_DR of the present CONFIG0; 0: none */
int64_t ads1282_period_ns(const struct ads1282 *a); /* data period of the present CONFIG0, rounded down; 0: none */

struct ads1282_opcode; /* row of the command table */

struct ads1282 {
    struct ads1282_cfg cfg;
    struct ads1282_io io;
    struct sched *sched;
    struct ads1282_counters count;
    struct reg_file regs;
    uint8_t reg_value[ADS1282_REGS];
    bool powered, sync_level, reset_level;
    bool alive; /* powered and not in reset */

    /* serial column */
    bool rdatac, rdata_due; /* read mode; an RDATA waits for its word */
    bool word_out, unread;  /* a word is in the output register; none of it has been clocked out */
    bool in_byte, gap_matters;
    uint8_t op_byte, reg_addr, regs_left;
    enum { ADS1282_COUNT, ADS1282_WRITE, ADS1282_READ, ADS1282_SKIP } op_stage; /* what a command's next byte is */
    const struct ads1282_opcode *op; /* command under way, NULL between commands */
    struct spi spi;
    uint64_t out; /* output register: the word below `out_phase` leading bits already gone */
    unsigned out_index, out_phase;
    int64_t sclk_ns, rise_ns, gap_ns; /* last SCLK edge heard of; last rising edge; 24 tCLK */
    unsigned rest_periods;            /* since SCLK last moved */

    /* converter column */
    bool running, drdy;
    unsigned mux;
    struct ads1282_filter filter;
    struct clk clk;
    struct rng noise;
    int64_t sync_count;    /* CLK edge at which the modulator and filter were restarted */
    int64_t block, period; /* next block to sample; data periods announced since the restart */
    int64_t sample[ADS1282_BLOCKS];
    int64_t result_lsb; /* of the last complete data period */
    double lsb_per_v, noise_lsb;
    struct sched_ev due, pulse; /* DRDY falls; DRDY rises 4 tCLK earlier if nobody read */
};

#endif

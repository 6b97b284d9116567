/* ADS1255 / ADS1256: 24-bit delta-sigma converter with multiplexer, buffer, PGA and self-calibration.
 *
 * Two columns that meet in the register file and the output word: SPI bytes -> commands -> registers, and pin voltages ->
 * multiplexer, buffer, PGA -> sinc5 and mean -> OFC/FSC -> clip -> word -> DRDY. SPI mode 1 with chip select: with CS high
 * the chip ignores the bus. There is no data on DOUT without RDATA or RDATAC. The struct is owned and embedded by the
 * board and must not move after init; no allocation, one thread. docs/chips/ads1256.md holds the fidelity table and the
 * readings we chose, docs/sources.md section 2 their origin. */
#ifndef PSABENCH_CHIP_ADS1256_H
#define PSABENCH_CHIP_ADS1256_H

#include "base/clk.h"
#include "base/reg.h"
#include "base/rng.h"
#include "base/sched.h"
#include "base/spi.h"
#include "chip/ads1256_filter.h"

#include <stdbool.h>
#include <stdint.h>

enum ads1256_reg {
    ADS1256_STATUS,
    ADS1256_MUX,
    ADS1256_ADCON,
    ADS1256_DRATE,
    ADS1256_IO,
    ADS1256_OFC0,
    ADS1256_OFC1,
    ADS1256_OFC2,
    ADS1256_FSC0,
    ADS1256_FSC1,
    ADS1256_FSC2,
    ADS1256_REGS
};

/* Fields of STATUS and ADCON. */
#define ADS1256_STATUS_DRDY  0x01u
#define ADS1256_STATUS_BUFEN 0x02u
#define ADS1256_STATUS_ACAL  0x04u
#define ADS1256_STATUS_ORDER 0x08u
#define ADS1256_ADCON_PGA    0x07u
#define ADS1256_ADCON_SDCS   0x18u
#define ADS1256_ADCON_CLK    0x60u

#define ADS1256_AINCOM    8u   /* input number of AINCOM */
#define ADS1256_DOUT_IDLE 0x00 /* DOUT is in high impedance: our bus pulls it low */
#define ADS1256_GARBLED   0xFF /* what a read inside t6 gives when timing is strict */

/* Soldered: set once. */
struct ads1256_cfg {
    uint32_t clkin_hz;           /* 0.1 .. 10 MHz, nominally 7.68 MHz */
    double vref_v;               /* VREFP - VREFN */
    double avdd_v;               /* 0: 5 V. The buffer passes AGND .. AVDD - 2 V */
    double noise_scale;          /* 1: published noise, 0: noiseless converter */
    double offset_v, gain_error; /* of the uncalibrated signal path, input-referred: what self-calibration takes away */
    /* Looks at the input per conversion at 500 SPS and below; 0: about one a millisecond, enough to reject mains hum as
     * the chip does. 1 is fast, and right for a signal that is slow against the data rate. */
    uint16_t cells_max;
    bool strict_timing; /* a data read inside t6 of its command gives FFh, as silicon would garble it */
};

/* Everything the chip can reach. */
struct ads1256_io {
    void *ctx;
    double (*ain_v)(void *ctx, unsigned ain, int64_t t_ns); /* voltage of AIN0..7, 8 = AINCOM, to AGND, now (t_ns) */
    void (*drdy)(void *ctx, bool level, int64_t t_ns);      /* DRDY pin, active low; called on changes only */
};

/* What the bus asked for and the chip refused or suffered. Rights violations are in regs (reg.h). */
struct ads1256_counters {
    uint32_t conversions, calibrations, restarts;
    uint32_t overruns;       /* a word was replaced before it was read */
    uint32_t torn_reads;     /* a word was replaced between its first and its last bit */
    uint32_t clipped;        /* codes at either end */
    uint32_t buffer_clipped; /* looks at an input outside the range of the buffer */
    uint32_t bad_opcodes;    /* bytes that are no command */
    uint32_t refused;        /* not modelled: SYSOCAL SYSGCAL STANDBY, power-down, SYNC while calibrating */
    uint32_t bad_drate;      /* DRATE codes outside the table: stored, the rate stays */
    uint32_t gap_violations; /* t6, t10, t11, t16 not kept, a command sent before the calibration's DRDY */
    uint32_t dropped;        /* partial commands and reads ended by CS */
};

enum ads1256_mode {
    ADS1256_OFF,         /* before power-up, or RESET low */
    ADS1256_CALIBRATING, /* measuring; its settling is already a normal run */
    ADS1256_RUNNING,
    ADS1256_SYNC_WAIT, /* SYNC command given, WAKEUP awaited */
    ADS1256_SYNC_LOW   /* SYNC/PDWN pin low */
};

enum ads1256_port { ADS1256_OPCODE, ADS1256_COUNT, ADS1256_WRITE, ADS1256_READ, ADS1256_WORD, ADS1256_PORTS };

/* Plain; read-only outside ads1256.c. */
struct ads1256 {
    struct ads1256_cfg cfg;
    struct ads1256_io io;
    struct sched *sched;
    struct rng noise;
    struct clk clkin;
    struct ads1256_counters n;
    uint8_t refused_opcode; /* the latest one, for the shell */

    struct reg_file regs;
    uint8_t value[ADS1256_REGS];

    /* serial port */
    struct spi spi;
    bool cs, sync, reset, drdy; /* pin levels */
    enum ads1256_port port;
    uint8_t opcode, addr, left;   /* of the command in progress; left: bytes to come */
    uint8_t before[ADS1256_REGS]; /* registers before the WREG in progress */
    uint8_t word_left;            /* bytes of the word not yet shifted out, 3..0 */
    bool in_word;                 /* the present byte shifted out one of them */
    bool rdatac, awaiting_data, garbled, first_drdy;
    int64_t first_ns;   /* first SCLK edge of the present byte */
    int64_t command_ns; /* end of the latest byte */
    int64_t next_ok_ns; /* no command before (t11) */

    /* conversion */
    enum ads1256_mode mode;
    const struct ads1256_rate *rate, *rate_next; /* next: from the end of the running conversion */
    struct ads1256_mean mean;
    struct sched_ev cell_ev, ready_ev, pulse_ev, cal_ev;
    int64_t start_tau;   /* CLKIN count where the present run began */
    int64_t cell, ready; /* next cell and conversion of the run */
    enum ads1256_cal cal;
    int32_t word; /* 24-bit code */
    bool unread;
    int64_t pin_low_ns; /* when SYNC or RESET went low */
};

void ads1256_init(struct ads1256 *a, const struct ads1256_cfg *cfg, const struct ads1256_io *io, struct sched *s,
                  struct rng noise);

/* Supplies and clock are good (30 ms with a crystal, 8192 tau with a clock): registers to default, self-calibration at
 * default settings, then DRDY falls. */
void ads1256_power_up(struct ads1256 *a, int64_t t_ns);

void ads1256_reset_pin(struct ads1256 *a, bool level, int64_t t_ns); /* active low */
void ads1256_sync_pin(struct ads1256 *a, bool level, int64_t t_ns);  /* SYNC/PDWN: restart on the rising edge */
void ads1256_cs_pin(struct ads1256 *a, bool level, int64_t t_ns);    /* active low; high drops a partial command */

/* Serial port: spi_first() and spi_byte() on a->spi while CS is low; or bit by bit, spi_first() before the first bit. */

bool ads1256_drdy(const struct ads1256 *a);
int64_t ads1256_settle_ns(const struct ads1256 *a); /* t18 of the present DRATE */

#endif

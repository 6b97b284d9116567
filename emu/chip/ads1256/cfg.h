/* What an ADS1255/ADS1256 is soldered to: registers, configuration, callbacks, counters. Included by ads1256/ads1256.h. */
#ifndef PSABENCH_CHIP_ADS1256_CFG_H
#define PSABENCH_CHIP_ADS1256_CFG_H

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

/* Fields of STATUS, ADCON and IO. */
#define ADS1256_STATUS_DRDY  0x01u
#define ADS1256_STATUS_BUFEN 0x02u
#define ADS1256_STATUS_ACAL  0x04u
#define ADS1256_STATUS_ORDER 0x08u
#define ADS1256_ADCON_PGA    0x07u
#define ADS1256_ADCON_SDCS   0x18u
#define ADS1256_ADCON_CLK    0x60u
#define ADS1256_IO_DIO       0x0Fu /* DIR is above it: 1 = input */

#define ADS1256_AINCOM    8u   /* input number of AINCOM */
#define ADS1256_INPUTS    9u   /* AIN0..7, AINCOM */
#define ADS1256_GPIOS     4u   /* D0..D3 */
#define ADS1256_DOUT_IDLE 0x00 /* DOUT is in high impedance: our bus pulls it low */
#define ADS1256_GARBLED   0xFF /* what a read inside t6 gives when timing is strict */

enum ads1256_part {
    ADS1256_PART_1256,
    ADS1256_PART_1255 /* AIN0, AIN1 and AINCOM, D0 and D1; all else is equal */
};

/* What ads1256_power_up() waits for before the chip comes to life, and what the end of power-down waits for. */
enum ads1256_start {
    ADS1256_START_AT_ONCE, /* the caller has waited; power-down ends as with a clock */
    ADS1256_START_CLOCK,   /* 8192 tau of a clock at CLKIN */
    ADS1256_START_CRYSTAL  /* 30 ms of a crystal */
};

/* Soldered: set once. */
struct ads1256_cfg {
    enum ads1256_part part;
    enum ads1256_start start;
    uint32_t clkin_hz;           /* 0.1 .. 10 MHz, nominally 7.68 MHz */
    double vref_v;               /* VREFP - VREFN */
    double avdd_v;               /* 0: 5 V. The buffer passes AGND .. AVDD - 2 V */
    double noise_scale;          /* 1: published noise, 0: noiseless converter */
    double offset_v, gain_error; /* of the uncalibrated signal path, input-referred: what self-calibration takes away */
    /* Looks at the input per conversion at 500 SPS and below; 0: about one a millisecond, enough to reject mains hum as
     * the chip does. 1 is fast, and right for a signal that is slow against the data rate. */
    uint16_t cells_max;
    bool every_word; /* a look a sinc5 word (256 tau) at any rate: what folds on silicon folds, at 30 times the work */
    bool strict_timing; /* a data read inside t6 of its command gives FFh, as silicon would garble it */
    bool strict_bus;    /* other breaches do what silicon may do, not only count: docs/chips/ads1256.md */
    bool sync_halts;    /* SYNC halts the conversion, DRDY is high until WAKEUP; otherwise WAKEUP alone restarts */
    bool strict_cs;     /* CS high ends RDATAC; otherwise the mode outlives it (no source says which) */
};

/* Everything the chip can reach. NULL is allowed where it is said. */
struct ads1256_io {
    void *ctx;
    /* Voltage of AIN0..7, 8 = AINCOM, to AGND, now (t_ns): of the open circuit if source_ohm is there. */
    double (*ain_v)(void *ctx, unsigned ain, int64_t t_ns);
    /* Resistance behind that voltage, INFINITY: nothing connected. NULL: 0, inputs and currents do not load it. */
    double (*source_ohm)(void *ctx, unsigned ain, int64_t t_ns);
    void (*drdy)(void *ctx, bool level, int64_t t_ns); /* NULL, or DRDY pin, active low; called on changes only */
    void (*dout)(void *ctx, bool level, int64_t t_ns); /* NULL, or changes of DOUT while pins drive SCLK */
    void (*gpio)(void *ctx, unsigned d, bool level, int64_t t_ns); /* NULL, or changes of D0..D3 as outputs */
};

/* What the bus asked for and the chip rejected or suffered. Rights violations are in regs (reg.h). */
struct ads1256_counters {
    uint32_t conversions, calibrations, restarts, power_downs;
    uint32_t overruns;        /* a word was replaced before it was read */
    uint32_t torn_reads;      /* a word was replaced between its first and its last bit */
    uint32_t window_reads;    /* bytes of a word that began in the 16 tau before an update */
    uint32_t clipped;         /* codes at either end */
    uint32_t buffer_clipped;  /* looks at an input outside the range of the buffer */
    uint32_t range_exceeded;  /* looks at a pair of inputs of which one is outside AGND - 0.1 V .. AVDD + 0.1 V */
    uint32_t bad_mux;         /* looks at an input that an ADS1255 does not have */
    uint32_t cal_clamped;     /* calibrations whose OFC or FSC did not fit into 24 bits */
    uint32_t bad_opcodes;     /* bytes that are no command */
    uint32_t refused;         /* SYNC while calibrating or in standby, STANDBY while calibrating */
    uint32_t bad_drate;       /* DRATE codes outside the table: stored, the rate stays */
    uint32_t gap_violations;  /* t6, t10, t11, t16 not kept, a command sent before the calibration's DRDY */
    uint32_t sclk_violations; /* pins only: t1, t2 */
    uint32_t din_violations;  /* pins only: t4, t5 */
    uint32_t dropped;         /* partial commands and reads ended by CS, or by a slow SCLK when timing is strict */
};

#endif

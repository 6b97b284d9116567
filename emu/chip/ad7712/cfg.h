/* What an AD7710/AD7711/AD7712 is soldered to: control word, configuration, callbacks, counters. Included by ad7712/ad7712.h. */
#ifndef PSABENCH_CHIP_AD7712_CFG_H
#define PSABENCH_CHIP_AD7712_CFG_H

#include "base/looks.h"

#include <stdbool.h>
#include <stdint.h>

/* Fields of the control word, 24 bits, MD2 first on the wire (sources 3.2). */
#define AD7712_CTL_MD    0xE00000u
#define AD7712_CTL_G     0x1C0000u
#define AD7712_CTL_CH    0x020000u
#define AD7712_CTL_PD    0x010000u
#define AD7712_CTL_WL    0x008000u /* 1: words of 24 bits */
#define AD7712_CTL_B14   0x004000u /* AD7710 IO, AD7711 RO, AD7712 nothing */
#define AD7712_CTL_BO    0x002000u
#define AD7712_CTL_BU    0x001000u /* 1: unipolar */
#define AD7712_CTL_FS    0x000FFFu
#define AD7712_CTL_RESET 0x000145u /* 60 Hz at 10 MHz */

/* A control word by its fields; gain by its logarithm to base 2. */
#define AD7712_CONTROL(md, gain_log2, channel, bits24, unipolar, fs)                                                   \
    ((uint32_t)(md) << 21 | (uint32_t)(gain_log2) << 18 | (uint32_t)(channel) << 17 | (uint32_t)(bits24) << 15 |       \
     (uint32_t)(unipolar) << 12 | (uint32_t)(fs))

enum ad7712_md {
    AD7712_NORMAL,
    AD7712_SELF_CAL,
    AD7712_SYSTEM_ZERO,
    AD7712_SYSTEM_FULL,
    AD7712_SYSTEM_OFFSET,
    AD7712_BACKGROUND,
    AD7712_ZERO_COEF, /* with A0 high the zero-scale coefficient is read and written */
    AD7712_FULL_COEF
};

enum ad7712_part { AD7712_PART_7712, AD7712_PART_7710, AD7712_PART_7711, AD7712_PART_7711A };

enum {
    AD7712_CHANNELS = 2,
    AD7712_FS_MIN = 19,
    AD7712_FS_MAX = 2000,
    AD7712_MOD_TAU = 512, /* one modulator period */
    AD7712_CELLS_MAX = 64 /* looks at the input per output period */
};

#define AD7712_ZERO_IDEAL 0x800000u /* coefficients of a path without errors */
#define AD7712_FULL_IDEAL 0x400000u

/* Soldered: set once. */
struct ad7712_cfg {
    enum ad7712_part part;
    uint32_t clkin_hz;                                             /* 0.4 .. 10 MHz, nominally 10 MHz */
    double vref_v;                                                 /* REF IN(+) - REF IN(-), nominally 2.5 V */
    double noise_scale;                                            /* 1: published noise, 0: noiseless converter */
    double offset_v[AD7712_CHANNELS], gain_error[AD7712_CHANNELS]; /* of the uncalibrated path, input-referred */
    /* Looks at the input per output period, a power of two up to 64; 0: as many as make 4 kHz, at least 4. With n the notches
     * at n times the output rate and its multiples are not there: docs/chips/ad7712.md. */
    uint8_t cells_max;
    /* Delays of the outputs, ns; 0: 3 tau, 1 tau, 1 tau, all within the limits of sources 3.4. */
    int32_t rfs_access_ns; /* RFS low to the first bit */
    int32_t bit_access_ns; /* SCLK fall to the next bit */
    int32_t drdy_rise_ns;  /* last SCLK fall to DRDY high */
    bool strict_timing;    /* breaches of the limits garble words and lose writes, not only count */
    bool strict_drdy;      /* a word read while DRDY is high reads as ones, not as the old word */
    bool free_settling;    /* a new channel or gain does not restart the filter: up to four outputs are mixtures */
};

/* Everything the chip can reach. NULL is allowed where it is said. */
struct ad7712_io {
    void *ctx;
    /* Volts across the inputs of a channel (0: AIN1; 1: AIN2, which on the AD7712 is against VBIAS): of the open circuit if
     * source_ohm is there. Asked late, when an output period ends, each look for its own instant and never for an earlier
     * one than before; who changes the input abruptly calls ad7712_sample_until() first. NULL where rows are asked. */
    double (*vin_v)(void *ctx, unsigned channel, int64_t t_ns);
    /* The same for a row of up to AD7712_CELLS_MAX looks; NULL: one by one. Not asked where source_ohm is there. */
    void (*vin_row_v)(void *ctx, unsigned channel, const struct looks *at, double *vin_v);
    /* Resistance behind it, INFINITY: nothing connected. NULL: 0, loads and currents do not matter. */
    double (*source_ohm)(void *ctx, unsigned channel, int64_t t_ns);
    /* DRDY pin, active low; called on changes only. NULL: not connected; inside it then rises as soon as a word is taken. */
    void (*drdy)(void *ctx, bool level, int64_t t_ns);
    void (*sdata)(void *ctx, bool level, int64_t t_ns); /* NULL, or changes of SDATA as the chip drives it */
    void (*sclk)(void *ctx, bool level, int64_t t_ns);  /* NULL, or changes of SCLK in self-clocking mode */
};

/* What the host asked for and the chip rejected or suffered. */
struct ad7712_counters {
    uint32_t conversions; /* words that reached the output register */
    uint32_t calibrations, restarts, power_downs;
    uint32_t overruns;         /* a word was replaced before it was read */
    uint32_t lost_words;       /* a conversion ended while RFS was low: the register was not overwritten */
    uint32_t torn_reads;       /* a word was replaced between two parts of its read */
    uint32_t stale_reads;      /* reads begun while DRDY was high */
    uint32_t blocked_reads;    /* reads of the control register that gave the waiting word */
    uint32_t over_reads;       /* SCLK pulses after the last bit of a word */
    uint32_t dropped;          /* writes of less than 24 bits, and those lost for their timing */
    uint32_t refused;          /* writes with A0 high outside the coefficient modes, RFS and TFS low together */
    uint32_t over_writes;      /* SCLK pulses after the 24th bit of a write */
    uint32_t clipped;          /* codes at either end */
    uint32_t overloads;        /* looks at the input beyond 105 % of full scale */
    uint32_t cal_clamped;      /* calibrations whose coefficient did not fit into 24 bits */
    uint32_t bad_fs;           /* control words whose filter code is outside 19 .. 2000: the next one inside is used */
    uint32_t bad_channel;      /* looks at an input that the part does not have */
    uint32_t bad_bit;          /* control words that set b14 on an AD7712, where it does nothing */
    uint32_t a0_violations;    /* A0 less than 2 tau before RFS, or moved inside a frame */
    uint32_t sclk_violations;  /* period below 5 tau, high or low below 2 tau */
    uint32_t sdata_violations; /* write: data later than 2 tau before the fall, or moved in the 30 ns after the rise */
    uint32_t frame_violations; /* RFS high within 10 ns, TFS high within 4 tau of the last SCLK fall */
};

#endif

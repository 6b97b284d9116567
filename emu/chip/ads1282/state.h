/* Everything an ADS1281/ADS1282 remembers: struct ads1282, embedded by its owner, read-only outside ads1282*.c. */
#ifndef PSABENCH_CHIP_ADS1282_STATE_H
#define PSABENCH_CHIP_ADS1282_STATE_H

#include "base/chip_fault.h"
#include "base/clk.h"
#include "base/draws.h"
#include "base/reg.h"
#include "base/sched.h"
#include "base/spi.h"
#include "chip/ads1282/cfg.h"
#include "chip/ads1282/filter.h"
#include "chip/ads1282/mod.h"

#include <stdbool.h>
#include <stdint.h>

#define ADS1282_RESULTS 64u /* filter outputs kept: the direct chain's input of 32 data periods ago */

struct ads1282;
struct ads1282_opcode; /* row of the command table */

/* Levels and last edges of the input pins. */
struct ads1282_pins {
    bool reset, sync, pwdn, sclk, din;
    bool dout_held; /* DOUT while SCLK is high */
    int64_t sclk_rise_ns, sclk_fall_ns, din_ns, sync_ns, reset_ns;
    int64_t drdy_ns; /* DRDY's last change */
};

/* When things happen, in tCLK; of the present mode. */
struct ads1282_timing {
    int64_t first_tclk;           /* restart to the end of data period 0 */
    int64_t period_tclk;          /* data period */
    int64_t settle;               /* data periods that end unsettled */
    int64_t period_ns, settle_ns; /* rounded down: data period, restart to the first settled end */
    int64_t origin_tclk;          /* restart to input sample 0 */
    int64_t step_tclk;            /* input sample to input sample */
};

struct ads1282 {
    struct ads1282_cfg cfg;
    struct ads1282_io io;
    struct chip_fault fault;
    void (*notify_drdy)(void *ctx, bool level, int64_t t_ns); /* io.drdy, which is NULL while DRDY is stuck */
    struct sched *sched;
    struct ads1282_counters count;
    struct ads1282_limits limit;
    struct reg_file regs;
    uint8_t reg_value[ADS1282_REGS];
    struct ads1282_mode_pins mode;
    struct ads1282_pins pin;
    bool powered, waking; /* supplies are good; internal reset after power-up */
    bool alive;           /* powered, awake and not in reset */
    bool standby;

    /* serial column */
    bool rdatac, rdata_due; /* read mode; an RDATA waits for its word */
    bool word_out, unread;  /* a word is in the output register; none of it has been clocked out */
    bool in_byte, gap_matters;
    bool lost; /* the byte under way came too soon (strict_gap) */
    uint8_t op_byte, reg_addr, regs_left;
    enum { ADS1282_COUNT, ADS1282_WRITE, ADS1282_READ, ADS1282_SKIP } op_stage; /* what a command's next byte is */
    const struct ads1282_opcode *op;                                            /* under way, NULL between commands */
    struct spi spi;
    uint64_t out; /* output register: the word below `out_phase` leading bits already gone */
    unsigned out_index, out_phase;
    int64_t sclk_ns, rise_ns; /* last SCLK edge heard of; last rising edge */
    int64_t gap_ns, rest_ns;  /* 24 tCLK; how long a read may pause */
    int64_t update_ns;        /* 4 tCLK before the word is replaced; INT64_MAX: not known to be */
    unsigned rest_periods;    /* since SCLK last moved */

    /* converter column */
    bool running;  /* the modulator runs: powered, not in reset nor STANDBY, CONFIG0 without reserved codes */
    bool delivers; /* and data periods end with words: not in modulator output mode */
    bool special;  /* they need more than the plain FIR word: on_due_special() */
    bool in_phase; /* continuous sync: the last restart was a SYNC */
    bool drdy;
    bool mflag;      /* level reported last */
    uint8_t config0; /* in force: the register's, or what the mode pins say */
    unsigned mux;
    unsigned lag; /* results that a word waits behind its data period's: latency of the sinc-only mode */
    struct ads1282_timing timing;
    struct ads1282_filter filter;
    struct ads1282_mod mod;
    struct ads1282_recording recording;
    struct ads1282_cic cic, cic_low;
    struct ads1282_hpf hpf;
    struct ads1282_cal cal;
    struct clk clk;
    struct draws noise;
    void (*sample)(struct ads1282 *a, int64_t until_ns); /* the chain: input samples up to until_ns */
    int64_t sync_count;                                  /* CLK edge at which modulator and filter were restarted */
    int64_t period;                                      /* data periods ended since the restart */
    int64_t index;                                       /* next input sample */
    struct clk_pos next;                                 /* its instant */
    struct clk_step step;                                /* from input sample to input sample */
    int64_t block;                                       /* next sinc block to complete */
    int64_t sinc[ADS1282_BLOCKS];
    int64_t result[ADS1282_RESULTS]; /* of data period p at p: filter output, full scale 2^30 */
    int64_t last_lsb;                /* newest input sample, full scale 2^34 */
    double lsb_per_v, noise_lsb, direct_gain;
    struct clk_pos ended;                    /* end of data period `period` - 1, at first of period 0 */
    struct clk_step period_step, pulse_step; /* from there to the next end; to 4 tCLK before it */
    struct sched_ev due, pulse;              /* DRDY falls; DRDY rises 4 tCLK earlier if no one read */
    struct sched_ev wake;                    /* end of the internal reset */
    struct sched_ev watch;                   /* next input sample, where MFLAG or the modulator's bits are looked at */
};

#endif

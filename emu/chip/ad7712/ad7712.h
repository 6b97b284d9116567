/* AD7712, and AD7710, AD7711, AD7711A where they differ: 24-bit sigma-delta converter with two input channels, PGA, sinc3
 * filter, self-, system and background calibration, and a serial port framed by RFS (read) and TFS (write).
 *
 * Two columns that meet in the control word and the output register: frames -> control word and coefficients, and volts ->
 * PGA -> sinc3 -> (x - zero) * full -> word -> DRDY. The struct is owned and embedded by the board and must not move after
 * init; no allocation, one thread. Pins have their levels at an instant; the same level again changes nothing. docs/chips/
 * ad7712.md holds the fidelity table and the readings we chose, docs/sources.md section 3 their origin. */
#ifndef PSABENCH_CHIP_AD7712_AD7712_H
#define PSABENCH_CHIP_AD7712_AD7712_H

#include "base/chip_fault.h"
#include "base/clk.h"
#include "base/draws.h"
#include "base/sched.h"
#include "chip/ad7712/cfg.h"
#include "chip/ad7712/filter.h"

#include <stdbool.h>
#include <stdint.h>

enum ad7712_state {
    AD7712_OFF,      /* no supplies */
    AD7712_DOWN,     /* STANDBY low or PD set */
    AD7712_SYNC_LOW, /* the filter is held in reset */
    AD7712_RUNNING
};

enum ad7712_source { AD7712_FROM_WORD, AD7712_FROM_CONTROL, AD7712_FROM_COEF };
enum ad7712_target { AD7712_TO_NOTHING, AD7712_TO_CONTROL, AD7712_TO_COEF };

/* The serial port. */
struct ad7712_port {
    bool a0, rfs, tfs, sclk, sdata, mode, sync, standby; /* levels of the pins; sdata: as the host drives it */
    bool sdata_was;                                      /* before its latest change */
    int64_t a0_ns, rise_ns, fall_ns, sdata_ns;           /* latest changes */
    /* read */
    enum ad7712_source source;
    uint32_t shift;        /* what is shifted out, bit 23 first */
    uint8_t width, index;  /* bits of it, and how many are over; index < width: a read is under way */
    bool reading, clocked; /* clocked: an SCLK rise awaits its fall */
    /* write */
    enum ad7712_target target;
    uint32_t in;
    uint8_t taken;
    bool writing, load_coef;
    uint32_t load; /* what load_ev stores */
    bool garbled;  /* the frame has broken a limit and the chip is strict */
    /* SDATA as the chip drives it: up to change_ns, and from then on */
    bool out, driven, out_next, driven_next;
    int64_t change_ns;
    /* SCLK in self-clocking mode */
    bool clock;
    int64_t clock_half; /* edges so far */
    int64_t clock_ns;   /* of its first edge */
};

/* Plain; read-only outside ad7712*.c. */
struct ad7712 {
    struct ad7712_cfg cfg;
    struct ad7712_io io;
    struct chip_fault fault;
    struct sched *sched;
    struct draws noise;
    struct clk clkin;
    struct ad7712_counters n;

    uint32_t control;
    uint32_t zero[AD7712_CHANNELS], full[AD7712_CHANNELS]; /* coefficients, 24 bits */
    struct ad7712_port port;
    bool drdy; /* inside; see ad7712_drdy() for the pin */

    /* conversion */
    enum ad7712_state state;
    uint8_t phase; /* ad7712/conv.c */
    bool quiet;    /* the run looks at no pin */
    double still;  /* the x of such a run */
    struct ad7712_sinc3 filter;
    double x_per_v, noise_x, offset_v; /* of the run: volts to x, noise of a word, offset */
    int64_t start_tau;                 /* CLKIN count where the run began: a modulator edge */
    int64_t ready;                     /* outputs of the run so far */
    int64_t looks;                     /* of the run so far */
    struct clk_pos look, due;
    struct clk_step look_step, due_step, pulse_step; /* pulse: from the end of a period back */
    struct sched_ev ready_ev, pulse_ev, rise_ev, begin_ev, load_ev, sdata_ev, clock_ev;
    uint32_t word; /* output register, 24 bits */
    bool unread;
};

void ad7712_init(struct ad7712 *a, const struct ad7712_cfg *cfg, const struct ad7712_io *io, struct sched *s,
                 struct draws noise);

/* Supplies are good: control word and coefficients to default, conversions begin. */
void ad7712_power_up(struct ad7712 *a, int64_t t_ns);

/* They fail: everything is forgotten but the counters and the levels of the pins. */
void ad7712_power_off(struct ad7712 *a, int64_t t_ns);

/* Pins. At first RFS, TFS, SYNC and STANDBY are high, the others low. */
void ad7712_a0_pin(struct ad7712 *a, bool level, int64_t t_ns);
void ad7712_rfs_pin(struct ad7712 *a, bool level, int64_t t_ns);   /* active low: a read */
void ad7712_tfs_pin(struct ad7712 *a, bool level, int64_t t_ns);   /* active low: a write */
void ad7712_sclk_pin(struct ad7712 *a, bool level, int64_t t_ns);  /* of the host, MODE low */
void ad7712_sdata_pin(struct ad7712 *a, bool level, int64_t t_ns); /* as the host drives it */
void ad7712_mode_pin(struct ad7712 *a, bool level, int64_t t_ns);  /* high: the chip drives SCLK */
void ad7712_sync_pin(struct ad7712 *a, bool level, int64_t t_ns);  /* low: filter in reset; its rise starts it */
void ad7712_standby_pin(struct ad7712 *a, bool level, int64_t t_ns);

bool ad7712_drdy(const struct ad7712 *a);
bool ad7712_sdata(const struct ad7712 *a, int64_t t_ns); /* as the chip drives it at t_ns, low in high impedance */
bool ad7712_sdata_driven(const struct ad7712 *a, int64_t t_ns);
bool ad7712_sclk(const struct ad7712 *a); /* as the chip drives it, high outside of its frames */

/* A whole frame's SCLK at once, for a board that knows it: called when RFS (TFS) is low, at t_ns, not after its first rise,
 * instead of the edges and with their result; RFS (TFS) goes high later, after the last fall. reading returns `bits` bits as
 * the host takes them at the rises, the first one highest. */
struct ad7712_sclk {
    int64_t first_rise_ns, period_ns, high_ns;
};
uint32_t ad7712_read_word(struct ad7712 *a, unsigned bits, const struct ad7712_sclk *c);
void ad7712_write_word(struct ad7712 *a, uint32_t word, unsigned bits, const struct ad7712_sclk *c);

/* Takes the looks at the input up to and including t_ns. */
void ad7712_sample_until(struct ad7712 *a, int64_t t_ns);

int64_t ad7712_period_ns(const struct ad7712 *a);    /* of the outputs, with the present filter code */
uint32_t ad7712_sampling_hz(const struct ad7712 *a); /* of the input capacitor, by the gain */
double ad7712_iout_a(const struct ad7712 *a);        /* AD7710: current source; AD7711: each of its RTD sources */

/* ---- Faults ---- */

enum { AD7712_FLIP_REGS = 15 }; /* bytes, high first: control, then zero and full scale of AIN1, then of AIN2 */

/* From t_ns on, in place of the faults that were; outlives power. Not from inside a callback of the chip. */
void ad7712_fault(struct ad7712 *a, const struct chip_fault *f, int64_t t_ns);

/* Inverts bits of a register's byte, as a particle or a bad supply does; the chip acts on what it finds there as if it had
 * been written. False: no such byte, or no power. */
bool ad7712_flip(struct ad7712 *a, unsigned reg, uint8_t mask, int64_t t_ns);

#endif

/* Between the files of the AD7712; no other file includes it.
 *
 * ad7712/control.c control word, coefficients, power; ad7712/port.c frames; ad7712/pins.c the pins' edges, words at once and the
 * chip's own SCLK; ad7712/input.c volts to fractions of full scale; ad7712/conv.c conversions and calibrations on the
 * modulator's grid; ad7712/filter.c the arithmetic, pure; ad7712/fault.c faults.
 * A run is a row of outputs on one time grid from a modulator edge on; a phase says what a run measures, what becomes of its
 * outputs and what follows. */
#ifndef PSABENCH_CHIP_AD7712_INTERNAL_H
#define PSABENCH_CHIP_AD7712_INTERNAL_H

#include "chip/ad7712/ad7712.h"

static inline int64_t ad7712_tau_ns(const struct ad7712 *a, int64_t tau)
{
    return clk_span_ns(a->clkin.hz, tau);
}

static inline enum ad7712_md ad7712_md(const struct ad7712 *a)
{
    return (enum ad7712_md)(a->control >> 21);
}

static inline unsigned ad7712_gain_log2(const struct ad7712 *a)
{
    return (a->control & AD7712_CTL_G) >> 18;
}

static inline unsigned ad7712_channel(const struct ad7712 *a)
{
    return (a->control & AD7712_CTL_CH) != 0;
}

/* With A0 high a frame reaches a coefficient, not the output register. */
static inline bool ad7712_coef_mode(const struct ad7712 *a)
{
    return ad7712_md(a) >= AD7712_ZERO_COEF;
}

static inline uint32_t *ad7712_coef(struct ad7712 *a)
{
    return ad7712_md(a) == AD7712_ZERO_COEF ? &a->zero[ad7712_channel(a)] : &a->full[ad7712_channel(a)];
}

/* ---- ad7712/control.c ---- */

void ad7712_load_control(struct ad7712 *a, uint32_t control, int64_t t_ns);
void ad7712_follow_pins(struct ad7712 *a, int64_t t_ns); /* SYNC, STANDBY or PD may have changed the state */

/* ---- ad7712/port.c ---- */

void ad7712_port_init(struct ad7712 *a);
void ad7712_port_forget(struct ad7712 *a, int64_t t_ns); /* frames, what waits to be stored; SDATA to high impedance */
bool ad7712_deaf(const struct ad7712 *a);                /* no supplies, or STANDBY low */
void ad7712_begin_read(struct ad7712 *a, int64_t t_ns);
void ad7712_end_read(struct ad7712 *a, int64_t t_ns);
void ad7712_begin_write(struct ad7712 *a, int64_t t_ns);
void ad7712_end_write(struct ad7712 *a, int64_t t_ns);
void ad7712_clock_rise(struct ad7712 *a, int64_t t_ns);
void ad7712_clock_fall(struct ad7712 *a, int64_t t_ns);
void ad7712_word_over(struct ad7712 *a, int64_t fall_ns); /* the last bit of a read has gone out */
int64_t ad7712_bit_access_ns(const struct ad7712 *a);

/* ---- ad7712/pins.c ---- */

void ad7712_pins_init(struct ad7712 *a);
void ad7712_own_clock(struct ad7712 *a, int64_t t_ns); /* self-clocking: a frame has begun */
void ad7712_stop_clock(struct ad7712 *a, int64_t t_ns);

/* ---- ad7712/input.c ---- */

/* Volts at the PGA, of the selected channel at t_ns. */
double ad7712_input_v(struct ad7712 *a, int64_t t_ns);
double ad7712_attenuation(const struct ad7712 *a, unsigned channel);

/* ---- ad7712/conv.c ---- */

void ad7712_conv_init(struct ad7712 *a);
void ad7712_freeze(struct ad7712 *a, enum ad7712_state state, int64_t t_ns); /* stops whatever runs; DRDY goes high */
void ad7712_start(struct ad7712 *a, int64_t t_ns);              /* what MD says, from the next CLKIN edge on */
void ad7712_restart(struct ad7712 *a, int64_t t_ns);            /* the same from the next modulator edge on */
bool ad7712_must_restart(const struct ad7712 *a, uint32_t was); /* after the control word has changed */
void ad7712_set_path(struct ad7712 *a);                         /* gain and channel as the control word says */
void ad7712_word_read(struct ad7712 *a);                        /* the host has the whole word */
void ad7712_retime(struct ad7712 *a);                           /* the clock's rate has changed */

#endif

/* Data periods that no one looks at: their ends are counted, their values left out, and the filter is filled again when
 * someone is about to look. */
#include "chip/ads1282/internal.h"

#include <math.h>
#include <stddef.h>

/* Data periods of samples that no result knows more of: the filter's memory is 61.6, the rest is for the volts' own. */
#define MEMORY_PERIODS 66

#define GAIN_MAX     1.001    /* at DC: 1.0000287 and 1.0001690, of the taps */
#define DRAW_MAX_LSB 131070.0 /* of a draw of the converter's noise, in its own units: chain.c */

/* A word could be at its limit: the middle passes with the gain at DC, and around it comes what drives the filter most. */
static bool may_clip(const struct ads1282 *a, struct looks_range vin_v)
{
    const double mid_lsb = fabs(vin_v.mid) * a->lsb_per_v,
                 off_lsb = vin_v.off * a->lsb_per_v + a->noise_lsb * DRAW_MAX_LSB;
    return !(mid_lsb * GAIN_MAX + off_lsb * ADS1282_OVERSHOOT < (double)(INT64_C(1) << ADS1282_BLOCK_LOG2));
}

/* An input could leave its range. */
static bool may_exceed(const struct ads1282 *a, struct looks_range vin_v)
{
    const struct ads1282_range range = ads1282_input_range(a);
    const double half_v = 0.5 * (fabs(vin_v.mid) + vin_v.off), middle_v = a->cfg.common_mode_v;
    return middle_v != 0.0 && !(middle_v - half_v >= range.min_v && middle_v + half_v <= range.max_v);
}

const char *ads1282_why_eager(const struct ads1282 *a, struct looks_range vin_v)
{
    if (!a->delivers || a->special || !ads1282_chain_forgets(a)) return "a converter's filter has no finite memory";
    if (a->io.mflag || a->io.modulator) return "MFLAG or the modulator's bits are watched";
    if (a->fault.drdy || a->fault.dout || a->fault.lost_sync || a->fault.clock_ppm) return "a converter has a fault";
    if (reg_peek24(&a->regs, ADS1282_OFC0) != 0 || reg_peek24(&a->regs, ADS1282_FSC0) != 0x400000)
        return "OFC or FSC of a converter are not the defaults";
    if (may_clip(a, vin_v)) return "a code may reach its limit";
    if (may_exceed(a, vin_v)) return "an input of a converter may leave its common-mode range";
    return NULL;
}

/* The read is over or, when the next word comes, given up. */
bool ads1282_rests(const struct ads1282 *a, int64_t more_periods)
{
    return a->due.queued && a->due.due_ns - a->sclk_ns >= a->rest_ns && a->rdatac && !a->rdata_due && a->drdy &&
           !a->unread && !a->op && a->spi.bits == 0 && !a->pulse.queued && !a->watch.queued &&
           a->period > a->timing.settle + 2 * MEMORY_PERIODS + more_periods;
}

int64_t ads1282_end_ns(const struct ads1282 *a, int64_t p)
{
    return clk_edge_ns(&a->clk, a->sync_count + ads1282_due_tclk(a, p));
}

void ads1282_skip(struct ads1282 *a, uint32_t n)
{
    a->period += n;
    a->count.conversions += n;
    a->ended = clk_pos(&a->clk, a->sync_count + ads1282_due_tclk(a, a->period - 1));
    a->update_ns = clk_on(a->ended, &a->pulse_step).t_ns;
    sched_at(a->sched, &a->due, clk_on(a->ended, &a->period_step).t_ns);
}

int64_t ads1282_resume(struct ads1282 *a, int64_t more_periods, int64_t *before_ns)
{
    const struct ads1282_timing *t = &a->timing;
    const int64_t taken = (ads1282_due_tclk(a, a->period - 1) - t->origin_tclk) / t->step_tclk + 1;
    const int64_t periods = MEMORY_PERIODS + more_periods;
    const int64_t index = (taken / ADS1282_BLOCKS - periods) * ADS1282_BLOCKS;
    *before_ns = clk_edge_ns(&a->clk, a->sync_count + t->origin_tclk + (index - 1) * t->step_tclk);
    ads1282_chain_resume(a, index);
    return a->period - periods - 2;
}

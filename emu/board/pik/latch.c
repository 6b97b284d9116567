/* Latching the counters: by the period, or by a strobe. */
#include "board/pik/internal.h"

#define STEP_NS 100000 /* of the register PERIOD */

int64_t pik_period_ns(const void *pik)
{
    const struct pik *b = pik;
    return (int64_t)b->period_100us * STEP_NS;
}

static void latch_line(struct pik *b, bool level, int64_t t_ns)
{
    trace_set(&b->base.trace, PIK_LINE_LATCH, level, t_ns);
}

static void latch_end(void *ctx, int64_t t_ns)
{
    latch_line(ctx, true, t_ns);
}

/* Counts of a channel into r, which holds those of the reading before. */
static void latch_channel(struct pik_channel *c, struct pik_reading *r, unsigned i, bool frozen)
{
    if (frozen) return;
    r->plus[i] = pik_count_plus(c);
    r->minus[i] = pik_count_minus(c);
    const uint32_t total = (uint32_t)(r->plus[i] - r->minus[i]);
    r->increment[i] = (int16_t)(uint16_t)(total - (uint32_t)r->total[i]);
    r->total[i] = (int32_t)total;
}

void pik_latch_now(struct pik *b, int64_t t_ns)
{
    struct pik_reading *r = &b->latched;
    pik_sample_until(b, t_ns);
    r->seq++;
    r->t_ns = t_ns;
    r->status = PIK_ST_NEW;
    for (unsigned i = 0; i < PIK_AXES; i++) {
        struct pik_channel *c = &b->channel[i];
        latch_channel(c, r, i, b->base.faults & PIK_FAULT_FROZEN_WORDS);
        if (c->saturated) r->status |= (uint8_t)(PIK_ST_SATURATED_X << i);
        c->saturated = false;
    }
    b->any = true;
    b->counters.readings++;
    latch_line(b, false, t_ns);
    sched_at(b->base.sched, &b->latch_end, t_ns + b->profile.latch_ns);
    board_notify(&b->base, PIK_EV_LATCH, t_ns);
    if (b->host.reading) b->host.reading(b->host.ctx, r, t_ns);
}

static void latch_periodically(void *ctx, int64_t t_ns)
{
    struct pik *b = ctx;
    sched_at(b->base.sched, &b->latch, t_ns + pik_period_ns(b));
    pik_latch_now(b, t_ns);
}

/* Counters from zero, the profile's period, no reading yet. */
void pik_latch_restart(struct pik *b, int64_t t_ns)
{
    for (unsigned i = 0; i < PIK_AXES; i++) {
        struct pik_channel *c = &b->channel[i];
        c->plus_from = c->stuck ? 0 : 0 - c->axis.plus;
        c->minus_from = c->stuck ? 0 : 0 - c->axis.minus;
        c->saturated = false;
    }
    b->latched = (struct pik_reading){.seq = 0};
    b->any = false;
    pik_set_period(b, (unsigned)(pik_profile_period_ns(&b->profile) / STEP_NS), t_ns);
}

void pik_set_period(struct pik *b, unsigned period_100us, int64_t t_ns)
{
    b->period_100us = period_100us;
    if (period_100us > 0) sched_at(b->base.sched, &b->latch, t_ns + pik_period_ns(b));
    else sched_cancel(b->base.sched, &b->latch);
}

bool pik_period_fits(const struct pik *b, unsigned period_100us)
{
    const double pulses = (double)period_100us * STEP_NS * 1e-9 * pik_profile_limit_hz(&b->profile);
    return period_100us == 0 ||
           (period_100us >= 2 && pulses <= 32767.0 && period_100us * (int64_t)STEP_NS > b->profile.latch_ns);
}

void pik_period_range(const struct pik *b, unsigned *least, unsigned *most)
{
    const double limit = 32767.0 / (STEP_NS * 1e-9 * pik_profile_limit_hz(&b->profile));
    *least = b->profile.latch_ns / STEP_NS < 2 ? 2 : b->profile.latch_ns / STEP_NS + 1;
    *most = limit > 65535.0 ? 65535 : (unsigned)limit;
    while (*most > 0 && !pik_period_fits(b, *most)) (*most)--; /* what rounding has made of it */
}

void pik_latch_init(struct pik *b)
{
    sched_ev_inner(&b->latch, latch_periodically, b);
    sched_ev_inner(&b->latch_end, latch_end, b);
}

#include "board/pik/converter.h"

#include <assert.h>

struct pik_axis pik_axis_at(int64_t tick, const struct pik_drive *d)
{
    return (struct pik_axis){.drive = *d, .tick = tick, .begun_tick = -1};
}

/* Whole steps of `step` that reach `way`, both positive. */
static int64_t steps_to(int64_t way, int64_t step)
{
    return (way + step - 1) / step;
}

/* First tick at which a reset of this sign may begin. */
static int64_t ready_tick(const struct pik_axis *a, int sign)
{
    if (a->begun_sign == 0) return a->tick + 1;
    const int64_t recovery = sign == a->begun_sign ? a->drive.recovery_ticks : 0;
    const int64_t ready = a->begun_tick + a->drive.pulse_ticks + recovery;
    return ready > a->tick ? ready : a->tick + 1;
}

/* First tick at which one does, if there is no other before. */
static int64_t next_of(const struct pik_axis *a, int sign)
{
    const struct pik_drive *d = &a->drive;
    const int64_t ready = ready_tick(a, sign);
    const int64_t way = d->threshold - sign * (a->charge + d->per_tick * (ready - a->tick));
    if (way <= 0) return ready;
    return sign * d->per_tick > 0 ? ready + steps_to(way, sign * d->per_tick) : PIK_NEVER;
}

int64_t pik_axis_next(const struct pik_axis *a)
{
    const int64_t plus = next_of(a, 1), minus = next_of(a, -1);
    return plus < minus ? plus : minus;
}

/* A reset begins at a tick, at which the charge is beyond the threshold. */
static void begin_reset(struct pik_axis *a, int64_t tick)
{
    const struct pik_drive *d = &a->drive;
    a->charge += d->per_tick * (tick - a->tick);
    const int sign = a->charge > 0 ? 1 : -1;
    if (a->begun_sign == -sign && tick == a->begun_tick + d->pulse_ticks) a->opposed++;
    if (sign > 0) a->plus++;
    else a->minus++;
    a->charge -= sign > 0 ? d->plus : -d->minus;
    a->tick = a->begun_tick = tick;
    a->begun_sign = sign;
}

/* After a reset on the side of the drive: whether all further ones up to the next look come as the input reaches the
 * threshold, none waits for its reference and none overshoots to the other threshold. */
static bool resets_regularly(const struct pik_axis *a)
{
    const struct pik_drive *d = &a->drive;
    const int64_t speed = a->begun_sign * d->per_tick;
    if (a->begun_tick != a->tick || speed <= 0) return false;
    const int64_t weight = a->begun_sign > 0 ? d->plus : d->minus;
    const int64_t charge = a->begun_sign * a->charge;
    const int64_t later = d->threshold - weight < charge ? d->threshold - weight : charge;
    const int64_t blind = speed * (d->pulse_ticks + d->recovery_ticks);
    return weight >= blind && d->threshold - charge > blind - speed && later + speed * d->pulse_ticks > -d->threshold;
}

/* The regular resets up to tick at one stroke. */
static void apply_resets(struct pik_axis *a, int64_t tick)
{
    const struct pik_drive *d = &a->drive;
    const int sign = a->begun_sign;
    const int64_t speed = sign * d->per_tick;
    const int64_t weight = sign > 0 ? d->plus : d->minus;
    const int64_t charge = sign * a->charge;
    const int64_t end = charge + speed * (tick - a->tick);
    if (end < d->threshold) return;
    const int64_t n = (end - d->threshold) / weight + 1;
    const int64_t last = a->tick + steps_to(d->threshold + (n - 1) * weight - charge, speed);
    if (sign > 0) a->plus += (uint64_t)n;
    else a->minus += (uint64_t)n;
    a->charge += d->per_tick * (last - a->tick) - sign * n * weight;
    a->tick = a->begun_tick = last;
}

/* Without a reset on the way, as most stretches are: the charge goes straight. */
static bool stays_within(struct pik_axis *a, int64_t tick)
{
    const int64_t end = a->charge + a->drive.per_tick * (tick - a->tick), limit = a->drive.threshold;
    if (a->charge >= limit || a->charge <= -limit || end >= limit || end <= -limit) return false;
    a->charge = end;
    a->tick = tick;
    return true;
}

void pik_axis_advance(struct pik_axis *a, int64_t tick)
{
    assert(tick >= a->tick);
    if (stays_within(a, tick)) return;
    for (int64_t next = pik_axis_next(a); next <= tick; next = pik_axis_next(a)) {
        begin_reset(a, next);
        if (resets_regularly(a)) apply_resets(a, tick);
    }
    a->charge += a->drive.per_tick * (tick - a->tick);
    a->tick = tick;
}

void pik_axis_look(struct pik_axis *a, int64_t tick, const struct pik_drive *d)
{
    pik_axis_advance(a, tick);
    const int64_t rail = a->drive.rail;
    if ((a->charge < 0 ? -a->charge : a->charge) > a->drive.threshold + PIK_PULSE) a->saturated++;
    if (a->charge > rail) {
        a->lost += a->charge - rail;
        a->charge = rail;
    }
    if (a->charge < -rail) {
        a->lost += -rail - a->charge;
        a->charge = -rail;
    }
    a->drive = *d;
}

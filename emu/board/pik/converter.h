/* One channel of a charge-balance converter, voltage to pulses (article, sections 1 and 2, figure 2).
 *
 * The integrator takes the input without a break. Where its output is at +Uc or -Uc or beyond, the control unit begins a
 * reset at the next tick of its clock: a reference of the opposite sign for TCLK, one pulse of output. While it lasts no other
 * begins, and the same reference rests a while before it is used again. Charge is counted in nominal pulses, in integers,
 * and the input is constant between two looks at it: so the pulses of any stretch follow in closed form, and are the same
 * whatever the resolution of the observer. Pure, plain struct. */
#ifndef PSABENCH_BOARD_PIK_CONVERTER_H
#define PSABENCH_BOARD_PIK_CONVERTER_H

#include <stdbool.h>
#include <stdint.h>

#define PIK_PULSE (INT64_C(1) << 48) /* charge of a nominal reset */
#define PIK_NEVER INT64_MAX          /* no reset will come */

/* What holds until the next look. Charges in 1/PIK_PULSE. */
struct pik_drive {
    int64_t per_tick;       /* that the input brings in a tick */
    int64_t plus, minus;    /* that a reset takes away, or brings: both positive */
    int64_t threshold;      /* Uc times the capacitor */
    int64_t rail;           /* beyond which the integrator takes no charge, > threshold + a pulse */
    int64_t pulse_ticks;    /* of a reset, >= 1 */
    int64_t recovery_ticks; /* after it, until the next of the same sign may begin, >= 0 */
};

struct pik_axis {
    struct pik_drive drive;
    int64_t tick;       /* up to which, included, it has been decided whether a reset begins */
    int64_t charge;     /* on the capacitor at that tick; a reset that has begun is taken off whole */
    int64_t begun_tick; /* of the last reset; negative before the first */
    int begun_sign;     /* of the input it balances: +1, -1; 0 before the first */
    uint64_t plus, minus;
    uint32_t saturated; /* looks at which it stood more than a pulse beyond the threshold: it cannot keep up */
    uint32_t opposed;   /* resets of the other sign as soon as the one before was over */
    int64_t lost;       /* charge beyond the rail, magnitude */
};

/* At tick, with an empty capacitor and no pulses counted. */
struct pik_axis pik_axis_at(int64_t tick, const struct pik_drive *d);

/* Tick of the next reset after a->tick, PIK_NEVER if the drive brings none. */
int64_t pik_axis_next(const struct pik_axis *a);

/* Up to and including tick, not before a->tick. */
void pik_axis_advance(struct pik_axis *a, int64_t tick);

/* A look: up to tick with the drive that held so far, then the other. What is beyond the rail is lost. */
void pik_axis_look(struct pik_axis *a, int64_t tick, const struct pik_drive *d);

/* Whether a reset is under way at a->tick. */
static inline bool pik_axis_resetting(const struct pik_axis *a)
{
    return a->begun_sign != 0 && a->tick < a->begun_tick + a->drive.pulse_ticks;
}

#endif

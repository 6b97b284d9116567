/* What the files of the PMKA board share. Not for others. */
#ifndef PSABENCH_BOARD_PMKA_INTERNAL_H
#define PSABENCH_BOARD_PMKA_INTERNAL_H

#include "board/pmka/pmka.h"

static inline void pmka_line(struct pmka *b, unsigned line, bool level, int64_t t_ns)
{
    trace_set(&b->base.trace, line, level && b->life != PMKA_OFF, t_ns);
}

static inline int64_t pmka_half_ns(const struct pmka *b)
{
    return b->profile.ts_ns / 2;
}

/* pmka/sample.c */
void pmka_sample_init(struct pmka *b);
void pmka_probes_init(struct pmka *b); /* real-valued channels of the trace */
void pmka_probe(struct pmka *b, unsigned i,
                int64_t t_ns); /* its output voltage, at an instant up to which it is integrated */
void pmka_integrate(struct pmka *b, unsigned i, int64_t t_ns); /* its state at t_ns, not before the last call's */
void pmka_integrate_axis(struct pmka *b, unsigned axis, int64_t t_ns); /* of an axis that no integrator has */
void pmka_sample(struct pmka *b, unsigned i, int64_t t_ns);            /* hold, comparators, reset */
void pmka_cut_reset(struct pmka *b, unsigned i, int64_t t_ns);         /* one under way ends now */
void pmka_converter_wake(struct pmka *b, int64_t t_ns);                /* SH, CONV: an observer is about to subscribe */
void pmka_converter_stop(struct pmka *b, int64_t t_ns);

/* pmka/rotation.c */
void pmka_rotation_start(struct pmka *b);             /* as after Res */
void pmka_rotation_next(struct pmka *b);              /* a Ts begins: what the next period will be */
bool pmka_rotation_turns(const struct pmka *b);       /* a hand-over comes in this Ts */
void pmka_release_axis(struct pmka *b, int64_t t_ns); /* K gives its axis back */
void pmka_take_axis(struct pmka *b, int64_t t_ns);    /* K takes the next one */
void pmka_keys_home(struct pmka *b, int64_t t_ns);    /* each axis on its own integrator */
void pmka_key_stuck(struct pmka *b, int64_t t_ns);    /* b->base.faults has changed */

/* pmka/bus.c */
void pmka_bus_init(struct pmka *b);
void pmka_bus_cut(struct pmka *b, int64_t t_ns);

#endif

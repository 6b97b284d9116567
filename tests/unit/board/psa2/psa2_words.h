/* A PSA-2 board, and what is asked of its frames. */
#ifndef PSABENCH_TESTS_PSA2_WORDS_H
#define PSABENCH_TESTS_PSA2_WORDS_H

#include "psa2_rig.h"

static struct rig rig;

static inline void near(double got, double want, double tol)
{
    if (!(got - want <= tol && want - got <= tol)) fail_msg("got %.9g, want %.9g within %g", got, want, tol);
}

static inline const struct psa2_frame *last(const struct rig *r)
{
    return &r->frame[r->frames - 1];
}

/* Every frame begins on the grid of CLK (0.5 us), a fixed delay after its DRD_A: no other burst was in the way. */
static inline void no_read_was_late(const struct rig *r)
{
    for (unsigned i = 0; i < r->frames; i++) {
        const struct psa2_frame *f = &r->frame[i];
        assert_in_range(f->t_int_fall_ns - f->t_sample_ns, 24000, 28000);
        assert_int_equal(f->t_int_fall_ns % 500, 0);
    }
}

#endif

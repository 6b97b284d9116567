/* What a PSA-2 keeps while it sleeps: frames that no one looks at, and where its temperature scan repeats itself. */
#ifndef PSABENCH_BOARD_PSA2_SLEEP_H
#define PSABENCH_BOARD_PSA2_SLEEP_H

#include "base/sched.h"

#include <stdint.h>

#define PSA2_CYCLE_MAX 32u

/* Where a temperature conversion begins: count of the converter's clock, and the rise of SYNC_T. */
struct psa2_start {
    int64_t tau, sync_ns;
};

/* Temperature conversions that begin at the same places of the clocks again and again (psa2/temp_cycle.c). */
struct psa2_cycle {
    int64_t unit_tau;       /* what all clocks and the frames repeat in; 0: not known, or not worth while */
    struct psa2_start span; /* from a conversion to the n-th after it; 0: not found yet */
    unsigned n;             /* conversions noted; once it is found: in the cycle */
    struct psa2_start at[PSA2_CYCLE_MAX]; /* in a row */
};

enum psa2_sleep { PSA2_AWAKE, PSA2_ASLEEP, PSA2_WAKING };

/* Frames that no one looks at (psa2/lazy.c). */
struct psa2_lazy {
    enum psa2_sleep sleep;
    unsigned left;           /* WAKING: frames until all is as if it had never slept */
    int64_t past_ns;         /* of what the sensors remember most; 0: nothing */
    int64_t span_ns;         /* ASLEEP: from data-ready to the end of its frame, at most */
    int64_t ask_ns;          /* AWAKE: not before is it asked whether it may sleep */
    int64_t bound_ns;        /* ASLEEP: not known to be harmless for longer */
    int64_t held_ns;         /* ASLEEP: does not wake up before */
    int64_t temp_ns;         /* ASLEEP: until then codes of conversions that were skipped are left */
    struct psa2_cycle cycle; /* ASLEEP */
    struct sched_ev again;   /* ASLEEP: more conversions may be skipped */
};

#endif

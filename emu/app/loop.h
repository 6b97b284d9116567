/* The one poll loop: one thread, no locks.
 *
 * A turn: run what is due at this pace, flush every link, wait for input or the next event, deliver input stamped with the
 * simulated instant, fire the links' timers, reap. In step and free pace time stands still while a link's output is above
 * its high-water mark, so that nothing is lost on the way to a slow reader; a reader that keeps it waiting is named. */
#ifndef PSABENCH_APP_LOOP_H
#define PSABENCH_APP_LOOP_H

#include "app/pace.h"
#include "base/sched.h"
#include "link/link.h"

#include <signal.h>

#define LOOP_LINKS_MAX 768u /* all that the endpoints of one emulator can have: ports.c */

struct loop {
    struct sched *sched;
    struct pace *pace;
    struct links *links;
    unsigned boards;                          /* that may be asleep */
    int64_t end_ns;                           /* simulated time at which to stop; SCHED_NEVER: run on */
    bool (*may_start)(void *ctx);             /* free, wall: time waits until this is true; NULL: at once */
    void (*moved)(void *ctx, int64_t now_ns); /* after time has moved: traces and files follow */
    void (*run_done)(void *ctx);              /* a run of step pace is over and its output with the kernel */
    bool (*taken)(void *ctx, uint64_t count); /* so many frames of CAN clients, or no more before time moves */
    void (*say)(const char *text);            /* news of a link, for the user */
    bool (*sliced)(
        void *ctx); /* lines are sampled into buffers of a bounded size: no strides beyond a slice; NULL: never */
    void *ctx;
    /* read-only outside loop.c */
    bool quit, started;
    enum { LOOP_IDLE, LOOP_ARMED, LOOP_RUNNING } run; /* step pace: ARMED waits for one look at all input */
    int64_t until_ns;                                 /* of the run */
    uint64_t after_taken;
    int64_t stride_ns;     /* simulated time between looks at input while all boards sleep */
    int64_t full_since_ns; /* wall time at which simulated time began to wait for a reader; 0: it does not wait */
    unsigned notices;      /* said so far */
    unsigned busy_turns;   /* consecutive turns with a ready descriptor */
};

/* Runs until quit, end_ns, or *stop becomes non-zero: set by a handler of SIGINT or SIGTERM, which the caller has blocked
 * and which are open only while the loop waits, so that none is missed. */
void loop_run(struct loop *l, const volatile sig_atomic_t *stop);

/* Hands out what waits, while peers keep reading, and lets peers hang up that should do so first: at the end of a run. Gives up after timeout_ms without progress. */
void loop_drain(struct loop *l, int timeout_ms);

/* Step pace: time is to move by for_ns once `taken` says so of after_taken. False: a run is under way. */
bool loop_step(struct loop *l, int64_t for_ns, uint64_t after_taken);

/* From within an event: the run ends at the present instant, and is over when its output is with the kernel. */
void loop_stop_step(struct loop *l);

void loop_cancel_step(struct loop *l); /* who asked has gone: stop where we are */

#endif

#define _GNU_SOURCE /* clock_gettime */
#include "app/pace.h"

#include <string.h>
#include <sys/prctl.h>
#include <time.h>

static const char *const names[] = {[PACE_WALL] = "wall", [PACE_STEP] = "step", [PACE_FREE] = "free"};

const char *pace_name(enum pace_kind kind)
{
    return names[kind];
}

int64_t pace_clock_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

void pace_init(struct pace *p, enum pace_kind kind)
{
    memset(p, 0, sizeof *p);
    p->kind = kind;
    prctl(PR_SET_TIMERSLACK, 1000UL, 0UL, 0UL, 0UL); /* 50 us by default: half of what we are late */
}

void pace_start(struct pace *p, int64_t sim_ns)
{
    p->origin_ns = pace_clock_ns() - sim_ns;
}

int64_t pace_target_ns(struct pace *p, int64_t sim_ns)
{
    const int64_t target_ns = pace_clock_ns() - p->origin_ns;
    if (target_ns - sim_ns <= PACE_SLIP_NS) return target_ns;
    p->slips++;
    p->origin_ns += target_ns - sim_ns;
    return sim_ns;
}

void pace_event(struct pace *p, int64_t due_ns, int64_t target_ns)
{
    const int64_t late_ns = target_ns - due_ns;
    p->late += late_ns >= PACE_LATE_NS;
    pace_hist_add(&p->events, late_ns);
}

/* Bucket b covers (4 + b % 4) / 4 * 2^(b / 4) us and up; the first ones hold 0..3 us one by one. */
static unsigned bucket_of(uint64_t us)
{
    unsigned octave = 0;
    while (us >> octave > 7) octave++;
    const uint64_t b = us < 4 ? us : 4u * octave + (us >> octave);
    return b < PACE_BUCKETS ? (unsigned)b : PACE_BUCKETS - 1;
}

/* First microsecond that is above the bucket. */
static double bucket_end_us(unsigned b)
{
    if (b < 4) return (double)(b + 1);
    const unsigned octave = b / 4 - 1;
    return (double)((uint64_t)(b % 4 + 5) << octave);
}

void pace_hist_add(struct pace_hist *h, int64_t late_ns)
{
    const int64_t late = late_ns > 0 ? late_ns : 0;
    h->count[bucket_of((uint64_t)late / 1000)]++;
    h->total++;
    if (late > h->max_ns) h->max_ns = late;
}

double pace_hist_us(const struct pace_hist *h, double share)
{
    uint64_t below = 0;
    for (unsigned b = 0; b < PACE_BUCKETS && h->total; b++) {
        below += h->count[b];
        if ((double)below < share * (double)h->total) continue;
        const double end = bucket_end_us(b), max = (double)h->max_ns * 1e-3;
        return end < max ? end : max;
    }
    return 0.0;
}

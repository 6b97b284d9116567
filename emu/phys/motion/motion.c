#include "phys/motion/motion.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <assert.h>
#include <math.h>

#define FAR_RAD    1e9  /* further than any table is sent */
#define FAR_S      9e9  /* 285 years: past it the nanoseconds of an int64_t end */
#define ROUNDING_S 1e-9 /* a ramp that ends when the next begins may be later by this */

/* ---- evaluation */

static struct motion_state coast_from(const struct motion_state *from, double t_s)
{
    return (struct motion_state){
        from->angle_rad + (from->rate_radps + 0.5 * from->accel_radps2 * t_s) * t_s,
        from->rate_radps + from->accel_radps2 * t_s,
        from->accel_radps2,
    };
}

/* From the lowest point, where the rate is zero. Whole cycles are taken off before the sine. */
static struct motion_state swing_at(const struct motion_plan *p, const struct motion_state *lowest, double t_s)
{
    const double cycles = p->sine_hz * t_s;
    const double phase_rad = TURN_RAD * (cycles - floor(cycles));
    const double w = TURN_RAD * p->sine_hz;
    const struct det_pair phase = det_sin_cos(phase_rad);
    return (struct motion_state){
        lowest->angle_rad + p->sine_rad * (1.0 - phase.cos),
        p->sine_rad * w * phase.sin,
        p->sine_rad * w * w * phase.cos,
    };
}

static const struct motion_plan *plan_at(const struct motion *m, int64_t t_ns)
{
    unsigned i = m->latest;
    for (unsigned n = 1; n < MOTION_HISTORY && m->plan[i].start_ns > t_ns; n++)
        i = (i + MOTION_HISTORY - 1) % MOTION_HISTORY;
    return &m->plan[i];
}

struct motion_state motion_at(const struct motion *m, int64_t t_ns)
{
    const struct motion_plan *p = plan_at(m, t_ns);
    const double t_s = sched_since_s(p->start_ns, t_ns);
    unsigned i = p->count - 1;
    while (i > 0 && p->piece[i].t_s > t_s) i--;
    const struct motion_piece *piece = &p->piece[i];
    if (p->sine_hz > 0.0 && i == p->count - 1) return swing_at(p, &piece->from, t_s - piece->t_s);
    return coast_from(&piece->from, t_s - piece->t_s);
}

int64_t motion_known_ns(const struct motion *m)
{
    return m->plan[(m->latest + 1) % MOTION_HISTORY].start_ns;
}

/* Pieces begin between two nanoseconds: the later one it is. */
int64_t motion_smooth_ns(const struct motion *m, int64_t t_ns)
{
    const struct motion_plan *p = plan_at(m, t_ns);
    for (unsigned i = 0; i < p->count; i++) {
        const double after_s = p->piece[i].t_s;
        if (after_s > FAR_S) break;
        const int64_t at_ns = p->start_ns + (int64_t)ceil(after_s * (double)NS_PER_S);
        if (at_ns > t_ns) return at_ns;
    }
    return INT64_MAX;
}

int64_t motion_rest_ns(const struct motion *m)
{
    const struct motion_plan *p = &m->plan[m->latest];
    const double end_s = p->piece[p->count - 1].t_s;
    if (!p->ends || end_s + (double)p->start_ns / (double)NS_PER_S > FAR_S) return INT64_MAX;
    return p->start_ns + (int64_t)ceil(end_s * (double)NS_PER_S);
}

bool motion_at_rest(const struct motion *m, int64_t t_ns)
{
    return t_ns >= motion_rest_ns(m);
}

enum motion_mode motion_mode(const struct motion *m)
{
    return m->plan[m->latest].mode;
}

/* ---- planning: a plan grows piece by piece; `now` is where its last piece has come to */

struct draft {
    struct motion_plan plan;
    double accel_radps2; /* limit */
    double t_s;
    struct motion_state now;
};

static struct draft draft_from(const struct motion *m, enum motion_mode mode, int64_t t_ns)
{
    struct draft d = {.plan = {.mode = mode, .start_ns = t_ns}, .accel_radps2 = m->limits.accel_radps2};
    d.now = motion_at(m, t_ns);
    return d;
}

static void add_piece(struct draft *d, double accel_radps2)
{
    assert(d->plan.count < MOTION_PIECES);
    d->now.accel_radps2 = accel_radps2;
    d->plan.piece[d->plan.count++] = (struct motion_piece){d->t_s, d->now};
}

static void run_for(struct draft *d, double accel_radps2, double t_s)
{
    if (t_s <= 0.0) return;
    add_piece(d, accel_radps2);
    d->now = coast_from(&d->now, t_s);
    d->t_s += t_s;
}

static void rest_at(struct draft *d, double angle_rad)
{
    d->now = (struct motion_state){.angle_rad = angle_rad};
    add_piece(d, 0.0);
    d->plan.ends = true;
}

static void ramp_to(struct draft *d, double rate_radps)
{
    const double change = rate_radps - d->now.rate_radps;
    run_for(d, copysign(d->accel_radps2, change), fabs(change) / d->accel_radps2);
    d->now.rate_radps = rate_radps;
}

static double stopping_rad(const struct draft *d)
{
    return d->now.angle_rad + d->now.rate_radps * fabs(d->now.rate_radps) / (2.0 * d->accel_radps2);
}

/* Speeds along the way to the angle: v0 to peak, cruise, peak to zero. Beyond the cap at the start it slows to the cap; the
 * way is then always long enough, since the sense is taken from where the axis would stop. */
static void move_to(struct draft *d, double angle_rad, double cap_radps)
{
    const double a = d->accel_radps2;
    const double sense = angle_rad >= stopping_rad(d) ? 1.0 : -1.0;
    const double way = sense * (angle_rad - d->now.angle_rad);
    const double v0 = sense * d->now.rate_radps;
    const double peak = fmin(cap_radps, sqrt(fmax(0.0, a * way + 0.5 * v0 * v0)));
    const double ramps = 0.5 * (v0 + peak) * fabs(peak - v0) / a + 0.5 * peak * peak / a;
    run_for(d, copysign(a, sense * (peak - v0)), fabs(peak - v0) / a);
    d->now.rate_radps = sense * peak;
    if (peak > 0.0) run_for(d, 0.0, (way - ramps) / peak);
    run_for(d, -sense * a, peak / a);
    rest_at(d, angle_rad);
}

/* On at the present rate for good; a bounded axis goes to its limit instead. */
static void go_on(struct draft *d, const struct motion_limits *l, double rate_radps)
{
    if (rate_radps == 0.0) {
        rest_at(d, d->now.angle_rad);
    } else if (l->bounded) {
        move_to(d, rate_radps > 0.0 ? l->max_rad : l->min_rad, fabs(rate_radps));
    } else {
        add_piece(d, 0.0);
    }
}

static void accept_draft(struct motion *m, const struct draft *d)
{
    if (m->plan[m->latest].start_ns < d->plan.start_ns) m->latest = (m->latest + 1) % MOTION_HISTORY;
    m->plan[m->latest] = d->plan;
}

/* ---- commands */

void motion_init(struct motion *m, const struct motion_limits *limits)
{
    assert(limits->rate_radps > 0.0 && limits->accel_radps2 > 0.0);
    *m = (struct motion){.limits = *limits};
    const double start_rad = limits->bounded ? fmax(limits->min_rad, fmin(0.0, limits->max_rad)) : 0.0;
    for (unsigned i = 0; i < MOTION_HISTORY; i++) {
        m->plan[i] = (struct motion_plan){.count = 1, .ends = true};
        m->plan[i].piece[0].from.angle_rad = start_rad;
    }
}

static bool within_limits(const struct motion_limits *l, double angle_rad)
{
    if (!l->bounded) return fabs(angle_rad) <= FAR_RAD;
    return angle_rad >= l->min_rad && angle_rad <= l->max_rad;
}

enum motion_result motion_position(struct motion *m, double angle_rad, double rate_radps, int64_t t_ns)
{
    const double cap = rate_radps != 0.0 ? fabs(rate_radps) : m->limits.rate_radps;
    if (!(cap <= m->limits.rate_radps)) return MOTION_RATE_LIMIT;
    if (!within_limits(&m->limits, angle_rad)) return MOTION_ANGLE_LIMIT;
    struct draft d = draft_from(m, MOTION_POSITION, t_ns);
    move_to(&d, angle_rad, cap);
    accept_draft(m, &d);
    return MOTION_OK;
}

enum motion_result motion_rate(struct motion *m, double rate_radps, int64_t t_ns)
{
    if (!(fabs(rate_radps) <= m->limits.rate_radps)) return MOTION_RATE_LIMIT;
    struct draft d = draft_from(m, MOTION_RATE, t_ns);
    if (!m->limits.bounded || rate_radps == 0.0) ramp_to(&d, rate_radps);
    go_on(&d, &m->limits, rate_radps);
    accept_draft(m, &d);
    return MOTION_OK;
}

/* The furthest that a plan of ramps and constant rates goes: the ends of its pieces, and where a rate changes sign. */
static bool stays_within(const struct motion_limits *l, const struct draft *d)
{
    for (unsigned i = 0; i < d->plan.count; i++) {
        const struct motion_state *from = &d->plan.piece[i].from;
        const double end_s = (i + 1 < d->plan.count ? d->plan.piece[i + 1].t_s : d->t_s) - d->plan.piece[i].t_s;
        const double turn_s = from->accel_radps2 != 0.0 ? -from->rate_radps / from->accel_radps2 : 0.0;
        if (!within_limits(l, coast_from(from, end_s).angle_rad)) return false;
        if (turn_s > 0.0 && turn_s < end_s && !within_limits(l, coast_from(from, turn_s).angle_rad)) return false;
    }
    return true;
}

static enum motion_result check_profile(const struct motion_limits *l, const double *times_s, const double *rates_radps,
                                        unsigned n)
{
    if (n == 0 || n > MOTION_PROFILE_MAX || !(times_s[0] >= 0.0)) return MOTION_BAD_PROFILE;
    for (unsigned i = 0; i < n; i++) {
        if (i > 0 && !(times_s[i] > times_s[i - 1])) return MOTION_BAD_PROFILE;
        if (!(fabs(rates_radps[i]) <= l->rate_radps)) return MOTION_RATE_LIMIT;
    }
    return MOTION_OK;
}

enum motion_result motion_profile(struct motion *m, const double *times_s, const double *rates_radps, unsigned n,
                                  int64_t t_ns)
{
    const enum motion_result bad = check_profile(&m->limits, times_s, rates_radps, n);
    if (bad) return bad;
    struct draft d = draft_from(m, MOTION_PROFILE, t_ns);
    for (unsigned i = 0; i < n; i++) {
        if (d.t_s > times_s[i] + ROUNDING_S) return MOTION_ACCEL_LIMIT;
        run_for(&d, 0.0, times_s[i] - d.t_s);
        ramp_to(&d, rates_radps[i]);
    }
    if (!stays_within(&m->limits, &d) || !within_limits(&m->limits, stopping_rad(&d))) return MOTION_ANGLE_LIMIT;
    go_on(&d, &m->limits, rates_radps[n - 1]);
    accept_draft(m, &d);
    return MOTION_OK;
}

enum motion_result motion_sine(struct motion *m, double amplitude_rad, double frequency_hz, int64_t t_ns)
{
    const double w = TURN_RAD * frequency_hz;
    if (!(amplitude_rad > 0.0 && frequency_hz > 0.0)) return MOTION_BAD_SINE;
    if (amplitude_rad * w > m->limits.rate_radps) return MOTION_RATE_LIMIT;
    if (amplitude_rad * w * w > m->limits.accel_radps2) return MOTION_ACCEL_LIMIT;
    struct draft d = draft_from(m, MOTION_SINE, t_ns);
    const double centre_rad = stopping_rad(&d);
    if (!within_limits(&m->limits, centre_rad - amplitude_rad) ||
        !within_limits(&m->limits, centre_rad + amplitude_rad)) {
        return MOTION_ANGLE_LIMIT;
    }
    move_to(&d, centre_rad - amplitude_rad, m->limits.rate_radps);
    d.plan.ends = false;
    d.plan.sine_rad = amplitude_rad;
    d.plan.sine_hz = frequency_hz;
    accept_draft(m, &d);
    return MOTION_OK;
}

void motion_stop(struct motion *m, int64_t t_ns)
{
    struct draft d = draft_from(m, MOTION_STOPPED, t_ns);
    const double angle_rad = stopping_rad(&d);
    ramp_to(&d, 0.0);
    rest_at(&d, angle_rad);
    accept_draft(m, &d);
}

/* ---- names */

const char *motion_mode_name(enum motion_mode mode)
{
    static const char *const names[] = {[MOTION_STOPPED] = "stopped",
                                        [MOTION_POSITION] = "position",
                                        [MOTION_RATE] = "rate",
                                        [MOTION_PROFILE] = "profile",
                                        [MOTION_SINE] = "sine"};
    return names[mode];
}

const char *motion_result_text(enum motion_result result)
{
    static const char *const texts[] = {
        [MOTION_OK] = "done",
        [MOTION_RATE_LIMIT] = "exceeds the axis's rate limit",
        [MOTION_ACCEL_LIMIT] = "exceeds the axis's acceleration limit",
        [MOTION_ANGLE_LIMIT] = "leaves the axis's range of angles",
        [MOTION_BAD_PROFILE] = "profile: expected 1 to 32 points with times rising from 0",
        [MOTION_BAD_SINE] = "sine: expected an amplitude and a frequency above 0",
        [MOTION_NO_AXIS] = "the table has no such axis",
    };
    return texts[result];
}

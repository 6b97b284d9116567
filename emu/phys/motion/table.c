#include "phys/motion/table.h"

#include "base/detmath.h"
#include "base/rng.h"
#include "base/sched.h"

#include <assert.h>
#include <math.h>

#define WHOLE_ABOVE  1000.0 /* rad */
#define ROUNDING_RAD 1e-9   /* by which a limit may be missed that was given as the readout shows it */

/* Of the kind of a one-axis iXBlue EVO 30 L; figures E0 (docs/instruments.md). */
static const struct table_axis_cfg precise = {
    .rate_max_dps = 1000.0, .accel_max_dps2 = 400.0, .wobble_arcsec = 1.0, .readout_resolution_arcsec = 0.036};

struct table_cfg table_default(unsigned axes)
{
    static const enum pose_axis along[TABLE_AXES_MAX + 1][TABLE_AXES_MAX] = {
        {POSE_Z, POSE_Y, POSE_X}, {POSE_Z, POSE_Y, POSE_X}, {POSE_Y, POSE_Z, POSE_X}, {POSE_Z, POSE_Y, POSE_X}};
    assert(axes <= TABLE_AXES_MAX);
    struct table_cfg c = {.axes = axes};
    for (unsigned i = 0; i < TABLE_AXES_MAX; i++) {
        c.axis[i] = precise;
        c.axis[i].along = along[axes][i];
    }
    return c;
}

/* ---- commands */

/* What the readout shows above the true angle. */
static double offset_rad(const struct table *t, unsigned axis)
{
    return t->cfg.axis[axis].readout_zero_arcsec * RAD_PER_ARCSEC + t->set_zero_rad[axis];
}

double table_offset_deg(const struct table *t, unsigned axis)
{
    return offset_rad(t, axis) / RAD_PER_DEG;
}

/* The axis's angle for one of the readout. */
static double axis_rad(const struct table *t, unsigned axis, double shown_deg)
{
    const struct motion_limits *l = &t->axis[axis].limits;
    const double angle_rad = shown_deg * RAD_PER_DEG - offset_rad(t, axis);
    if (l->bounded && fabs(angle_rad - l->min_rad) < ROUNDING_RAD) return l->min_rad;
    if (l->bounded && fabs(angle_rad - l->max_rad) < ROUNDING_RAD) return l->max_rad;
    return angle_rad;
}

static enum motion_result drop_cache(struct table *t, enum motion_result r)
{
    t->cached_to_ns = -1;
    return r;
}

enum motion_result table_position(struct table *t, unsigned axis, double angle_deg, double rate_dps, int64_t t_ns)
{
    if (axis >= t->cfg.axes) return MOTION_NO_AXIS;
    return drop_cache(t, motion_position(&t->axis[axis], axis_rad(t, axis, angle_deg), rate_dps * RAD_PER_DEG, t_ns));
}

enum motion_result table_rate(struct table *t, unsigned axis, double rate_dps, int64_t t_ns)
{
    if (axis >= t->cfg.axes) return MOTION_NO_AXIS;
    return drop_cache(t, motion_rate(&t->axis[axis], rate_dps * RAD_PER_DEG, t_ns));
}

enum motion_result table_profile(struct table *t, unsigned axis, const double *times_s, const double *rates_dps,
                                 unsigned n, int64_t t_ns)
{
    double rates_radps[MOTION_PROFILE_MAX];
    if (axis >= t->cfg.axes) return MOTION_NO_AXIS;
    if (n > MOTION_PROFILE_MAX) return MOTION_BAD_PROFILE;
    for (unsigned i = 0; i < n; i++) rates_radps[i] = rates_dps[i] * RAD_PER_DEG;
    return drop_cache(t, motion_profile(&t->axis[axis], times_s, rates_radps, n, t_ns));
}

enum motion_result table_sine(struct table *t, unsigned axis, double amplitude_deg, double frequency_hz, int64_t t_ns)
{
    if (axis >= t->cfg.axes) return MOTION_NO_AXIS;
    return drop_cache(t, motion_sine(&t->axis[axis], amplitude_deg * RAD_PER_DEG, frequency_hz, t_ns));
}

enum motion_result table_stop(struct table *t, unsigned axis, int64_t t_ns)
{
    if (axis >= t->cfg.axes) return MOTION_NO_AXIS;
    motion_stop(&t->axis[axis], t_ns);
    return drop_cache(t, MOTION_OK);
}

/* ---- ripple */

void table_ripple_add(struct table *t, struct table_ripple *r)
{
    r->next = t->ripples;
    t->ripples = r;
    (void)drop_cache(t, MOTION_OK);
}

void table_ripple_remove(struct table *t, struct table_ripple *r)
{
    struct table_ripple **at = &t->ripples;
    while (*at && *at != r) at = &(*at)->next;
    if (*at) *at = r->next;
    (void)drop_cache(t, MOTION_OK);
}

/* Rate A sin(w t): the angle swings between 0 and 2 A / w. */
static void apply_ripple(const struct table_ripple *r, int64_t t_ns, struct motion_state *s)
{
    const double w_radps = TURN_RAD * r->hz;
    const double turns = r->hz * sched_since_s(r->from_ns, t_ns);
    const struct det_pair at = det_sin_cos(TURN_RAD * (turns - floor(turns)));
    s->angle_rad += r->rate_radps / w_radps * (1.0 - at.cos);
    s->rate_radps += r->rate_radps * at.sin;
    s->accel_radps2 += r->rate_radps * w_radps * at.cos;
}

static struct motion_state axis_state(const struct table *t, unsigned axis, int64_t t_ns)
{
    struct motion_state s = motion_at(&t->axis[axis], t_ns);
    for (const struct table_ripple *r = t->ripples; r; r = r->next)
        if (r->axis == axis && t_ns >= r->from_ns) apply_ripple(r, t_ns, &s);
    return s;
}

/* ---- readout */

enum motion_result table_zero(struct table *t, unsigned axis, double angle_deg, int64_t t_ns)
{
    if (axis >= t->cfg.axes) return MOTION_NO_AXIS;
    const double true_rad = axis_state(t, axis, t_ns).angle_rad;
    t->set_zero_rad[axis] += angle_deg * RAD_PER_DEG - (true_rad + offset_rad(t, axis));
    return MOTION_OK;
}

/* A stream for each instant: who reads twice, or another axis between, sees the same. */
static double readout_noise_rad(const struct table *t, unsigned axis, int64_t t_ns)
{
    static const char *const names[TABLE_AXES_MAX] = {"table.1.readout", "table.2.readout", "table.3.readout"};
    const double rms_rad = t->cfg.axis[axis].readout_noise_arcsec_rms * RAD_PER_ARCSEC;
    if (rms_rad <= 0.0) return 0.0;
    struct rng r = rng_stream(t->seed, (uint64_t)t_ns, names[axis]);
    return rms_rad * rng_gauss(&r);
}

static int64_t delay_ns(const struct table *t, unsigned axis)
{
    return (int64_t)nearbyint(t->cfg.axis[axis].readout_delay_s * (double)NS_PER_S);
}

int64_t table_known_ns(const struct table *t, unsigned axis)
{
    const int64_t known_ns = motion_known_ns(&t->axis[axis]);
    return known_ns > 0 ? known_ns + delay_ns(t, axis) : 0;
}

struct table_reading table_read(const struct table *t, unsigned axis, int64_t t_ns)
{
    assert(axis < t->cfg.axes);
    const struct table_axis_cfg *c = &t->cfg.axis[axis];
    const struct motion *m = &t->axis[axis];
    const int64_t shown_ns = t_ns - delay_ns(t, axis);
    const struct motion_state s = axis_state(t, axis, shown_ns);
    const double angle_rad = det_quantise(s.angle_rad + offset_rad(t, axis) + readout_noise_rad(t, axis, t_ns),
                                          c->readout_resolution_arcsec * RAD_PER_ARCSEC);
    const int64_t rest_ns = motion_rest_ns(m);
    return (struct table_reading){
        .angle_deg = angle_rad / RAD_PER_DEG,
        .rate_dps = s.rate_radps / RAD_PER_DEG,
        .mode = motion_mode(m),
        .at_rest = t_ns >= rest_ns,
        .rest_in_s = rest_ns == INT64_MAX ? -1.0 : sched_since_s(t_ns, rest_ns),
    };
}

/* ---- truth */

static bool all_at_rest(const struct table *t, int64_t t_ns)
{
    if (t->ripples) return false;
    for (unsigned i = 0; i < t->cfg.axes; i++) {
        if (!motion_at_rest(&t->axis[i], t_ns)) return false;
    }
    return true;
}

int64_t table_smooth_ns(const struct table *t, int64_t t_ns)
{
    int64_t first_ns = INT64_MAX;
    for (unsigned i = 0; i < t->cfg.axes; i++) {
        const int64_t at_ns = motion_smooth_ns(&t->axis[i], t_ns);
        if (at_ns < first_ns) first_ns = at_ns;
    }
    for (const struct table_ripple *r = t->ripples; r; r = r->next)
        if (r->from_ns > t_ns && r->from_ns < first_ns) first_ns = r->from_ns;
    return first_ns;
}

struct motion_state table_axis(const struct table *t, unsigned axis, int64_t t_ns)
{
    assert(axis < t->cfg.axes);
    return axis_state(t, axis, t_ns);
}

/* The cone: turns about the two axes across by w cos(n angle + phase) and w sin(n angle + phase). det_sin() takes up to 1e6
 * rad: whole turns are taken off a table that has been turning for long. */
static void set_cone(const struct table_axis_cfg *c, struct table_turns *t)
{
    const double w_rad = c->wobble_arcsec * RAD_PER_ARCSEC;
    if (w_rad == 0.0) return;
    const double n = c->wobble_order ? (double)c->wobble_order : 1.0;
    const double sum_rad = n * t->angle_rad + c->wobble_phase_deg * RAD_PER_DEG;
    const struct det_pair phase = det_sin_cos(fabs(sum_rad) > WHOLE_ABOVE ? fmod(sum_rad, TURN_RAD) : sum_rad);
    t->cone_rad[0] = w_rad * phase.cos;
    t->cone_rad[1] = w_rad * phase.sin;
    for (unsigned i = 0; i < 2; i++) t->cone[i] = pose_angle(t->cone_rad[i]);
}

static const struct table_turns *turns_at(const struct table_axis_cfg *c, struct table_turns *t, double angle_rad)
{
    if (t->angle_rad == angle_rad) return t;
    t->angle_rad = angle_rad;
    t->angle = pose_angle(angle_rad);
    set_cone(c, t);
    return t;
}

static void apply_wobble(struct pose *p, const struct table_axis_cfg *c, const struct table_turns *t,
                         const struct motion_state *s)
{
    if (c->wobble_arcsec == 0.0) return;
    const double n = c->wobble_order ? (double)c->wobble_order : 1.0;
    const double rate = n * s->rate_radps;
    const double accel = n * s->accel_radps2;
    const double cos_rad = t->cone_rad[0];
    const double sin_rad = t->cone_rad[1];
    pose_turn_by(p, (enum pose_axis)((c->along + 1u) % 3u), &t->cone[0], -sin_rad * rate,
                 -cos_rad * rate * rate - sin_rad * accel);
    pose_turn_by(p, (enum pose_axis)((c->along + 2u) % 3u), &t->cone[1], cos_rad * rate,
                 -sin_rad * rate * rate + cos_rad * accel);
}

/* The axis across both this one and the one outside: a turn about it changes the angle between them. */
static enum pose_axis axis_across(enum pose_axis a, enum pose_axis b)
{
    return a == b ? (enum pose_axis)((a + 1u) % 3u) : (enum pose_axis)(3u - a - b);
}

static void set_base(struct table *t)
{
    const double tilt_rad[3] = {t->cfg.base_tilt_x_arcsec * RAD_PER_ARCSEC, t->cfg.base_tilt_y_arcsec * RAD_PER_ARCSEC};
    pose_start(&t->base, &t->site);
    pose_tilt(&t->base, tilt_rad);
}

static void set_pose(struct table *t, int64_t t_ns, struct pose *p)
{
    *p = t->base;
    for (unsigned i = 0; i < t->cfg.axes; i++) {
        const struct table_axis_cfg *c = &t->cfg.axis[i];
        const struct motion_state s = axis_state(t, i, t_ns);
        if (i > 0) {
            pose_turn(p, axis_across(c->along, t->cfg.axis[i - 1].along), c->nonorthogonality_arcsec * RAD_PER_ARCSEC,
                      0.0, 0.0);
        }
        const struct table_turns *turns = turns_at(c, &t->turns[i], s.angle_rad);
        apply_wobble(p, c, turns, &s);
        pose_turn_by(p, c->along, &turns->angle, s.rate_radps, s.accel_radps2);
    }
}

const struct pose *table_pose(struct table *t, int64_t t_ns)
{
    if (t_ns < t->cached_from_ns || t_ns > t->cached_to_ns) {
        set_pose(t, t_ns, &t->cached);
        t->cached_from_ns = t_ns;
        t->cached_to_ns = all_at_rest(t, t_ns) ? INT64_MAX : t_ns;
    }
    return &t->cached;
}

/* ---- life */

void table_init(struct table *t, const struct table_cfg *cfg, const struct site *site, uint64_t seed)
{
    assert(cfg->axes <= TABLE_AXES_MAX);
    *t = (struct table){.cfg = *cfg, .site = *site, .seed = seed, .cached_to_ns = -1};
    for (unsigned i = 0; i < cfg->axes; i++) {
        const struct table_axis_cfg *a = &cfg->axis[i];
        const struct motion_limits limits = {
            .rate_radps = a->rate_max_dps * RAD_PER_DEG,
            .accel_radps2 = a->accel_max_dps2 * RAD_PER_DEG,
            .bounded = a->angle_min_deg != 0.0 || a->angle_max_deg != 0.0,
            .min_rad = a->angle_min_deg * RAD_PER_DEG,
            .max_rad = a->angle_max_deg * RAD_PER_DEG,
        };
        motion_init(&t->axis[i], &limits);
        t->turns[i].angle_rad = NAN;
    }
    set_base(t);
}

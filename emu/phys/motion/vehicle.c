#include "phys/motion/vehicle.h"

#include "base/detmath.h"
#include "base/sched.h"
#include "phys/motion/pose.h"

#include <math.h>
#include <string.h>

#define LATITUDE_MAX_RAD (VEHICLE_LATITUDE_MAX_DEG * RAD_PER_DEG)

/* ---- ramps and sines */

struct value {
    double at, rate;
};

static double ramp_s(const struct vehicle_ramp *r)
{
    return r->rate == 0.0 ? 0.0 : (r->to - r->from) / r->rate;
}

static struct value ramp_at(const struct vehicle_ramp *r, int64_t t_ns)
{
    const double s = sched_since_s(r->from_ns, t_ns);
    if (s >= ramp_s(r)) return (struct value){r->to, 0.0};
    return (struct value){r->from + r->rate * s, r->rate};
}

static struct vehicle_ramp make_ramp(double from, double to, double rate, int64_t t_ns)
{
    return (struct vehicle_ramp){t_ns, from, to, to < from ? -rate : rate};
}

/* Whole turns are taken off by fmod(), which is exact: a sway of hours. */
static struct value sine_at(const struct vehicle_sine *s, int64_t t_ns)
{
    if (s->amplitude == 0.0 || s->rate_radps == 0.0) return (struct value){0.0, 0.0};
    const double phase_rad = fmod(s->rate_radps * sched_since_s(s->from_ns, t_ns), TURN_RAD);
    const struct det_pair phase = det_sin_cos(phase_rad);
    return (struct value){s->amplitude * phase.sin, s->amplitude * s->rate_radps * phase.cos};
}

static struct vehicle_sine make_sine(double amplitude, double period_s, int64_t t_ns)
{
    const bool swings = amplitude != 0.0 && period_s > 0.0;
    return swings ? (struct vehicle_sine){t_ns, amplitude, TURN_RAD / period_s} : (struct vehicle_sine){t_ns, 0.0, 0.0};
}

/* Each sine begins at its zero. */
static void start_sway(struct vehicle_plan *p, const struct vehicle_sway *sway, int64_t t_ns)
{
    p->pitch_sway = make_sine(sway->pitch_arcmin * RAD_PER_ARCMIN, sway->pitch_s, t_ns);
    p->roll_sway = make_sine(sway->roll_arcmin * RAD_PER_ARCMIN, sway->roll_s, t_ns);
    p->push[0] = make_sine(sway->east_mg * VEHICLE_MG_MPS2, sway->east_s, t_ns);
    p->push[1] = make_sine(sway->north_mg * VEHICLE_MG_MPS2, sway->north_s, t_ns);
}

/* ---- latitude */

/* Integral of (v + a t) cos(h + w t) over d_s: the way to the north at a constant acceleration and a constant turn. */
static double northwards_m(double v, double a, double h, double w, double d_s)
{
    if (w == 0.0) return (v + 0.5 * a * d_s) * d_s * det_cos(h);
    const struct det_pair ahead = det_sin_cos(h), end = det_sin_cos(h + w * d_s);
    return ((v + a * d_s) * end.sin - v * ahead.sin + a / w * (end.cos - ahead.cos)) / w;
}

static int64_t ramp_end_ns(const struct vehicle_ramp *r)
{
    return r->from_ns + (int64_t)ceil(ramp_s(r) * (double)NS_PER_S);
}

/* From the plan's start in at most three pieces: until speed and heading are where they go. */
static double latitude_rad(const struct vehicle_plan *p, int64_t t_ns)
{
    if (p->speed_mps.from == 0.0 && p->speed_mps.to == 0.0) return p->latitude_rad;
    const int64_t speed_ns = ramp_end_ns(&p->speed_mps);
    const int64_t turn_ns = ramp_end_ns(&p->heading_rad);
    const int64_t ends[] = {ns_earlier(speed_ns, turn_ns), speed_ns < turn_ns ? turn_ns : speed_ns, t_ns};
    int64_t from_ns = p->from_ns;
    double north_m = 0.0;
    for (unsigned i = 0; i < 3; i++) {
        const int64_t to_ns = ns_earlier(ends[i], t_ns);
        if (to_ns <= from_ns) continue;
        const struct value v = ramp_at(&p->speed_mps, from_ns);
        const struct value h = ramp_at(&p->heading_rad, from_ns);
        north_m += northwards_m(v.at, v.rate, h.at, h.rate, sched_since_s(from_ns, to_ns));
        from_ns = to_ns;
    }
    const double lat = p->latitude_rad + north_m / EARTH_RADIUS_M;
    return fmin(fmax(lat, -LATITUDE_MAX_RAD), LATITUDE_MAX_RAD);
}

/* ---- plans */

static const struct vehicle_plan *plan_at(const struct vehicle *v, int64_t t_ns)
{
    const unsigned kept = v->commands < VEHICLE_HISTORY - 1 ? v->commands : VEHICLE_HISTORY - 1;
    const struct vehicle_plan *p = NULL;
    for (unsigned back = 0; back <= kept; back++) {
        p = &v->plan[(v->commands - back) % VEHICLE_HISTORY];
        if (p->from_ns <= t_ns) break;
    }
    return p;
}

/* A copy of the plan under way, to be changed, that begins at t_ns. */
static struct vehicle_plan *next_plan(struct vehicle *v, int64_t t_ns)
{
    const struct vehicle_plan *now = &v->plan[v->commands % VEHICLE_HISTORY];
    struct vehicle_plan *next = &v->plan[(v->commands + 1) % VEHICLE_HISTORY];
    *next = *now;
    next->latitude_rad = latitude_rad(now, t_ns);
    next->from_ns = t_ns;
    v->commands++;
    return next;
}

static void turn_to(const struct vehicle *v, struct vehicle_plan *p, double heading_deg, int64_t t_ns)
{
    const double from_rad = ramp_at(&p->heading_rad, t_ns).at;
    const double way_rad = det_wrap_rad(heading_deg * RAD_PER_DEG - from_rad);
    p->heading_rad =
        make_ramp(det_wrap_rad(from_rad), det_wrap_rad(from_rad) + way_rad, v->cfg.turn_dps * RAD_PER_DEG, t_ns);
}

static void tilt_to(const struct vehicle *v, struct vehicle_ramp *angle, double from_rad, double to_rad, int64_t t_ns)
{
    *angle = make_ramp(from_rad, to_rad, v->cfg.tilt_dps * RAD_PER_DEG, t_ns);
}

struct vehicle_cfg vehicle_default(void)
{
    return (struct vehicle_cfg){.turn_dps = 3.0, .tilt_dps = 2.0, .accel_mps2 = 2.0};
}

static struct vehicle_ramp at_rest(double value)
{
    return (struct vehicle_ramp){.from = value, .to = value};
}

void vehicle_init(struct vehicle *v, const struct vehicle_cfg *cfg, const struct site *site)
{
    *v = (struct vehicle){.cfg = *cfg, .site = *site};
    v->plan[0] = (struct vehicle_plan){
        .heading_rad = at_rest(det_wrap_rad(cfg->heading_deg * RAD_PER_DEG)),
        .pitch_rad = at_rest(cfg->pitch_deg * RAD_PER_DEG),
        .roll_rad = at_rest(cfg->roll_deg * RAD_PER_DEG),
        .speed_mps = at_rest(0.0),
        .latitude_rad = site->latitude_rad,
    };
    start_sway(&v->plan[0], &cfg->sway, 0);
}

void vehicle_attitude(struct vehicle *v, double heading_deg, double pitch_deg, double roll_deg, int64_t t_ns)
{
    struct vehicle_plan *p = next_plan(v, t_ns);
    turn_to(v, p, heading_deg, t_ns);
    tilt_to(v, &p->pitch_rad, ramp_at(&p->pitch_rad, t_ns).at, pitch_deg * RAD_PER_DEG, t_ns);
    tilt_to(v, &p->roll_rad, ramp_at(&p->roll_rad, t_ns).at, roll_deg * RAD_PER_DEG, t_ns);
}

/* The angle that the old sine had goes back to the mean with the mean's own rate. */
void vehicle_sway(struct vehicle *v, const struct vehicle_sway *sway, int64_t t_ns)
{
    struct vehicle_plan *p = next_plan(v, t_ns);
    const double pitch_rad = ramp_at(&p->pitch_rad, t_ns).at + sine_at(&p->pitch_sway, t_ns).at;
    const double roll_rad = ramp_at(&p->roll_rad, t_ns).at + sine_at(&p->roll_sway, t_ns).at;
    tilt_to(v, &p->pitch_rad, pitch_rad, p->pitch_rad.to, t_ns);
    tilt_to(v, &p->roll_rad, roll_rad, p->roll_rad.to, t_ns);
    start_sway(p, sway, t_ns);
}

void vehicle_fly(struct vehicle *v, double speed_mps, double track_deg, int64_t t_ns)
{
    struct vehicle_plan *p = next_plan(v, t_ns);
    turn_to(v, p, track_deg, t_ns);
    p->speed_mps = make_ramp(ramp_at(&p->speed_mps, t_ns).at, speed_mps, v->cfg.accel_mps2, t_ns);
}

/* ---- state */

/* C_lc = Rz(-heading) Rx(pitch) Ry(roll), and the rate from the three angles' rates; ch, sh: cosine and sine of the heading. */
static void set_attitude(struct vehicle_state *s, double ch, double sh, const double rate_radps[3])
{
    const struct det_pair pitch = det_sin_cos(s->pitch_rad), roll = det_sin_cos(s->roll_rad);
    const double sp = pitch.sin, cp = pitch.cos;
    const double sr = roll.sin, cr = roll.cos;
    const double C_lc[3][3] = {
        {ch * cr + sh * sp * sr, sh * cp, ch * sr - sh * sp * cr},
        {ch * sp * sr - sh * cr, ch * cp, -sh * sr - ch * sp * cr},
        {-cp * sr, sp, cp * cr},
    };
    memcpy(s->C_lc, C_lc, sizeof C_lc);
    s->w_lc_l_radps[0] = ch * rate_radps[1] + C_lc[0][1] * rate_radps[2];
    s->w_lc_l_radps[1] = -sh * rate_radps[1] + C_lc[1][1] * rate_radps[2];
    s->w_lc_l_radps[2] = C_lc[2][1] * rate_radps[2] - rate_radps[0];
}

/* The rates of l, and what a flight adds to the specific force: dv/dt in l, and (2 w_ie + w_el) x v. */
static void set_flight(struct vehicle_state *s, const struct site *site, double ch, double sh, double accel_mps2,
                       double turn_radps)
{
    const double earth_radps = site->placed ? EARTH_RATE_RADPS : 0.0;
    const struct det_pair lat = det_sin_cos(s->latitude_rad);
    const double v_l[3] = {s->speed_mps * sh, s->speed_mps * ch, 0.0};
    const double east_radps = v_l[0] / EARTH_RADIUS_M;
    const double w_el[3] = {-v_l[1] / EARTH_RADIUS_M, east_radps, east_radps * lat.sin / lat.cos};
    const double w_ie[3] = {0.0, earth_radps * lat.cos, earth_radps * lat.sin};
    double twice[3];
    for (unsigned k = 0; k < 3; k++) {
        s->w_il_l_radps[k] = w_ie[k] + w_el[k];
        twice[k] = 2.0 * w_ie[k] + w_el[k];
    }
    pose_cross(twice, v_l, s->accel_l_mps2);
    s->accel_l_mps2[0] += accel_mps2 * sh + s->speed_mps * turn_radps * ch;
    s->accel_l_mps2[1] += accel_mps2 * ch - s->speed_mps * turn_radps * sh;
}

/* Without a push not even a zero changes its sign. */
static void add_push(const struct vehicle_plan *p, int64_t t_ns, double accel_l_mps2[3])
{
    for (unsigned k = 0; k < 2; k++) {
        if (p->push[k].amplitude != 0.0) accel_l_mps2[k] += sine_at(&p->push[k], t_ns).at;
    }
}

void vehicle_at(const struct vehicle *v, int64_t t_ns, struct vehicle_state *out)
{
    const struct vehicle_plan *p = plan_at(v, t_ns);
    const struct value heading = ramp_at(&p->heading_rad, t_ns);
    const struct value pitch = ramp_at(&p->pitch_rad, t_ns);
    const struct value roll = ramp_at(&p->roll_rad, t_ns);
    const struct value pitch_sway = sine_at(&p->pitch_sway, t_ns);
    const struct value roll_sway = sine_at(&p->roll_sway, t_ns);
    const struct value speed = ramp_at(&p->speed_mps, t_ns);
    const double rate_radps[3] = {heading.rate, pitch.rate + pitch_sway.rate, roll.rate + roll_sway.rate};
    const struct det_pair direction = det_sin_cos(heading.at);
    const double ch = direction.cos, sh = direction.sin;
    out->heading_rad = det_wrap_rad(heading.at);
    out->pitch_rad = pitch.at + pitch_sway.at;
    out->roll_rad = roll.at + roll_sway.at;
    out->speed_mps = speed.at;
    out->latitude_rad = latitude_rad(p, t_ns);
    set_attitude(out, ch, sh, rate_radps);
    set_flight(out, &v->site, ch, sh, speed.rate, heading.rate);
    add_push(p, t_ns, out->accel_l_mps2);
}

static bool has_sway(const struct vehicle_plan *p)
{
    return p->pitch_sway.amplitude != 0.0 || p->roll_sway.amplitude != 0.0 || p->push[0].amplitude != 0.0 ||
           p->push[1].amplitude != 0.0;
}

static bool ramp_over(const struct vehicle_ramp *r, int64_t t_ns)
{
    return t_ns >= r->from_ns && sched_since_s(r->from_ns, t_ns) >= ramp_s(r);
}

bool vehicle_steady(const struct vehicle *v, int64_t t_ns)
{
    const struct vehicle_plan *p = &v->plan[v->commands % VEHICLE_HISTORY];
    return t_ns >= p->from_ns && !has_sway(p) && p->speed_mps.to == 0.0 && ramp_over(&p->speed_mps, t_ns) &&
           ramp_over(&p->heading_rad, t_ns) && ramp_over(&p->pitch_rad, t_ns) && ramp_over(&p->roll_rad, t_ns);
}

#include "phys/flight/flight.h"

#include "phys/flight/ellipsoid.h"
#include "phys/flight/path.h"

#include <math.h>
#include <string.h>

#define G_MPS2 9.80665 /* of coordination, as in plan.c */

struct flight_cfg flight_default(void)
{
    return (struct flight_cfg){
        .plan = {.jerk_mps3 = 4.0, .roll_rate_dps = 8.0, .angle_of_attack_deg = 4.0},
        .baro = {.lag_s = 0.5},
    };
}

/* ---- angles */

/* atan2(y, x) of functions of time, x > 0, to the second derivative. */
static struct jet angle_of(const struct jet *y, const struct jet *x)
{
    const double square = x->at * x->at + y->at * y->at;
    const double turn = y->d1 * x->at - y->at * x->d1, turn_d1 = y->d2 * x->at - y->at * x->d2;
    const double square_d1 = 2.0 * (x->at * x->d1 + y->at * y->d1);
    return (struct jet){
        .at = det_atan2(y->at, x->at),
        .d1 = turn / square,
        .d2 = (turn_d1 * square - turn * square_d1) / (square * square),
    };
}

/* Angle of the path above the level. */
static struct jet climb_angle(const struct path *p)
{
    if (p->up_mps.at == 0.0 && p->up_mps.d1 == 0.0 && p->up_mps.d2 == 0.0) return (struct jet){0};
    return angle_of(&p->up_mps, &p->speed_mps);
}

/* tan(bank) = U chi' / g */
static struct jet bank_angle(const struct path *p)
{
    const struct jet *u = &p->speed_mps, *x = &p->track_rad;
    const struct jet force = {
        .at = u->at * x->d1,
        .d1 = u->d1 * x->d1 + u->at * x->d2,
        .d2 = u->d2 * x->d1 + 2.0 * u->d1 * x->d2 + u->at * x->d3,
    };
    return angle_of(&force, &(struct jet){.at = G_MPS2});
}

static struct jet add_jets(struct jet a, struct jet b)
{
    return (struct jet){a.at + b.at, a.d1 + b.d1, a.d2 + b.d2, a.d3 + b.d3};
}

static struct jet pitch_angle(const struct flight_plan *p, const struct path *path, int64_t t_ns)
{
    const struct jet nose = add_jets(climb_angle(path), channel_at(&p->attack_rad, t_ns));
    return add_jets(nose, flight_plan_swing(p, SWING_PITCH, t_ns));
}

static struct jet roll_angle(const struct flight_plan *p, const struct path *path, unsigned leg, int64_t t_ns)
{
    const struct jet sway = flight_plan_swing(p, SWING_ROLL, t_ns);
    return p->banked[leg] ? add_jets(sway, bank_angle(path)) : sway;
}

/* ---- rates and force */

/* The rate of n, w_ie + w_en, with its derivative: NED. */
static void start_pose(const struct path *p, struct pose *pose)
{
    const double *v = p->v_enu_mps, *a = p->a_enu_mps2, *rho = p->w_en_n_radps;
    const double c = p->lat.cos, s = p->lat.sin;
    const double east = (a[0] - rho[0] * p->vertical_d1_mps) / p->vertical_m;
    const double north = (a[1] + rho[1] * p->meridian_d1_mps) / p->meridian_m;
    *pose = (struct pose){
        .C_nb = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}},
        .w_ib_b_radps = {EARTH_RATE_RADPS * c + rho[0], rho[1], -EARTH_RATE_RADPS * s + rho[2]},
        .dw_ib_b_radps2 = {-EARTH_RATE_RADPS * s * p->lat_d1_radps + east, -north,
                           -EARTH_RATE_RADPS * c * p->lat_d1_radps -
                               (east * s + v[0] / p->vertical_m * p->lat_d1_radps / c) / c},
    };
}

/* f = dv/dt + (2 w_ie + w_en) x v - g, in n. */
static void force_n_mps2(const struct flight *f, const struct path *p, double f_n_mps2[3])
{
    const double v_n[3] = {p->v_enu_mps[1], p->v_enu_mps[0], -p->v_enu_mps[2]};
    const double *rho = p->w_en_n_radps;
    const double twice[3] = {2.0 * EARTH_RATE_RADPS * p->lat.cos + rho[0], rho[1],
                             -2.0 * EARTH_RATE_RADPS * p->lat.sin + rho[2]};
    pose_cross(twice, v_n, f_n_mps2);
    f_n_mps2[0] += p->a_enu_mps2[1];
    f_n_mps2[1] += p->a_enu_mps2[0];
    f_n_mps2[2] -= p->a_enu_mps2[2] + earth_gravity_mps2(p->lat_rad, p->h_m) + f->anomaly_mps2;
}

void flight_at(const struct flight *f, int64_t t_ns, struct flight_state *out)
{
    struct path p;
    double f_n_mps2[3];
    const unsigned leg = flight_plan_leg(&f->plan, t_ns);
    path_at(f, t_ns, &p);
    const struct jet nose = pitch_angle(&f->plan, &p, t_ns), right = roll_angle(&f->plan, &p, leg, t_ns);
    *out = (struct flight_state){
        .lat_rad = p.lat_rad,
        .lon_rad = det_wrap_rad(p.lon_rad),
        .h_m = p.h_m,
        .heading_rad = det_wrap_rad(p.track_rad.at),
        .pitch_rad = nose.at,
        .roll_rad = right.at,
        .leg = leg,
    };
    memcpy(out->v_enu_mps, p.v_enu_mps, sizeof out->v_enu_mps);
    memcpy(out->a_enu_mps2, p.a_enu_mps2, sizeof out->a_enu_mps2);
    start_pose(&p, &out->pose);
    pose_turn(&out->pose, POSE_Z, p.track_rad.at, p.track_rad.d1, p.track_rad.d2);
    pose_turn(&out->pose, POSE_Y, nose.at, nose.d1, nose.d2);
    pose_turn(&out->pose, POSE_X, right.at, right.d1, right.d2);
    force_n_mps2(f, &p, f_n_mps2);
    pose_into(&out->pose, f_n_mps2, out->f_b_mps2);
}

double flight_baro_m(const struct flight *f, int64_t t_ns)
{
    return baro_shown_m(&f->baro, &f->plan.height_m, t_ns);
}

int64_t flight_smooth_ns(const struct flight *f, int64_t t_ns)
{
    return flight_plan_next_ns(&f->plan, t_ns);
}

bool flight_init(struct flight *f, const struct flight_cfg *cfg, const struct site *site, struct flight_error *e)
{
    f->cfg = *cfg;
    f->site = *site;
    f->anomaly_mps2 = site->g_mps2 - earth_gravity_mps2(site->latitude_rad, site->height_m);
    if (!flight_plan_make(&f->plan, &cfg->plan, site->height_m, e)) return false;
    baro_init(&f->baro, &cfg->baro, &f->plan.height_m);
    return path_make(f, e);
}

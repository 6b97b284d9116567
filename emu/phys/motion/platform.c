#include "phys/motion/platform.h"

#include "base/detmath.h"
#include "base/sched.h"
#include "phys/motion/platform_angles.h"

#include <math.h>
#include <string.h>

#define RADPS_PER_DEGPH (RAD_PER_DEG / 3600.0)
#define STOP_RAD        (PLATFORM_STOP_DEG * RAD_PER_DEG)
#define STANDARD_G_MPS2 (1e3 * VEHICLE_MG_MPS2)
#define AFRESH_EVERY    64 /* steps: sines and cosines are then computed again, in between turned on */

struct platform_cfg platform_default(void)
{
    return (struct platform_cfg){
        .step_ns = NS_PER_S / 100,
        .drift_degph = {25.0, 25.0},
        .gm_sigma_degph = 0.2,
        .gm_tau_s = 1000.0,
        .torquer_limit_dps = 20.0,
        .servo = {.limit_dps = 60.0},
        .level_tilt_arcmin = {10.0, 10.0},
        .level_repeat_arcmin = 1.0,
        .angle_zero_arcmin = 6.0,
        .angle_set_arcmin = 3.0,
        .angle_read_arcmin = 0.5,
        .angle_step_arcsec = 1.0,
    };
}

static struct trig trig_at(const struct platform_node *n, double da_rad, double db_rad)
{
    struct trig t = {n->sin_a, n->cos_a, n->sin_b, n->cos_b};
    turn_on(&t.sin_a, &t.cos_a, da_rad);
    turn_on(&t.sin_b, &t.cos_b, db_rad);
    return t;
}

/* ---- grid */

static struct platform_node *node_at(struct platform *p, int64_t k)
{
    return &p->node[(uint64_t)k % PLATFORM_HISTORY];
}

static const struct vehicle_state *vehicle_state_at(struct platform *p, int64_t t_ns)
{
    if (t_ns < p->ground_from_ns || t_ns > p->ground_to_ns) {
        vehicle_at(&p->vehicle, t_ns, &p->ground);
        p->ground_from_ns = t_ns;
        p->ground_to_ns = vehicle_steady(&p->vehicle, t_ns) ? INT64_MAX : t_ns;
    }
    return &p->ground;
}

static struct ground ground_at(struct platform *p, int64_t t_ns)
{
    const struct vehicle_state *s = vehicle_state_at(p, t_ns);
    struct ground g;
    for (unsigned k = 0; k < 3; k++) {
        g.w_l_radps[k] = s->w_il_l_radps[k];
        g.z_c[k] = s->C_lc[k][2];
    }
    return g;
}

static double drift_radps(const struct platform *p, const struct platform_node *n, unsigned axis)
{
    return p->cfg.drift_degph[axis] * RADPS_PER_DEGPH + n->drift_step_radps[axis] + n->gm_radps[axis] +
           n->by_force_radps[axis];
}

/* Rates about x_p and z_p that the gyroscope keeps: (7) of the article with a torquer's scale error. */
static void gyro_rates(const struct platform *p, const struct platform_node *n, double w_radps[2])
{
    for (unsigned i = 0; i < PLATFORM_AXES; i++) {
        const double scale = (1.0 + p->cfg.torquer_scale[i]) * n->torquer_gain[i];
        w_radps[i] = n->torque_radps[i] * scale - drift_radps(p, n, i);
    }
}

/* Rates of the platform over the step from n on: of the gyroscope, which its motors follow. behind_rad: after the step. */
static void platform_rates(const struct platform *p, const struct platform_node *n, double w_radps[2],
                           double behind_rad[2])
{
    gyro_rates(p, n, w_radps);
    for (unsigned i = 0; i < PLATFORM_AXES; i++) {
        behind_rad[i] = 0.0;
        if (p->cfg.servo.hz <= 0.0) continue;
        behind_rad[i] = follow_after(&p->cfg.servo, n->behind_rad[i], w_radps[i], n->carrier_radps[i], p->step_s);
        w_radps[i] -= (behind_rad[i] - n->behind_rad[i]) / p->step_s;
    }
}

static void invalidate_node(struct platform_node *n)
{
    const struct det_pair a = det_sin_cos(n->alpha_rad), b = det_sin_cos(n->beta_rad);
    n->sin_a = a.sin;
    n->cos_a = a.cos;
    n->sin_b = b.sin;
    n->cos_b = b.cos;
}

/* Exact for any step (sources instruments 1.4). */
static void drift_on(const struct platform *p, struct platform_node *n)
{
    if (p->gm_kick_radps == 0.0) return;
    for (unsigned i = 0; i < PLATFORM_AXES; i++) {
        n->gm_radps[i] = p->gm_keep * n->gm_radps[i] + p->gm_kick_radps * rng_gauss(&n->gm[i]);
    }
}

/* Columns of the platform's axes at an instant, on the vehicle then. */
static void axes_at(const struct trig *t, const struct vehicle_state *v, double C_lp[3][3])
{
    const double z_c[3] = {v->C_lc[0][2], v->C_lc[1][2], v->C_lc[2][2]};
    const struct tilt g = tilt_of(t, z_c);
    platform_axes(t, &g, C_lp);
}

static void force_at(const struct platform *p, const struct trig *t, const struct vehicle_state *v, double f_p_mps2[3])
{
    const double f_l_mps2[3] = {v->accel_l_mps2[0], v->accel_l_mps2[1], v->accel_l_mps2[2] + p->vehicle.site.g_mps2};
    double C_lp[3][3];
    axes_at(t, v, C_lp);
    into_p((const double(*)[3])C_lp, f_l_mps2, f_p_mps2);
}

/* A centre of mass off the rotor's centre along its axis, y_p, makes a moment y x f: about each of the two axes it drifts by the
 * force along that axis, by the same rate. A spring that is not the same all round crosses the two. */
static void drift_by_force(struct platform *p, struct platform_node *n, int64_t t_ns)
{
    if (!p->feels_force) return;
    const struct trig t = {n->sin_a, n->cos_a, n->sin_b, n->cos_b};
    double f_p_mps2[3];
    force_at(p, &t, vehicle_state_at(p, t_ns), f_p_mps2);
    const double f_g[PLATFORM_AXES] = {f_p_mps2[0] / STANDARD_G_MPS2, f_p_mps2[2] / STANDARD_G_MPS2};
    for (unsigned i = 0; i < PLATFORM_AXES; i++) {
        n->by_force_radps[i] = RADPS_PER_DEGPH * (p->cfg.unbalance_degph_per_g[i] * f_g[i] +
                                                  p->cfg.quadrature_degph_per_g[i] * f_g[PLATFORM_AXES - 1 - i]);
    }
}

/* The outer frame turns with the vehicle about x_p, which is across its axis; about z_p the vehicle carries the azimuth motor. */
static void carrier_of(struct platform *p, struct platform_node *n, int64_t t_ns)
{
    if (p->cfg.servo.hz <= 0.0) return;
    const struct trig t = {n->sin_a, n->cos_a, n->sin_b, n->cos_b};
    const struct vehicle_state *v = vehicle_state_at(p, t_ns);
    double C_lp[3][3], w_l_radps[3], w_p_radps[3];
    axes_at(&t, v, C_lp);
    for (unsigned k = 0; k < 3; k++) w_l_radps[k] = v->w_il_l_radps[k] + v->w_lc_l_radps[k];
    into_p((const double(*)[3])C_lp, w_l_radps, w_p_radps);
    n->carrier_radps[PLATFORM_LEVEL] = w_p_radps[0];
    n->carrier_radps[PLATFORM_AZIMUTH] = w_p_radps[2];
}

/* What a grid point has of the vehicle there, and of the motors after the step to it. */
static void arrive_at(struct platform *p, struct platform_node *n, const double behind_rad[2], int64_t t_ns)
{
    memcpy(n->behind_rad, behind_rad, sizeof n->behind_rad);
    drift_by_force(p, n, t_ns);
    carrier_of(p, n, t_ns);
}

/* Runge and Kutta's fourth-order step. */
static void advance_step(struct platform *p)
{
    const int64_t t_ns = p->newest * p->cfg.step_ns;
    struct platform_node *from = node_at(p, p->newest);
    struct platform_node *to = node_at(p, p->newest + 1);
    const double h = p->step_s;
    const struct ground start = ground_at(p, t_ns);
    const struct ground middle = ground_at(p, t_ns + p->cfg.step_ns / 2);
    const struct ground end = ground_at(p, t_ns + p->cfg.step_ns);
    const struct trig now = {from->sin_a, from->cos_a, from->sin_b, from->cos_b};
    double w[2], behind_rad[2], k1[2], k2[2], k3[2], k4[2];
    platform_rates(p, from, w, behind_rad);
    solve_rates(&start, &now, w, k1);
    struct trig t = trig_at(from, 0.5 * h * k1[0], 0.5 * h * k1[1]);
    solve_rates(&middle, &t, w, k2);
    t = trig_at(from, 0.5 * h * k2[0], 0.5 * h * k2[1]);
    solve_rates(&middle, &t, w, k3);
    t = trig_at(from, h * k3[0], h * k3[1]);
    solve_rates(&end, &t, w, k4);
    const double da_rad = h / 6.0 * (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0]);
    const double db_rad = h / 6.0 * (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1]);
    memcpy(from->rate_radps, k1, sizeof k1);
    t = trig_at(from, da_rad, db_rad);
    solve_rates(&end, &t, w, from->rate_end_radps);
    *to = *from;
    to->alpha_rad += da_rad;
    to->beta_rad += db_rad;
    to->sin_a = t.sin_a;
    to->cos_a = t.cos_a;
    to->sin_b = t.sin_b;
    to->cos_b = t.cos_b;
    p->newest++;
    if (fabs(to->beta_rad) > STOP_RAD) {
        to->beta_rad = to->beta_rad > 0.0 ? STOP_RAD : -STOP_RAD;
        invalidate_node(to);
    } else if (p->newest % AFRESH_EVERY == 0) {
        invalidate_node(to);
    }
    drift_on(p, to);
    arrive_at(p, to, behind_rad, t_ns + p->cfg.step_ns);
}

static void advance_to(struct platform *p, int64_t k)
{
    while (p->newest < k) advance_step(p);
}

/* The node from which on something is to be changed at t_ns; what was computed behind it is done again when it is asked for. */
static struct platform_node *change_from(struct platform *p, int64_t t_ns)
{
    const int64_t k = t_ns > 0 ? (t_ns + p->cfg.step_ns - 1) / p->cfg.step_ns : 0;
    advance_to(p, k);
    p->newest = k;
    p->force_ns = -1;
    return node_at(p, k);
}

/* ---- life and commands */

static double draw_rad(struct platform *p, double arcmin)
{
    return arcmin * RAD_PER_ARCMIN * rng_gauss(&p->draws); /* always one number: an error set to 0 shifts no other */
}

static struct platform_setting draw_setting(struct platform *p, int64_t t_ns)
{
    const struct platform_cfg *c = &p->cfg;
    struct platform_setting s = {.from_ns = t_ns};
    double tilt_rad[3] = {0.0, 0.0, 0.0};
    for (unsigned i = 0; i < 2; i++) {
        tilt_rad[i] = c->level_tilt_arcmin[i] * RAD_PER_ARCMIN + draw_rad(p, c->level_repeat_arcmin);
    }
    pose_start(&s.level, &(struct site){0});
    pose_tilt(&s.level, tilt_rad);
    s.set_rad = draw_rad(p, c->angle_set_arcmin);
    s.read_rad = draw_rad(p, c->angle_read_arcmin);
    return s;
}

static void start_drift(struct platform *p, struct platform_node *n, uint64_t seed)
{
    static const char *const streams[PLATFORM_AXES] = {"platform.drift1", "platform.drift2"};
    const double sigma_radps = p->cfg.gm_sigma_degph * RADPS_PER_DEGPH;
    p->gm_keep = sigma_radps > 0.0 ? det_exp(-p->step_s / p->cfg.gm_tau_s) : 0.0;
    p->gm_kick_radps = sigma_radps * sqrt(1.0 - p->gm_keep * p->gm_keep);
    for (unsigned i = 0; i < PLATFORM_AXES; i++) {
        n->gm[i] = rng_stream(seed, 0, streams[i]);
        if (sigma_radps > 0.0 && !p->cfg.gm_from_zero) n->gm_radps[i] = sigma_radps * rng_gauss(&n->gm[i]);
    }
}

void platform_init(struct platform *p, const struct platform_cfg *cfg, const struct vehicle_cfg *vehicle,
                   const struct site *site, uint64_t seed)
{
    *p = (struct platform){
        .cfg = *cfg, .ground_to_ns = -1, .force_ns = -1, .draws = rng_stream(seed, 0, "platform.setting")};
    p->step_s = (double)cfg->step_ns / (double)NS_PER_S;
    vehicle_init(&p->vehicle, vehicle, site);
    p->setting = p->setting_before = draw_setting(p, 0);
    struct platform_node *n = node_at(p, 0);
    n->alpha_rad = cfg->alpha0_deg * RAD_PER_DEG;
    n->beta_rad = cfg->beta0_deg * RAD_PER_DEG;
    n->torquer_gain[PLATFORM_LEVEL] = n->torquer_gain[PLATFORM_AZIMUTH] = 1.0;
    invalidate_node(n);
    start_drift(p, n, seed);
    for (unsigned i = 0; i < PLATFORM_AXES; i++)
        p->feels_force |= cfg->unbalance_degph_per_g[i] != 0.0 || cfg->quadrature_degph_per_g[i] != 0.0;
    arrive_at(p, n, (const double[2]){0.0, 0.0}, 0);
}

bool platform_torque(struct platform *p, double u1_radps, double u2_radps, int64_t t_ns)
{
    const double limit_radps = p->cfg.torquer_limit_dps * RAD_PER_DEG;
    struct platform_node *n = change_from(p, t_ns);
    n->torque_radps[PLATFORM_LEVEL] = fmin(fmax(u1_radps, -limit_radps), limit_radps);
    n->torque_radps[PLATFORM_AZIMUTH] = fmin(fmax(u2_radps, -limit_radps), limit_radps);
    return fabs(u1_radps) > limit_radps || fabs(u2_radps) > limit_radps;
}

void platform_reposition(struct platform *p, int64_t t_ns)
{
    if (t_ns > p->setting.from_ns) p->setting_before = p->setting;
    p->setting = draw_setting(p, t_ns);
    p->force_ns = -1;
}

void platform_reseed(struct platform *p, uint64_t seed, int64_t t_ns)
{
    struct platform_node *n = change_from(p, t_ns);
    for (unsigned i = 0; i < PLATFORM_AXES; i++) rng_reseed(&n->gm[i], seed);
    rng_reseed(&p->draws, seed);
}

struct vehicle *platform_vehicle(struct platform *p, int64_t t_ns)
{
    const int64_t k = t_ns > 0 ? t_ns / p->cfg.step_ns : 0;
    advance_to(p, k);
    p->newest = k;
    p->ground_to_ns = -1;
    p->force_ns = -1;
    return &p->vehicle;
}

void platform_set_torquer(struct platform *p, enum platform_axis axis, double gain, int64_t t_ns)
{
    change_from(p, t_ns)->torquer_gain[axis] = gain;
}

void platform_step_drift(struct platform *p, enum platform_axis axis, double degph, int64_t t_ns)
{
    change_from(p, t_ns)->drift_step_radps[axis] = degph * RADPS_PER_DEGPH;
}

void platform_stick(struct platform *p, bool stuck, int64_t t_ns)
{
    struct platform_state s;
    platform_at(p, t_ns, &s);
    p->stuck = stuck;
    p->stuck_rad = s.q_rad;
}

/* ---- what it is at an instant */

struct look {
    double alpha_rad, beta_rad;
    struct trig trig;
    const struct platform_node *node; /* at or before the instant */
};

/* Between grid points by the cubic through angles and rates at both: as good as the integration. */
static struct look look_at(struct platform *p, int64_t t_ns)
{
    const int64_t step_ns = p->cfg.step_ns;
    int64_t k = t_ns > 0 ? t_ns / step_ns : 0;
    int64_t past_ns = t_ns > 0 ? t_ns - k * step_ns : 0;
    advance_to(p, past_ns > 0 ? k + 1 : k);
    const int64_t oldest = p->newest - (int64_t)PLATFORM_HISTORY + 1;
    if (k < oldest) {
        k = oldest;
        past_ns = 0;
    }
    const struct platform_node *n = node_at(p, k);
    struct look l = {n->alpha_rad, n->beta_rad, {n->sin_a, n->cos_a, n->sin_b, n->cos_b}, n};
    if (past_ns == 0) return l;
    const struct platform_node *next = node_at(p, k + 1);
    const double x = (double)past_ns / (double)step_ns;
    const double y = 1.0 - x;
    const double way = x * x * (1.0 + 2.0 * y);
    const double from = x * y * y * p->step_s;
    const double to = -x * x * y * p->step_s;
    const double da_rad = way * (next->alpha_rad - n->alpha_rad) + from * n->rate_radps[0] + to * n->rate_end_radps[0];
    const double db_rad = way * (next->beta_rad - n->beta_rad) + from * n->rate_radps[1] + to * n->rate_end_radps[1];
    l.alpha_rad += da_rad;
    l.beta_rad += db_rad;
    l.trig = trig_at(n, da_rad, db_rad);
    return l;
}

void platform_at(struct platform *p, int64_t t_ns, struct platform_state *out)
{
    const struct look l = look_at(p, t_ns);
    const struct ground on = ground_at(p, t_ns);
    const struct tilt g = tilt_of(&l.trig, on.z_c);
    double w_radps[2], behind_rad[2], rate_radps[2];
    platform_rates(p, l.node, w_radps, behind_rad);
    solve_rates(&on, &l.trig, w_radps, rate_radps);
    const double gamma = gamma_radps(&p->ground, &l.trig, &g, rate_radps);
    *out = (struct platform_state){
        .alpha_rad = l.alpha_rad,
        .beta_rad = l.beta_rad,
        .gamma_rad = det_atan2(g.across, g.along),
        .alpha_radps = rate_radps[0],
        .beta_radps = rate_radps[1],
        .gamma_radps = gamma,
    };
    platform_axes(&l.trig, &g, out->C_lp);
    out->q_rad = gimbal_rad(&p->ground, (const double(*)[3])out->C_lp);
    into_p((const double(*)[3])out->C_lp, on.w_l_radps, out->w_ip_p_radps);
    out->w_ip_p_radps[0] += rate_radps[1] * g.cos_g - rate_radps[0] * l.trig.cos_b * g.sin_g;
    out->w_ip_p_radps[1] += gamma + rate_radps[0] * l.trig.sin_b;
    out->w_ip_p_radps[2] += rate_radps[1] * g.sin_g + rate_radps[0] * l.trig.cos_b * g.cos_g;
    for (unsigned i = 0; i < PLATFORM_AXES; i++) {
        out->drift_radps[i] = drift_radps(p, l.node, i);
        out->torque_radps[i] = l.node->torque_radps[i];
    }
}

static const struct platform_setting *setting_at(const struct platform *p, int64_t t_ns)
{
    return t_ns < p->setting.from_ns ? &p->setting_before : &p->setting;
}

/* q of platform_at(), without the rest of it. */
static double q_rad(struct platform *p, int64_t t_ns)
{
    const struct look l = look_at(p, t_ns);
    const struct vehicle_state *v = vehicle_state_at(p, t_ns);
    double C_lp[3][3];
    axes_at(&l.trig, v, C_lp);
    return gimbal_rad(v, (const double(*)[3])C_lp);
}

/* What the angle sensor shows before the errors of a setting. */
static double sensor_rad(struct platform *p, int64_t t_ns)
{
    return (p->stuck ? p->stuck_rad : q_rad(p, t_ns)) + p->cfg.angle_zero_arcmin * RAD_PER_ARCMIN;
}

int64_t platform_smooth_ns(const struct platform *p, int64_t t_ns)
{
    return (t_ns / p->cfg.step_ns + 1) * p->cfg.step_ns;
}

double platform_servo_rad(struct platform *p, int64_t t_ns)
{
    return det_wrap_rad(sensor_rad(p, t_ns) + setting_at(p, t_ns)->set_rad);
}

double platform_encoder_rad(struct platform *p, int64_t t_ns)
{
    const double shown_rad = sensor_rad(p, t_ns) + setting_at(p, t_ns)->read_rad;
    return det_wrap_rad(det_quantise(shown_rad, p->cfg.angle_step_arcsec * RAD_PER_ARCSEC));
}

const struct pose *platform_level(const struct platform *p, int64_t t_ns)
{
    return &setting_at(p, t_ns)->level;
}

void platform_force_mps2(struct platform *p, int64_t t_ns, double f_mps2[3])
{
    if (p->force_ns != t_ns) {
        const struct look l = look_at(p, t_ns);
        force_at(p, &l.trig, vehicle_state_at(p, t_ns), p->force_mps2);
        p->force_ns = t_ns;
    }
    memcpy(f_mps2, p->force_mps2, sizeof p->force_mps2);
}

/* n is north, east, down. */
void platform_pose(struct platform *p, int64_t t_ns, struct pose *out)
{
    struct platform_state s;
    platform_at(p, t_ns, &s);
    *out = (struct pose){.w_ib_b_radps = {s.w_ip_p_radps[0], s.w_ip_p_radps[1], s.w_ip_p_radps[2]}};
    for (unsigned k = 0; k < 3; k++) {
        out->C_nb[0][k] = s.C_lp[1][k];
        out->C_nb[1][k] = s.C_lp[0][k];
        out->C_nb[2][k] = -s.C_lp[2][k];
    }
}

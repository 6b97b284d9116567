#include "unit/surroundings.h"

#include "base/detmath.h"

#include <string.h>

/* At the origin of the case. */
static void case_kinematics(void *ctx, int64_t t_ns, double f_b_mps2[3], double w_ib_b_radps[3])
{
    static const double origin_m[3] = {0.0, 0.0, 0.0};
    const struct unit *u = ctx;
    struct kinematics kin;
    lab_kinematics(u->lab, &u->cfg.mounting, origin_m, t_ns, &kin);
    memcpy(f_b_mps2, kin.f_mps2, sizeof kin.f_mps2);
    memcpy(w_ib_b_radps, kin.w_radps, sizeof kin.w_radps);
}

/* The same wherever in it. */
static void rate_radps(void *ctx, int64_t t_ns, double w_ib_b[3])
{
    double f_b_mps2[3];
    case_kinematics(ctx, t_ns, f_b_mps2, w_ib_b);
}

static int64_t smooth_ns(void *ctx, int64_t t_ns)
{
    const struct unit *u = ctx;
    return lab_smooth_ns(u->lab, &u->cfg.mounting, t_ns);
}

static bool is_flying(const struct unit *u)
{
    return u->cfg.mounting.on == LAB_FLIGHT;
}

/* The antenna of a unit is at the origin of the aircraft that carries it, else at the site. */
static void place_at(void *ctx, int64_t t_ns, struct place *out)
{
    const struct unit *u = ctx;
    const struct site *s = &u->lab->site;
    struct flight_state at = {.lat_rad = s->latitude_rad, .lon_rad = s->longitude_rad, .h_m = s->height_m};
    if (is_flying(u)) flight_at(&u->lab->flight, t_ns, &at);
    *out = (struct place){.lat_rad = at.lat_rad, .lon_rad = det_wrap_rad(at.lon_rad), .h_m = at.h_m};
    memcpy(out->v_n_mps, at.v_enu_mps, sizeof at.v_enu_mps);
}

static double baro_m(void *ctx, int64_t t_ns)
{
    const struct unit *u = ctx;
    return is_flying(u) ? flight_baro_m(&u->lab->flight, t_ns) : u->lab->site.height_m;
}

/* To what the scenario has it at power-on. */
static double supply_ratio(void *ctx, int64_t t_ns)
{
    const struct supply *s = &((const struct unit *)ctx)->lab->supply;
    return s->cfg.volt_v > 0.0 ? supply_volts(s, t_ns) / s->cfg.volt_v : 0.0;
}

/* ---- the platform, for a gyro unit */

static void torque_platform(void *ctx, double u1_radps, double u2_radps, int64_t t_ns)
{
    const struct unit *u = ctx;
    (void)platform_torque(&u->lab->platform, u1_radps, u2_radps, t_ns);
}

static void reposition_platform(void *ctx, int64_t t_ns)
{
    const struct unit *u = ctx;
    platform_reposition(&u->lab->platform, t_ns);
}

static double read_servo_rad(void *ctx, int64_t t_ns)
{
    const struct unit *u = ctx;
    return platform_servo_rad(&u->lab->platform, t_ns);
}

static double read_encoder_rad(void *ctx, int64_t t_ns)
{
    const struct unit *u = ctx;
    return platform_encoder_rad(&u->lab->platform, t_ns);
}

static bool read_magnetic_rad(void *ctx, int64_t t_ns, double *heading_rad)
{
    const struct lab *l = ((const struct unit *)ctx)->lab;
    if (!l->magnetic.cfg.present) return false;
    *heading_rad = magnetic_heading_rad(&l->magnetic, &l->platform.vehicle, t_ns);
    return true;
}

static const struct board_platform_io platform_io = {torque_platform, reposition_platform, read_servo_rad,
                                                     read_encoder_rad, read_magnetic_rad};

void unit_put_surroundings(const struct unit *u, struct board_io *io)
{
    io->rate_radps = rate_radps;
    io->kinematics = case_kinematics;
    io->smooth_ns = smooth_ns;
    io->place = place_at;
    io->baro_m = baro_m;
    if (u->lab->supply.cfg.present) io->supply_ratio = supply_ratio;
    if (u->lab->platform.cfg.present) io->platform = &platform_io;
}

#include "phys/sensor/magnetic.h"

#include "base/detmath.h"
#include "phys/motion/pose.h"

#include <math.h>

#define DRAW_NS 1000000 /* a draw each millisecond */

struct magnetic_cfg magnetic_default(void)
{
    return (struct magnetic_cfg){.dip_deg = 67.0, .horizontal_ut = 19.0, .pendulous = true, .noise_ut = 0.1};
}

void magnetic_init(struct magnetic *m, const struct magnetic_cfg *cfg, uint64_t seed)
{
    *m = (struct magnetic){.cfg = *cfg, .noise = {draws_of(seed, 0, "magnetic.x"), draws_of(seed, 0, "magnetic.y")}};
}

void magnetic_reseed(struct magnetic *m, uint64_t seed)
{
    for (unsigned i = 0; i < 2; i++) draws_reseed(&m->noise[i], seed);
}

/* ---- the field */

static double further_rad(double at_site_deg, double slope, const struct vehicle *v, const struct vehicle_state *at)
{
    return at_site_deg * RAD_PER_DEG + slope * (at->latitude_rad - v->site.latitude_rad);
}

double magnetic_declination_rad(const struct magnetic *m, const struct vehicle *v, const struct vehicle_state *at)
{
    return further_rad(m->cfg.declination_deg, m->cfg.declination_slope, v, at);
}

static void field_ut(const struct magnetic *m, const struct vehicle *v, const struct vehicle_state *at, double b_l[3])
{
    const struct det_pair d = det_sin_cos(magnetic_declination_rad(m, v, at));
    const struct det_pair dip = det_sin_cos(further_rad(m->cfg.dip_deg, m->cfg.dip_slope, v, at));
    b_l[0] = m->cfg.horizontal_ut * d.sin;
    b_l[1] = m->cfg.horizontal_ut * d.cos;
    b_l[2] = -m->cfg.horizontal_ut * dip.sin / dip.cos;
}

/* ---- the sensor */

static double dot_product(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void make_unit(double a[3])
{
    const double size = sqrt(dot_product(a, a));
    for (unsigned k = 0; k < 3; k++) a[k] /= size;
}

/* x to the right and y ahead, in the plane across the pendulum or the vehicle's own, then by the plane's constant tilt. */
static void axes_of(const struct magnetic *m, const struct vehicle *v, const struct vehicle_state *at, double x[3],
                    double y[3])
{
    double z[3];
    for (unsigned k = 0; k < 3; k++) {
        y[k] = at->C_lc[k][1];
        z[k] = m->cfg.pendulous ? at->accel_l_mps2[k] + (k == 2 ? v->site.g_mps2 : 0.0) : at->C_lc[k][2];
    }
    make_unit(z);
    const double up = dot_product(y, z);
    for (unsigned k = 0; k < 3; k++) y[k] -= up * z[k];
    make_unit(y);
    pose_cross(y, z, x);
    const struct det_pair nose = det_sin_cos(m->cfg.tilt_arcmin[0] * RAD_PER_ARCMIN);
    const struct det_pair right = det_sin_cos(m->cfg.tilt_arcmin[1] * RAD_PER_ARCMIN);
    for (unsigned k = 0; k < 3; k++) {
        const double y_k = y[k] * nose.cos + z[k] * nose.sin, z_k = z[k] * nose.cos - y[k] * nose.sin;
        y[k] = y_k;
        x[k] = x[k] * right.cos - z_k * right.sin;
    }
}

static double deviation_rad(const struct magnetic *m, double heading_rad)
{
    const double *c = m->cfg.deviation_deg;
    const struct det_pair one = det_sin_cos(heading_rad), two = det_sin_cos(2.0 * heading_rad);
    return RAD_PER_DEG * (c[0] + c[1] * one.sin + c[2] * one.cos + c[3] * two.sin + c[4] * two.cos);
}

double magnetic_heading_rad(const struct magnetic *m, const struct vehicle *v, int64_t t_ns)
{
    struct vehicle_state at;
    double b_l[3], x[3], y[3];
    vehicle_at(v, t_ns, &at);
    field_ut(m, v, &at, b_l);
    axes_of(m, v, &at, x, y);
    const double across = dot_product(b_l, x) + m->cfg.noise_ut * draws_gauss(&m->noise[0], t_ns / DRAW_NS);
    const double along = dot_product(b_l, y) + m->cfg.noise_ut * draws_gauss(&m->noise[1], t_ns / DRAW_NS);
    const double shown_rad = det_atan2(-across, along);
    return det_wrap_rad(shown_rad + deviation_rad(m, shown_rad));
}

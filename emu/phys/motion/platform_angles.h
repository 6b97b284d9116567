/* Kinematics of the platform's angles: alpha about the vertical, beta about the middle axis, gamma about the inner one, by
 * which the gimbals follow the vehicle. Pure. Inline: the integration of platform.c takes them at each step. */
#ifndef PSABENCH_PHYS_MOTION_PLATFORM_ANGLES_H
#define PSABENCH_PHYS_MOTION_PLATFORM_ANGLES_H

#include "base/detmath.h"
#include "phys/motion/vehicle.h"

#include <math.h>

/* What the platform is on: the rate of l, and the outer axis in l. */
struct ground {
    double w_l_radps[3];
    double z_c[3];
};

struct trig {
    double sin_a, cos_a, sin_b, cos_b;
};

/* Block 1 of the article's fig. 3 without small angles: tan gamma = (x1 z_c)/(z2 z_c), with x1 = (cos a, sin a, 0) and
 * z2 = (sin b sin a, -sin b cos a, cos b), the platform's axes before the turn by gamma. */
struct tilt {
    double sin_g, cos_g;
    double across, along, inverse; /* x1 z_c, z2 z_c, 1 over their hypotenuse */
};

static inline struct tilt tilt_of(const struct trig *t, const double z_c[3])
{
    struct tilt g;
    g.across = z_c[0] * t->cos_a + z_c[1] * t->sin_a;
    g.along = t->cos_b * z_c[2] - t->sin_b * (z_c[1] * t->cos_a - z_c[0] * t->sin_a);
    g.inverse = 1.0 / sqrt(g.across * g.across + g.along * g.along);
    g.sin_g = g.across * g.inverse;
    g.cos_g = g.along * g.inverse;
    return g;
}

/* Equations (3) of the article solved for the rates of alpha and beta, with the whole rate of l (sources instruments 1.4). */
static inline void solve_rates(const struct ground *on, const struct trig *t, const double w_radps[2],
                               double rate_radps[2])
{
    const struct tilt g = tilt_of(t, on->z_c);
    const double *w_l = on->w_l_radps;
    const double ahead = t->cos_a * w_l[1] - t->sin_a * w_l[0];
    rate_radps[0] = (w_radps[1] * g.cos_g - w_radps[0] * g.sin_g + t->sin_b * ahead) / t->cos_b - w_l[2];
    rate_radps[1] = w_radps[0] * g.cos_g + w_radps[1] * g.sin_g - w_l[0] * t->cos_a - w_l[1] * t->sin_a;
}

/* Turns on by a small angle, up to 0.1 rad: the series are good to the last bit there. Products: divisions take thrice as long. */
static inline void turn_on(double *sin_x, double *cos_x, double d_rad)
{
    const double z = d_rad * d_rad;
    const double s = d_rad - d_rad * z * (1.0 / 6.0 - z * (1.0 / 120.0 - z * (1.0 / 5040.0)));
    const double less = z * (0.5 - z * (1.0 / 24.0 - z * (1.0 / 720.0 - z * (1.0 / 40320.0)))); /* 1 - cos */
    const double was = *sin_x;
    *sin_x += *cos_x * s - was * less;
    *cos_x -= was * s + *cos_x * less;
}

/* Columns x_p = x1 cos g - z2 sin g, y_p, z_p = z2 cos g + x1 sin g. */
static inline void platform_axes(const struct trig *t, const struct tilt *g, double C_lp[3][3])
{
    const double x1[3] = {t->cos_a, t->sin_a, 0.0};
    const double z2[3] = {t->sin_b * t->sin_a, -t->sin_b * t->cos_a, t->cos_b};
    const double y2[3] = {-t->cos_b * t->sin_a, t->cos_b * t->cos_a, t->sin_b};
    for (unsigned k = 0; k < 3; k++) {
        C_lp[k][0] = g->cos_g * x1[k] - g->sin_g * z2[k];
        C_lp[k][1] = y2[k];
        C_lp[k][2] = g->cos_g * z2[k] + g->sin_g * x1[k];
    }
}

static inline double dot_product(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* gamma' by differentiating tan gamma: x1' = alpha' y1, z2' = alpha' sin b x1 - beta' y2, z_c' = w_lc x z_c. */
static inline double gamma_radps(const struct vehicle_state *v, const struct trig *t, const struct tilt *g,
                                 const double rate_radps[2])
{
    const double *w = v->w_lc_l_radps;
    const double z_c[3] = {v->C_lc[0][2], v->C_lc[1][2], v->C_lc[2][2]};
    const double moves[3] = {w[1] * z_c[2] - w[2] * z_c[1], w[2] * z_c[0] - w[0] * z_c[2],
                             w[0] * z_c[1] - w[1] * z_c[0]};
    const double x1[3] = {t->cos_a, t->sin_a, 0.0};
    const double y1[3] = {-t->sin_a, t->cos_a, 0.0};
    const double y2[3] = {-t->cos_b * t->sin_a, t->cos_b * t->cos_a, t->sin_b};
    const double z2[3] = {t->sin_b * t->sin_a, -t->sin_b * t->cos_a, t->cos_b};
    const double across = rate_radps[0] * dot_product(y1, z_c) + dot_product(x1, moves);
    const double along =
        rate_radps[0] * t->sin_b * dot_product(x1, z_c) - rate_radps[1] * dot_product(y2, z_c) + dot_product(z2, moves);
    return (across * g->cos_g - along * g->sin_g) * g->inverse;
}

static inline double gimbal_rad(const struct vehicle_state *v, const double C_lp[3][3])
{
    double along[2];
    for (unsigned c = 0; c < 2; c++) {
        along[c] = v->C_lc[0][c] * C_lp[0][0] + v->C_lc[1][c] * C_lp[1][0] + v->C_lc[2][c] * C_lp[2][0];
    }
    return det_atan2(along[1], along[0]);
}

/* What p's axes have of a vector in l. */
static inline void into_p(const double C_lp[3][3], const double v_l[3], double v_p[3])
{
    for (unsigned k = 0; k < 3; k++) v_p[k] = C_lp[0][k] * v_l[0] + C_lp[1][k] * v_l[1] + C_lp[2][k] * v_l[2];
}

#endif

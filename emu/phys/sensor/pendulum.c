#include "phys/sensor/pendulum.h"

#include "base/detmath.h"

#include <math.h>

#define GONE 700.0 /* exponents past which nothing is left */

struct pendulum pendulum_default(void)
{
    return (struct pendulum){
        .mass_kg = 0.8e-3,
        .arm_m = 8e-3,
        .inertia_kg_m2 = 6.9e-8,
        .damping_n_m_s = 2.1e-4,
        .hinge_n_m_per_rad = 3e-3,
        .pickoff_v_per_rad = 2000.0,
        .amplifier_a_per_v = 3.408e-3,
        .torquer_n_m_per_a = 0.049,
        .gap_m = 20e-6,
        .electrode_arm_m = 8e-3,
    };
}

static double amperes_per_rad(const struct pendulum *p)
{
    return p->pickoff_v_per_rad * p->amplifier_a_per_v;
}

struct pendulum_law pendulum_law(const struct pendulum *p, double g_mps2)
{
    const double spring = amperes_per_rad(p) * p->torquer_n_m_per_a + p->hinge_n_m_per_rad;
    const double moment_n_m_per_g = p->mass_kg * p->arm_m * g_mps2;
    const double w_radps = sqrt(spring / p->inertia_kg_m2);
    return (struct pendulum_law){
        .stiffness_n_m_per_rad = spring,
        .natural_hz = w_radps / TURN_RAD,
        .damping = 0.5 * p->damping_n_m_s / (p->inertia_kg_m2 * w_radps),
        .scale_a_per_g = moment_n_m_per_g / spring * amperes_per_rad(p),
        .deflection_urad_per_g = moment_n_m_per_g / spring * 1e6,
        .hinge_ug_per_urad = p->hinge_n_m_per_rad / moment_n_m_per_g,
        .stop_a = amperes_per_rad(p) * p->gap_m / p->electrode_arm_m,
    };
}

struct pickoff pendulum_pickoff(const struct pendulum *p, double current_a)
{
    const double angle_rad = current_a / amperes_per_rad(p);
    const double off_m = p->electrode_arm_m * angle_rad;
    return (struct pickoff){
        .angle_rad = angle_rad,
        .gap_m = {p->gap_m + off_m, p->gap_m - off_m},
        .delta_m = 2.0 * off_m,
        .volt_v = p->pickoff_v_per_rad * angle_rad,
        .current_a = current_a,
    };
}

/* Below the critical damping: a sine of d w, d = sqrt(1 - z^2). */
static void step_swinging(double z, double wt, double step[2][2])
{
    const double d = sqrt(1.0 - z * z);
    if (z * wt > GONE) return;
    const double keep = det_exp(-z * wt);
    const double turns = d * wt / TURN_RAD;
    const struct det_pair a = det_sin_cos(TURN_RAD * (turns - floor(turns)));
    const double c = a.cos, s = a.sin;
    step[0][0] = keep * (c + z / d * s);
    step[0][1] = keep * s / d;
    step[1][0] = -keep * s / d;
    step[1][1] = keep * (c - z / d * s);
}

#define CRITICAL 1e-6 /* d w t below which sinh(d w t) / d is w t */

/* From there on: hyperbolic ones of d w, d = sqrt(z^2 - 1). */
static void step_creeping(double z, double wt, double step[2][2])
{
    const double d = sqrt(z * z - 1.0);
    const double slow = det_exp(-fmin(wt / (z + d), GONE)); /* z - d = 1 / (z + d) */
    const double fast = det_exp(-fmin(wt * (z + d), GONE));
    const double c = 0.5 * (slow + fast);
    const double s_per_d = d * wt < CRITICAL ? slow * wt : 0.5 * (slow - fast) / d;
    step[0][0] = c + z * s_per_d;
    step[0][1] = s_per_d;
    step[1][0] = -s_per_d;
    step[1][1] = c - z * s_per_d;
}

void pendulum_step(double natural_hz, double damping, double dt_s, double step[2][2])
{
    const double wt = TURN_RAD * natural_hz * dt_s;
    step[0][0] = step[0][1] = step[1][0] = step[1][1] = 0.0;
    if (damping < 1.0) step_swinging(damping, wt, step);
    else step_creeping(damping, wt, step);
}

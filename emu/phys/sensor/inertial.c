#include "phys/sensor/inertial.h"

#include "base/rng.h"

static void draw_vector(double v[3], double sd, uint64_t seed, uint64_t serial, const char *of)
{
    struct rng r = rng_stream(seed, serial, of);
    for (unsigned i = 0; i < 3; i++) v[i] += sd * rng_gauss(&r);
}

static void draw_matrix(double m[3][3], double diagonal_sd, double other_sd, uint64_t seed, uint64_t serial,
                        const char *of)
{
    struct rng r = rng_stream(seed, serial, of);
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++) m[i][j] += (i == j ? diagonal_sd : other_sd) * rng_gauss(&r);
}

void inertial_draw(struct inertial_errors *e, const struct inertial_spread *sd, uint64_t seed, uint64_t serial)
{
    draw_vector(e->nu0_radps, sd->nu0_radps, seed, serial, "inertial.nu0");
    draw_matrix(e->theta, sd->theta_scale, sd->theta_misalignment, seed, serial, "inertial.theta");
    draw_matrix(e->g_drift_radps_per_mps2, sd->g_drift_radps_per_mps2, sd->g_drift_radps_per_mps2, seed, serial,
                "inertial.g_drift");
    draw_vector(e->df0_mps2, sd->df0_mps2, seed, serial, "inertial.df0");
    draw_matrix(e->gamma, sd->gamma_scale, sd->gamma_misalignment, seed, serial, "inertial.gamma");
}

static double dot_product(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void inertial_rate_radps(const struct inertial_errors *e, const double w_radps[3], const double f_mps2[3],
                         double measured_radps[3])
{
    for (unsigned i = 0; i < 3; i++)
        measured_radps[i] = w_radps[i] + e->nu0_radps[i] + dot_product(e->theta[i], w_radps) +
                            dot_product(e->g_drift_radps_per_mps2[i], f_mps2);
}

void inertial_force_row(const struct inertial_errors *e, unsigned axis, double row[3])
{
    for (unsigned j = 0; j < 3; j++) row[j] = e->gamma[axis][j] + (j == axis ? 1.0 : 0.0);
}

#include "nav/north/nav_model.hpp"

struct nav_row nav_row_of(const struct nav_position *p, bool simplified)
{
    const double cd = nav_cos(p->delta_rad);
    const double sd = nav_sin(p->delta_rad);
    const double cg = nav_cos(p->gamma_rad);
    if (simplified) return {cd * cg, sd * cg};
    const double sgsb = nav_sin(p->gamma_rad) * nav_sin(p->beta_rad);
    return {cd * cg - sd * sgsb, sd * cg + cd * sgsb};
}

/* x_p = cos q x_c + sin q y_c, with x_c and y_c in local level at psi = 0 (sources instruments 1.3); its level part points to alpha, but for
 * the share that beta turns sideways: x_p = Rz(alpha) (cos g, sin b sin g, -sin g cos b). */
double nav_alpha(double psi_rad, double q_rad, double beta_rad, double pitch_rad, double roll_rad)
{
    const double cq = nav_cos(q_rad);
    const double sq = nav_sin(q_rad);
    const double cp = nav_cos(pitch_rad);
    const double sr = nav_sin(roll_rad);
    const double east = cq * nav_cos(roll_rad);
    const double north = cq * nav_sin(pitch_rad) * sr + sq * cp;
    const double up = sq * nav_sin(pitch_rad) - cq * cp * sr;
    const double cb = nav_cos(beta_rad);
    const double sg = -up / cb;
    const double sideways = nav_atan2(nav_sin(beta_rad) * sg, std::sqrt(1.0 - sg * sg));
    return nav_wrap(nav_atan2(north, east) - sideways - nav_angle(psi_rad));
}

double nav_gamma(double alpha_rad, double beta_rad, double psi_rad, double pitch_rad, double roll_rad)
{
    const double st = nav_sin(pitch_rad);
    const double sr = nav_sin(roll_rad);
    const double cr = nav_cos(roll_rad);
    const double sy = nav_sin(psi_rad);
    const double cy = nav_cos(psi_rad);
    const double z_east = -sy * st * cr + cy * sr;
    const double z_north = -cy * st * cr - sy * sr;
    const double z_up = nav_cos(pitch_rad) * cr;
    const double sa = nav_sin(alpha_rad);
    const double ca = nav_cos(alpha_rad);
    const double x1_zc = z_east * ca + z_north * sa;
    const double z2_zc = nav_cos(beta_rad) * z_up - nav_sin(beta_rad) * (-z_east * sa + z_north * ca);
    return nav_atan2(x1_zc, z2_zc);
}

double nav_heading(double alpha_rad, double q_rad, double beta_rad, double pitch_rad, double roll_rad)
{
    const double psi = nav_wrap(nav_alpha(0.0, q_rad, beta_rad, pitch_rad, roll_rad) - nav_angle(alpha_rad));
    const double up = psi < 0.0 ? psi + 2.0 * NAV_PI : psi;
    return up >= 2.0 * NAV_PI ? 0.0 : up; /* a hair below north rounds to the whole turn */
}

/* (7) at rest, solved for S = -m1 beta_n. beta is some tens of arc seconds and acts through sin(gamma): each turn takes off five
 * digits or more. */
double nav_rest_s_radps(const struct nav_rest *at, double *beta_rad)
{
    enum { TURNS_MAX = 50 };
    const struct nav_earth e = nav_earth_at(at->latitude_rad);
    const double wz_n = NAV_EARTH_RADPS * nav_sin(at->latitude_rad + at->latitude_error_rad);
    const double ca_sg = nav_cos(at->alpha_rad) * nav_sin(at->gamma_rad);
    const double sa_cg = nav_sin(at->alpha_rad) * nav_cos(at->gamma_rad);
    const double sg = nav_sin(at->gamma_rad);
    const double compensation = wz_n * nav_sin(at->gamma_rad + at->gamma_error_rad);
    double s = 0.0;
    double beta = 0.0;
    for (int turn = 0; turn < TURNS_MAX; turn++) {
        beta = -s / at->m1_per_s - at->beta_error_rad;
        const double w_x =
            e.we_radps * (sa_cg + ca_sg * nav_sin(beta)) - e.wz_radps * nav_cos(beta) * sg + at->drift1_radps;
        const double was = s;
        s = w_x / (1.0 + at->torquer_scale1) + compensation * nav_cos(beta + at->beta_error_rad);
        if (std::fabs(s - was) < 1e-18) break; /* 2e-13 deg/h */
    }
    if (beta_rad) *beta_rad = beta;
    return s;
}

double nav_azimuth_drift(double s_az_radps, double latitude_rad, double alpha_rad, double beta_rad, double gamma_rad)
{
    const struct nav_earth e = nav_earth_at(latitude_rad);
    const double sg = nav_sin(gamma_rad);
    const double cg = nav_cos(gamma_rad);
    return s_az_radps - e.wz_radps * nav_cos(beta_rad) * cg -
           e.we_radps * (nav_sin(alpha_rad) * sg - nav_cos(alpha_rad) * cg * nav_sin(beta_rad));
}

double nav_azimuth_drift_sd(double latitude_rad, double alpha_rad, double beta_sd_rad, double gamma_sd_rad)
{
    const double by_gamma = nav_sin(alpha_rad) * gamma_sd_rad;
    const double by_beta = nav_cos(alpha_rad) * beta_sd_rad;
    return std::fabs(nav_earth_at(latitude_rad).we_radps) * std::sqrt(by_gamma * by_gamma + by_beta * by_beta);
}

double nav_transport_radps(double v_east_mps, double latitude_rad)
{
    return v_east_mps * nav_sin(latitude_rad) / nav_cos(latitude_rad) / 6371000.0;
}

/* e^-gap sinh(x_a)/x_a sinh(x_b)/x_b, gap at least x_a + x_b: with the halves of the windows taken out of the exponent, so that
 * nothing overflows. */
static double decay_of_means(double gap, double x_a, double x_b)
{
    const double a = x_a < 1e-9 ? 1.0 : nav_rise(2.0 * x_a) / (2.0 * x_a);
    const double b = x_b < 1e-9 ? 1.0 : nav_rise(2.0 * x_b) / (2.0 * x_b);
    return nav_decay(gap > x_a + x_b ? gap - x_a - x_b : 0.0) * a * b;
}

double nav_gm_window_cov(double gm_sigma_radps, double gm_tau_s, double window_a_s, double window_b_s,
                         double between_middles_s)
{
    const double variance = gm_sigma_radps * gm_sigma_radps;
    const double x_a = 0.5 * window_a_s / gm_tau_s;
    if (between_middles_s == 0.0) return x_a == 0.0 ? variance : variance * nav_ramp_up(2.0 * x_a) / (2.0 * x_a * x_a);
    const double x_b = 0.5 * window_b_s / gm_tau_s;
    return variance * decay_of_means(std::fabs(between_middles_s) / gm_tau_s, x_a, x_b);
}

/* Windows begin at 0 or later, so that the sum of their middles is at least half of both lengths. */
double nav_gm_from_zero_less(const struct nav_noise *n, double t_a_s, double window_a_s, double t_b_s,
                             double window_b_s)
{
    return n->gm_sigma_radps * n->gm_sigma_radps *
           decay_of_means((t_a_s + t_b_s) / n->gm_tau_s, 0.5 * window_a_s / n->gm_tau_s,
                          0.5 * window_b_s / n->gm_tau_s);
}

double nav_gm_integral_sd_rad(double gm_sigma_radps, double gm_tau_s, double t_s, int from_zero)
{
    const double x = t_s / gm_tau_s;
    const double rise = nav_rise(x);
    const double square = 2.0 * nav_ramp_up(x) - (from_zero ? rise * rise : 0.0);
    return gm_sigma_radps * gm_tau_s * nav_root(square);
}

double nav_hold_sd_rad(const struct nav_hold *h, double t_s)
{
    const double drift = h->drift_sd_radps * t_s;
    const double gm =
        h->gm_sigma_radps > 0.0 ? nav_gm_integral_sd_rad(h->gm_sigma_radps, h->gm_tau_s, t_s, h->gm_from_zero) : 0.0;
    return std::sqrt(h->heading_sd_rad * h->heading_sd_rad + drift * drift + gm * gm);
}

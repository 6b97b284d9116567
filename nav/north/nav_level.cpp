#include "nav/north/nav_fit.hpp"

/* -cos b sin g = cos q u + sin q v: the upward parts u of x_c and v of y_c, which are -cos(pitch) sin(roll) and sin(pitch).
 * A constant error of gamma adds cos(g) of it to the left, 1 to the tilts that matter. */
int nav_attitude_from_level(const double *q_rad, const double *beta_rad, const double *gamma_rad, int count,
                            int with_bias, struct nav_attitude *out)
{
    const int unknowns = with_bias ? 3 : 2;
    if (count < unknowns || count > NAV_MAX_POSITIONS) return NAV_TOO_FEW;
    fit_design rows(count, unknowns);
    fit_square y(count, 1);
    for (int i = 0; i < count; i++) {
        const double beta = beta_rad ? beta_rad[i] : 0.0;
        if (!std::isfinite(q_rad[i] + beta + gamma_rad[i])) return NAV_NOT_FINITE;
        if (std::fabs(q_rad[i]) > 1e4 || std::fabs(gamma_rad[i]) > NAV_PI / 4 || std::fabs(beta) > NAV_PI / 4)
            return NAV_RANGE;
        rows(i, 0) = nav_cos(q_rad[i]);
        rows(i, 1) = nav_sin(q_rad[i]);
        if (with_bias) rows(i, 2) = -nav_cos(beta) * nav_cos(gamma_rad[i]);
        y(i, 0) = -nav_cos(beta) * nav_sin(gamma_rad[i]);
    }
    fit_gain x; /* one column */
    /* Directions that differ by less than some tenths of a degree do not count. */
    if (!fit_solve(rows, 1e-3, y, &x)) return NAV_COINCIDENT;
    if (!(x(0) * x(0) + x(1) * x(1) < 1.0)) return NAV_RANGE; /* no attitude: readings of no vehicle */
    out->pitch_rad = nav_asin(x(1));
    out->roll_rad = nav_asin(-x(0) / std::sqrt(1.0 - x(1) * x(1)));
    out->gamma_bias_rad = with_bias ? x(2) : 0.0;
    out->residual_rms_rad = std::sqrt((y - rows.lazyProduct(x)).squaredNorm() / count);
    return NAV_OK;
}

int nav_cardan(const double *q_rad, const double *beta_rad, int count, double pitch_rad, double roll_rad,
               double *delta_rad)
{
    if (count < 1) return NAV_TOO_FEW;
    if (!std::isfinite(pitch_rad + roll_rad)) return NAV_NOT_FINITE;
    if (std::fabs(pitch_rad) > NAV_PI / 4 || std::fabs(roll_rad) > NAV_PI / 4) return NAV_RANGE;
    for (int i = 0; i < count; i++) {
        const double beta = beta_rad ? beta_rad[i] : 0.0;
        if (!std::isfinite(q_rad[i] + beta)) return NAV_NOT_FINITE;
        if (std::fabs(q_rad[i]) > 1e4 || std::fabs(beta) > NAV_PI / 4) return NAV_RANGE;
    }
    const double first = nav_alpha(0.0, q_rad[0], beta_rad ? beta_rad[0] : 0.0, pitch_rad, roll_rad);
    for (int i = count - 1; i >= 0; i--) {
        const double turn = q_rad[i] - q_rad[0];
        const double delta = nav_alpha(0.0, q_rad[i], beta_rad ? beta_rad[i] : 0.0, pitch_rad, roll_rad) - first;
        delta_rad[i] = turn + nav_wrap(delta - turn);
    }
    return NAV_OK;
}

/* beta_n - integral of S falls by the settled S: of motion in the loop only the sensor's noise is left, and only once. */
int nav_window_slope(const double *beta_n_rad, const double *s_radps, int count, double dt_s, double *out_radps)
{
    if (count < 3) return NAV_TOO_FEW;
    if (!(dt_s > 0.0 && std::isfinite(dt_s))) return NAV_RANGE;
    const double middle = 0.5 * (count - 1);
    double integral = 0.0;
    double moment = 0.0;
    for (int k = 0; k < count; k++) {
        if (!std::isfinite(beta_n_rad[k] + s_radps[k])) return NAV_NOT_FINITE;
        moment += (k - middle) * (beta_n_rad[k] - beta_n_rad[0] - integral);
        integral += s_radps[k] * dt_s;
    }
    const double n = count;
    *out_radps = -moment / (dt_s * n * (n * n - 1.0) / 12.0);
    return NAV_OK;
}

#include "nav/north/nav_fit.hpp"

double fit_mean_time(const struct nav_position *p, int count)
{
    double sum = 0.0;
    for (int i = 0; i < count; i++) sum += p[i].t_mid_s;
    return sum / count;
}

double fit_time_scale(const struct nav_position *p, int count)
{
    const double span = p[count - 1].t_mid_s - p[0].t_mid_s;
    return span > 0.0 ? span : 1.0;
}

fit_design fit_rows(const struct nav_position *p, int count, const struct nav_gyrocompass_cfg *cfg)
{
    const double mean_s = fit_mean_time(p, count);
    const double scale_s = fit_time_scale(p, count);
    fit_design rows(count, cfg->ramp ? FIT_MAX : FIT_RAMP);
    for (int i = 0; i < count; i++) {
        const struct nav_row r = nav_row_of(&p[i], cfg->simplified != 0);
        rows(i, FIT_S) = r.a;
        rows(i, FIT_C) = r.b;
        rows(i, FIT_DRIFT) = 1.0;
        if (cfg->ramp) rows(i, FIT_RAMP) = (p[i].t_mid_s - mean_s) / scale_s;
    }
    return rows;
}

/* Of one pair of windows, not scaled. */
static double pair_covariance(const struct nav_position *a, const struct nav_position *b, const struct nav_noise *n,
                              double wz_radps)
{
    const double gm = n->gm_sigma_radps > 0.0 ? nav_gm_window_cov(n->gm_sigma_radps, n->gm_tau_s, a->window_s,
                                                                  b->window_s, b->t_mid_s - a->t_mid_s)
                                              : 0.0;
    if (a != b) return gm;
    const double white = n->white_radps_rts > 0.0 ? n->white_radps_rts * n->white_radps_rts / a->window_s : 0.0;
    const double level = wz_radps * n->level_sd_rad;
    return gm + white + level * level + n->window_sd_radps * n->window_sd_radps;
}

fit_square fit_covariance(const struct nav_position *p, int count, const struct nav_noise *noise, double latitude_rad)
{
    fit_square c = fit_square::Zero(count, count);
    if (noise->gm_sigma_radps + noise->white_radps_rts + noise->window_sd_radps + noise->level_sd_rad == 0.0) return c;
    const struct nav_earth e = nav_earth_at(latitude_rad);
    for (int i = 0; i < count; i++)
        for (int j = 0; j <= i; j++)
            c(i, j) = c(j, i) = pair_covariance(&p[i], &p[j], noise, e.wz_radps) / (e.we_radps * e.we_radps);
    return c;
}

fit_vector fit_by_latitude(const fit_design &rows, const struct nav_position *p, double latitude_rad, double s,
                           double c)
{
    const double tan_latitude = nav_sin(latitude_rad) / nav_cos(latitude_rad);
    fit_vector v = tan_latitude * (s * rows.col(FIT_S) + c * rows.col(FIT_C));
    for (Eigen::Index i = 0; i < v.size(); i++) v(i) += nav_sin(p[i].gamma_rad) * nav_cos(p[i].beta_rad);
    return v;
}

double fit_angle_variance(const struct nav_noise *noise)
{
    return noise->angle_sd_rad * noise->angle_sd_rad;
}

bool fit_is_weighted(int method)
{
    return method == NAV_GLS || method == NAV_GLS_CONSTRAINED;
}

bool fit_is_constrained(int method)
{
    return method == NAV_CONSTRAINED || method == NAV_GLS_CONSTRAINED;
}

/* The inverse of the lower Cholesky factor. By hand: Eigen's are made for large matrices and keep global cache sizes. */
static fit_square inverse_factor(const fit_square &c)
{
    const Eigen::Index n = c.rows();
    fit_square l = fit_square::Zero(n, n);
    for (Eigen::Index i = 0; i < n; i++)
        for (Eigen::Index j = 0; j <= i; j++) {
            const double left = c(i, j) - l.row(i).head(j).dot(l.row(j).head(j));
            l(i, j) = i == j ? std::sqrt(left > 1e-15 ? left : 1e-15) : left / l(j, j);
        }
    fit_square inverse = fit_square::Zero(n, n);
    for (Eigen::Index j = 0; j < n; j++)
        for (Eigen::Index i = j; i < n; i++) {
            const double unit = i == j ? 1.0 : 0.0;
            inverse(i, j) = (unit - l.row(i).segment(j, i - j).dot(inverse.col(j).segment(j, i - j))) / l(i, i);
        }
    return inverse;
}

fit_square fit_whitener(const fit_square &covariance, const struct nav_noise *noise, int method)
{
    const Eigen::Index n = covariance.rows();
    fit_square c = covariance;
    c.diagonal().array() += 0.5 * fit_angle_variance(noise);
    const double mean = c.trace() / (double)n;
    if (!fit_is_weighted(method) || mean <= 0.0) return fit_square::Identity(n, n);
    c /= mean;
    c.diagonal().array() += 1e-12; /* drift alone over short gaps is nearly the same in all windows */
    return inverse_factor(c);
}

double fit_geometry(const fit_design &rows)
{
    const double n = (double)rows.rows();
    const fit_small normal = rows.leftCols(FIT_RAMP).transpose().lazyProduct(rows.leftCols(FIT_RAMP));
    const Eigen::Matrix3d m = normal;
    const double square = m.determinant();
    return nav_root(square / (n * (n - 1.0) * (n - 2.0) / 6.0));
}

bool fit_gain_of(const fit_design &rows, const fit_square &whitener, fit_gain *gain)
{
    const fit_design white = whitener.lazyProduct(rows);
    return fit_solve(white, 1e-9, whitener, gain);
}

fit_design fit_jacobian(const fit_design &rows, double alpha_rad)
{
    fit_design j(rows.rows(), rows.cols() - 1);
    j.col(0) = rows.col(FIT_S) * nav_cos(alpha_rad) - rows.col(FIT_C) * nav_sin(alpha_rad);
    j.rightCols(rows.cols() - 2) = rows.rightCols(rows.cols() - 2);
    return j;
}

int fit_on_circle(const fit_design &rows, const fit_square &whitener, const fit_vector &y, double *alpha_rad,
                  fit_unknowns *x, fit_gain *gain)
{
    enum { STEPS_MAX = 30 };
    for (int step = 1; step <= STEPS_MAX; step++) {
        if (!fit_gain_of(fit_jacobian(rows, *alpha_rad), whitener, gain)) return -1;
        const fit_vector left = y - rows.col(FIT_S) * nav_sin(*alpha_rad) - rows.col(FIT_C) * nav_cos(*alpha_rad);
        *x = *gain * left;
        const double moved = (*x)(0);
        *alpha_rad = nav_wrap(*alpha_rad + moved);
        if (std::fabs(moved) < 1e-12) return step;
    }
    return STEPS_MAX;
}

/* The linear algebra of gyrocompassing: rows, covariance, weights, gain. Everything is scaled by We, so that s and c are of
 * order one. Bounded sizes: nothing is allocated. */
#ifndef PSABENCH_NAV_FIT_HPP
#define PSABENCH_NAV_FIT_HPP

#include "nav/north/nav_model.hpp"

#include <Eigen/Dense>

enum { FIT_S, FIT_C, FIT_DRIFT, FIT_RAMP, FIT_MAX };
using fit_vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, NAV_MAX_POSITIONS, 1>;
using fit_square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, NAV_MAX_POSITIONS, NAV_MAX_POSITIONS>;
using fit_design = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, NAV_MAX_POSITIONS, FIT_MAX>;
using fit_gain = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, FIT_MAX, NAV_MAX_POSITIONS>;
using fit_unknowns = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, FIT_MAX, 1>;
using fit_small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, FIT_MAX, FIT_MAX>;

/* [a b 1 (t)]; the ramp's unit is We per t_scale. */
fit_design fit_rows(const struct nav_position *p, int count, const struct nav_gyrocompass_cfg *cfg);
double fit_time_scale(const struct nav_position *p, int count);
double fit_mean_time(const struct nav_position *p, int count);

/* What S/We errs by for each rad that the latitude is wrong: sin(gamma) cos(beta) of the compensation, and tan(lat) of what is the
 * Earth's, a s + b c. */
fit_vector fit_by_latitude(const fit_design &rows, const struct nav_position *p, double latitude_rad, double s,
                           double c);

/* Covariance of S/We but for the angle readings and the latitude, whose shares hang on alpha. */
fit_square fit_covariance(const struct nav_position *p, int count, const struct nav_noise *noise, double latitude_rad);
/* Variance of S/We by angle readings at these alphas is this times cos^2. */
double fit_angle_variance(const struct nav_noise *noise);

/* Multiplies rows and S so that what is left is to be weighed alike: the inverse of the covariance's Cholesky factor. The angle
 * readings enter with cos^2 = 1/2, their mean over all directions, so that the weights do not hang on the answer. */
fit_square fit_whitener(const fit_square &covariance, const struct nav_noise *noise, int method);
bool fit_is_weighted(int method);
bool fit_is_constrained(int method);

/* rms over all threes of positions of |D|/We^2, by the formula of Cauchy and Binet. */
double fit_geometry(const fit_design &rows);

/* Derivative of S/We by (alpha, drift, ramp): [a cos - b sin, 1, (t)]. */
fit_design fit_jacobian(const fit_design &rows, double alpha_rad);

/* x of the least squares of rows x = b by Householder QR with pivoting, a column of x for each of b. False: the rank is short, pivots
 * below `threshold` of the largest taken for zero. Compiled once for all (nav_qr.cpp): its templates take the compiler ten seconds. */
bool fit_solve(const fit_design &rows, double threshold, const fit_square &b, fit_gain *x);

/* x = gain y solves rows x = y in the least squares of whitened rows; false: rank is short. */
bool fit_gain_of(const fit_design &rows, const fit_square &whitener, fit_gain *gain);

/* Gauss-Newton on the circle from alpha, which comes back improved with drift (and ramp) in x; returns steps, or -1. */
int fit_on_circle(const fit_design &rows, const fit_square &whitener, const fit_vector &y, double *alpha_rad,
                  fit_unknowns *x, fit_gain *gain);

#endif

/* What the error model's parts share: the equations in all nine moving states. */
#ifndef PSABENCH_NAV_ERRORS_MODEL_HPP
#define PSABENCH_NAV_ERRORS_MODEL_HPP

#include "nav/errors.h"
#include "nav/sins/sins_model.hpp"

constexpr int ERRORS_MOVING = 9; /* dr, dv, beta with their vertical parts */
constexpr int ERRORS_CONST = 24; /* nu, Theta, df, all nine Gamma */

using errors_square = Eigen::Matrix<double, ERRORS_MOVING, ERRORS_MOVING>;
using errors_drive = Eigen::Matrix<double, ERRORS_MOVING, ERRORS_CONST>;

/* A of x' = A x + G c. f_n: mean specific force in n. */
errors_square errors_rates(const struct nav_errors_cfg *cfg, const struct nav_state *at, const vec3 &f_n);

/* G, with this mean of C over the step. */
errors_drive errors_of_sensors(const mat3 &mean_c, const vec3 &w_b, const vec3 &f_b);

#endif

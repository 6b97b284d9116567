/* Vectors, matrices and rotations that the parts of libpsabench-nav share. Rotation vectors in rad. */
#ifndef PSABENCH_NAV_ROTATION_HPP
#define PSABENCH_NAV_ROTATION_HPP

#include "nav/common/nav_math.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

using vec3 = Eigen::Vector3d;
using mat3 = Eigen::Matrix3d;
using mat3_rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

mat3 nav_cross_matrix(const vec3 &v);     /* [v x] */
vec3 nav_rotation_log(const mat3 &c);     /* below half a turn */
mat3 nav_nearest_rotation(const mat3 &c); /* of a matrix that is one nearly */
bool nav_is_rotation(const mat3 &c, double within);
void nav_store_rows(const mat3 &c, double rows[9]);

/* exp([v x]): k2 v v' + cos |v| I + k1 [v x]. A series for small angles, whose first term left out is 1e-17 of 1. */
inline mat3 nav_rotation_by(const vec3 &v)
{
    const double z = v.squaredNorm();
    double cos_minus_1 = -0.5 * z + z * z * (1.0 / 24.0 - z * (1.0 / 720.0));
    double k1 = 1.0 - z * (1.0 / 6.0 - z * (1.0 / 120.0 - z * (1.0 / 5040.0)));
    double k2 = 0.5 - z * (1.0 / 24.0 - z * (1.0 / 720.0));
    if (z > 1e-4) {
        const double angle = std::sqrt(z);
        cos_minus_1 = nav_cos(angle) - 1.0;
        k1 = nav_sin(angle) / angle;
        k2 = -cos_minus_1 / z;
    }
    mat3 r = k2 * v * v.transpose();
    r.diagonal().array() += 1.0 + cos_minus_1;
    r(0, 1) -= k1 * v[2];
    r(1, 0) += k1 * v[2];
    r(0, 2) += k1 * v[1];
    r(2, 0) -= k1 * v[1];
    r(1, 2) -= k1 * v[0];
    r(2, 1) += k1 * v[0];
    return r;
}

#endif

#include "nav/common/nav_rotation.hpp"

mat3 nav_cross_matrix(const vec3 &v)
{
    mat3 m;
    m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
    return m;
}

vec3 nav_rotation_log(const mat3 &c)
{
    const vec3 twice(c(2, 1) - c(1, 2), c(0, 2) - c(2, 0), c(1, 0) - c(0, 1));
    const double s = 0.5 * twice.norm();
    const double cosine = 0.5 * (c.trace() - 1.0);
    const double s2 = s * s;
    if (s < 1e-2 && cosine > 0.0) return 0.5 * (1.0 + s2 / 6.0 * (1.0 + s2 * 9.0 / 20.0)) * twice;
    return 0.5 * nav_atan2(s, cosine) / s * twice;
}

mat3 nav_nearest_rotation(const mat3 &c)
{
    return 0.5 * c * (3.0 * mat3::Identity() - c.transpose() * c);
}

bool nav_is_rotation(const mat3 &c, double within)
{
    const mat3 left = c.transpose() * c - mat3::Identity();
    return left.cwiseAbs().maxCoeff() <= within && c.determinant() > 0.0;
}

void nav_store_rows(const mat3 &c, double rows[9])
{
    for (int i = 0; i < 9; i++) rows[i] = c(i / 3, i % 3);
}

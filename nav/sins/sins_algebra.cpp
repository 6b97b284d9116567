#include "nav/sins/sins_model.hpp"

#include "nav/common/nav_math.hpp"

mat3 sins_cross(const vec3 &v)
{
    mat3 m;
    m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
    return m;
}

/* sin a / a and (1 - cos a)/a^2 by series below half a degree, where the next term is under the last bit. */
mat3 sins_exp(const vec3 &v)
{
    const double a2 = v.squaredNorm();
    double s = 1.0 - a2 / 6.0 * (1.0 - a2 / 20.0);
    double c = 0.5 - a2 / 24.0 * (1.0 - a2 / 30.0);
    if (a2 > 1e-4) {
        const double a = std::sqrt(a2);
        s = nav_sin(a) / a;
        c = (1.0 - nav_cos(a)) / a2;
    }
    const mat3 k = sins_cross(v);
    return mat3::Identity() + s * k + c * (k * k);
}

vec3 sins_log(const mat3 &c)
{
    const vec3 twice(c(2, 1) - c(1, 2), c(0, 2) - c(2, 0), c(1, 0) - c(0, 1));
    const double s = 0.5 * twice.norm();
    const double cosine = 0.5 * (c.trace() - 1.0);
    const double s2 = s * s;
    if (s < 1e-2 && cosine > 0.0) return 0.5 * (1.0 + s2 / 6.0 * (1.0 + s2 * 9.0 / 20.0)) * twice;
    return 0.5 * nav_atan2(s, cosine) / s * twice;
}

mat3 sins_normal(const mat3 &c)
{
    return 0.5 * c * (3.0 * mat3::Identity() - c.transpose() * c);
}

bool sins_is_rotation(const mat3 &c, double within)
{
    const mat3 left = c.transpose() * c - mat3::Identity();
    return left.cwiseAbs().maxCoeff() <= within && c.determinant() > 0.0;
}

void sins_store(const mat3 &c, double rows[9])
{
    for (int i = 0; i < 9; i++) rows[i] = c(i / 3, i % 3);
}

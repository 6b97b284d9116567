#include "nav/sins/sins_model.hpp"

/* Gamma + [e x]: 23 and 32 hold -+ e1, 13 and 31 +- e2, 12 and 21 -+ e3. */
const struct sins_gauge sins_gauges[3] = {
    {6, {0, 3, 4, 5, 6, 8}, {7, 2, 1}}, /* NAV_SINS_ARTICLE: 32, 13, 12 are zero */
    {6, {0, 3, 4, 6, 7, 8}, {5, 2, 1}}, /* NAV_SINS_LOWER: 23, 13, 12 */
    {9, {0, 1, 2, 3, 4, 5, 6, 7, 8}, {0, 0, 0}},
};

/* e that brings the dropped elements to zero to the first order. */
static vec3 find_turn(const struct sins_gauge *g, const double gamma[9])
{
    vec3 e;
    for (int k = 0; k < 3; k++) {
        const int at = g->dropped[k];
        const bool plus = at == 7 || at == 2 || at == 3; /* 32, 13, 21 hold +e */
        e(k) = plus ? -gamma[at] : gamma[at];
    }
    return e;
}

static void turn_rows(double m[9], const mat3 &r_back)
{
    Eigen::Map<mat3_rows> rows(m);
    const mat3 turned = (mat3::Identity() + rows) * r_back;
    rows = turned - mat3::Identity();
}

int nav_sins_to_gauge(int gauge, struct nav_sins_params *p, double r_out[9])
{
    if (gauge < NAV_SINS_ARTICLE || gauge > NAV_SINS_FREE9) return NAV_RANGE;
    const struct sins_gauge *g = &sins_gauges[gauge];
    mat3 r = mat3::Identity();
    for (int turn = 0; g->count == 6 && turn < 6; turn++) { /* Newton's: the error is squared each time */
        const mat3 back = nav_rotation_by(find_turn(g, p->gamma));
        turn_rows(p->gamma, back);
        turn_rows(p->theta, back);
        r = back.transpose() * r;
    }
    for (int k = 0; g->count == 6 && k < 3; k++) p->gamma[g->dropped[k]] = 0.0;
    Eigen::Map<vec3> delta(p->delta_rad);
    delta = nav_rotation_log(r * nav_rotation_by(delta));
    if (r_out) nav_store_rows(r, r_out);
    return NAV_OK;
}

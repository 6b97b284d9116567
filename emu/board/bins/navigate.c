/* The unit navigates by itself: it aligns at rest, then integrates its own increments, errors and all.
 *
 * Axes n are east, north, up at the present place; q turns b to n. The height is held. Rotation vector and velocity of a reading
 * from its increments and those before it (coning and sculling of two readings), the turn of n by its mean rate. */
#include "board/bins/navigate.h"

#include "base/detmath.h"
#include "board/bins/bins.h"
#include "phys/flight/ellipsoid.h"
#include "phys/motion/earth.h"

#include <math.h>
#include <string.h>

#define STILL_RADPS      (0.1 * RAD_PER_DEG) /* an alignment's rate, the Earth's is a twentieth of it */
#define LATITUDE_MAX_RAD (89.0 * RAD_PER_DEG)
#define NS_A_SECOND      1e9

enum { E, N, U };

/* ---- rotations */

static void cross_product(const double a[3], const double b[3], double out[3])
{
    const double c[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    memcpy(out, c, sizeof c);
}

static void multiply_quaternions(const double p[4], const double q[4], double out[4])
{
    const double r[4] = {
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3], p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1], p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]};
    memcpy(out, r, sizeof r);
}

/* Of a rotation vector of a reading, below half a radian: the series' next term is 1e-14 there. */
static void quaternion_of(const double v[3], double q[4])
{
    const double z = 0.25 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    const double half = 0.5 * (1.0 - z * (1.0 / 6.0 - z * (1.0 / 120.0 - z * (1.0 / 5040.0 - z * (1.0 / 362880.0)))));
    q[0] = 1.0 - z * (0.5 - z * (1.0 / 24.0 - z * (1.0 / 720.0 - z * (1.0 / 40320.0))));
    for (unsigned i = 0; i < 3; i++) q[i + 1] = half * v[i];
}

static void into_n(const double q[4], const double v[3], double out[3])
{
    const double pure[4] = {0.0, v[0], v[1], v[2]}, back[4] = {q[0], -q[1], -q[2], -q[3]};
    double r[4];
    multiply_quaternions(q, pure, r);
    multiply_quaternions(r, back, r);
    memcpy(out, r + 1, 3 * sizeof *out);
}

static void normalise_quaternion(double q[4])
{
    const double size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (unsigned i = 0; i < 4; i++) q[i] /= size;
}

/* Rows are east, north and up in b. The component of q that is largest is found first. */
static void quaternion_of_rows(const double c[3][3], double q[4])
{
    const double square[4] = {c[0][0] + c[1][1] + c[2][2], c[0][0] - c[1][1] - c[2][2], c[1][1] - c[0][0] - c[2][2],
                              c[2][2] - c[0][0] - c[1][1]};
    const double w[3] = {c[2][1] - c[1][2], c[0][2] - c[2][0], c[1][0] - c[0][1]};
    unsigned k = 0;
    for (unsigned i = 1; i < 4; i++)
        if (square[i] > square[k]) k = i;
    const double two = sqrt(1.0 + square[k]); /* twice that component */
    q[k] = 0.5 * two;
    if (k == 0) {
        for (unsigned i = 0; i < 3; i++) q[i + 1] = 0.5 * w[i] / two;
        return;
    }
    const unsigned i = k - 1;
    q[0] = 0.5 * w[i] / two;
    for (unsigned j = 0; j < 3; j++)
        if (j != i) q[j + 1] = 0.5 * (c[i][j] + c[j][i]) / two;
}

/* ---- alignment */

static bool is_moving(const double dtheta_rad[3], double dt_s)
{
    const double limit = STILL_RADPS * dt_s;
    return fabs(dtheta_rad[0]) > limit || fabs(dtheta_rad[1]) > limit || fabs(dtheta_rad[2]) > limit;
}

static bool make_unit(double v[3])
{
    const double size = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (unsigned i = 0; i < 3; i++) v[i] /= size;
    return size > 0.0;
}

/* Up is where the mean force points, east is across it and the mean rate. */
static bool find_attitude(struct bins_nav *n)
{
    double c[3][3];
    memcpy(c[U], n->force, sizeof c[U]);
    if (!make_unit(c[U])) return false;
    cross_product(n->rate, c[U], c[E]);
    if (!make_unit(c[E])) return false;
    cross_product(c[U], c[E], c[N]);
    quaternion_of_rows((const double(*)[3])c, n->q);
    normalise_quaternion(n->q);
    return true;
}

static void align_on(struct bins_nav *n, const double a[3], const double v[3], double dt_s)
{
    if (is_moving(a, dt_s)) {
        n->state = BINS_NAV_FAILED;
        return;
    }
    for (unsigned i = 0; i < 3; i++) {
        n->rate[i] += a[i];
        n->force[i] += v[i];
    }
    n->time_s += dt_s;
    if (n->time_s + 0.5 * dt_s < n->taken.alignment_s) return;
    n->state = find_attitude(n) ? BINS_NAV_RUNNING : BINS_NAV_FAILED;
    n->due = true;
    n->since = 0;
}

/* ---- navigation */

struct level {
    double sin, cos, meridian_m, vertical_m;
};

static struct level level_at(const struct bins_nav *n)
{
    const struct det_pair lat = det_sin_cos(n->lat_rad);
    const struct radii r = ellipsoid_radii(lat.sin, lat.cos);
    return (struct level){lat.sin, lat.cos, r.meridian_m + n->taken.h_m, r.vertical_m + n->taken.h_m};
}

/* Of n against the Earth. */
static void transport_rate(const struct level *l, const double v[2], double out[3])
{
    out[E] = -v[N] / l->meridian_m;
    out[N] = v[E] / l->vertical_m;
    out[U] = out[N] * l->sin / l->cos;
}

/* Of one reading, in b at its beginning. */
static void increments_of(const struct bins_nav *n, const double a[3], const double v[3], double turn[3],
                          double push[3])
{
    double coning[3], scull[3], other[3], mean[3];
    cross_product(n->a_before, a, coning);
    cross_product(n->a_before, v, scull);
    cross_product(n->v_before, a, other);
    cross_product(a, v, mean);
    for (unsigned i = 0; i < 3; i++) {
        turn[i] = a[i] + coning[i] / 12.0;
        push[i] = v[i] + 0.5 * mean[i] + (scull[i] + other[i]) / 12.0;
    }
}

static void navigate_on(struct bins_nav *n, const double a[3], const double v[3], double dt_s)
{
    const struct level l = level_at(n);
    const double u[3] = {0.0, EARTH_RATE_RADPS * l.cos, EARTH_RATE_RADPS * l.sin},
                 held[3] = {n->v_mps[E], n->v_mps[N], 0.0};
    double rho[3], turn[3], push[3], push_n[3], w[3], coriolis[3], lean[3], back[3], q[4], mean[2];
    increments_of(n, a, v, turn, push);
    into_n(n->q, push, push_n);
    transport_rate(&l, n->v_mps, rho);
    for (unsigned i = 0; i < 3; i++) w[i] = 2.0 * u[i] + rho[i];
    cross_product(w, held, coriolis);
    for (unsigned i = 0; i < 3; i++) w[i] = -0.5 * (u[i] + rho[i]) * dt_s; /* n has turned by half of it on the way */
    cross_product(w, push_n, lean);
    for (unsigned i = 0; i < 2; i++) {
        const double after = n->v_mps[i] + push_n[i] + lean[i] - coriolis[i] * dt_s;
        mean[i] = 0.5 * (n->v_mps[i] + after);
        n->v_mps[i] = after;
    }
    transport_rate(&l, mean, rho);
    n->lat_rad -= rho[E] * dt_s;
    n->lon_rad = det_wrap_rad(n->lon_rad + rho[N] / l.cos * dt_s);
    for (unsigned i = 0; i < 3; i++) back[i] = -(u[i] + rho[i]) * dt_s;
    quaternion_of(turn, q);
    multiply_quaternions(n->q, q, n->q);
    quaternion_of(back, q);
    multiply_quaternions(q, n->q, n->q);
    normalise_quaternion(n->q);
    if (fabs(n->lat_rad) > LATITUDE_MAX_RAD) n->state = BINS_NAV_FAILED;
    for (unsigned i = 0; i < 3; i++) n->turned_rad[i] += a[i];
    n->due = ++n->since % n->every == 0;
}

/* ---- outputs */

void bins_nav_rates(const struct bins_nav *n, double w_radps[3])
{
    const double dt_s = (double)(n->t_ns - n->shown_ns) / NS_A_SECOND;
    for (unsigned i = 0; i < 3; i++) w_radps[i] = dt_s > 0.0 ? n->turned_rad[i] / dt_s : 0.0;
}

void bins_nav_shown(struct bins_nav *n)
{
    n->shown_ns = n->t_ns;
    memset(n->turned_rad, 0, sizeof n->turned_rad);
}

/* ---- commands and readings */

void bins_nav_stop(struct bins_nav *n)
{
    const struct bins_nav_settings set = n->set;
    *n = (struct bins_nav){.set = set};
}

void bins_nav_start(struct bins_nav *n, const struct bins_reading *from, uint32_t every, double gyro_rad,
                    double accel_mps)
{
    bins_nav_stop(n);
    n->taken = n->set;
    n->state = BINS_NAV_ALIGNING;
    n->every = every;
    n->t_ns = n->shown_ns = from->t_ns;
    n->lat_rad = n->set.lat_rad;
    n->lon_rad = n->set.lon_rad;
    n->gyro_rad = gyro_rad;
    n->accel_mps = accel_mps;
}

/* A word is truncated: half a code is missing in each. */
bool bins_nav_take(struct bins_nav *n, const struct bins_reading *r)
{
    if (n->state != BINS_NAV_ALIGNING && n->state != BINS_NAV_RUNNING) return false;
    const double dt_s = (double)(r->t_ns - n->t_ns) / NS_A_SECOND;
    double a[3], v[3];
    for (unsigned i = 0; i < 3; i++) {
        a[i] = r->gyro[i] * n->gyro_rad;
        v[i] = (r->accel[i] + 0.5 * r->words) * n->accel_mps;
    }
    n->due = false;
    if (n->state == BINS_NAV_ALIGNING) align_on(n, a, v, dt_s);
    else navigate_on(n, a, v, dt_s);
    memcpy(n->a_before, a, sizeof a);
    memcpy(n->v_before, v, sizeof v);
    n->t_ns = r->t_ns;
    return n->due && n->state == BINS_NAV_RUNNING;
}

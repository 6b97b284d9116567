#include "phys/flight/increment.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <math.h>

#define PANEL_NS INT64_C(100000000)

/* Nodes and weights on (0, 1); they are symmetric. */
static const struct {
    double at, weight;
} gauss[] = {
    {0.04691007703066800, 0.11846344252809454}, {0.23076534494715845, 0.23931433524968324}, {0.5, 0.28444444444444444},
    {0.76923465505284155, 0.23931433524968324}, {0.95308992296933200, 0.11846344252809454},
};

static void add_panel(const struct flight *f, int64_t from_ns, int64_t to_ns, double angle_rad[3], double speed_mps[3])
{
    const double span_ns = (double)(to_ns - from_ns), span_s = sched_since_s(from_ns, to_ns);
    for (unsigned i = 0; i < sizeof gauss / sizeof *gauss; i++) {
        struct flight_state s;
        flight_at(f, from_ns + (int64_t)nearbyint(gauss[i].at * span_ns), &s);
        for (unsigned k = 0; k < 3; k++) {
            angle_rad[k] += gauss[i].weight * span_s * s.pose.w_ib_b_radps[k];
            speed_mps[k] += gauss[i].weight * span_s * s.f_b_mps2[k];
        }
    }
}

static int64_t earlier_ns(int64_t a_ns, int64_t b_ns)
{
    return a_ns < b_ns ? a_ns : b_ns;
}

void flight_increment(const struct flight *f, int64_t from_ns, int64_t to_ns, double angle_rad[3], double speed_mps[3])
{
    for (unsigned k = 0; k < 3; k++) angle_rad[k] = speed_mps[k] = 0.0;
    while (from_ns < to_ns) {
        const int64_t end_ns = earlier_ns(earlier_ns(from_ns + PANEL_NS, to_ns), flight_smooth_ns(f, from_ns));
        add_panel(f, from_ns, end_ns, angle_rad, speed_mps);
        from_ns = end_ns;
    }
}

/* From Earth-centred axes, x to the Greenwich meridian of t = 0, that do not turn: about z, then -y to the north-east-down frame. */
static struct pose inertial_pose(const struct flight *f, int64_t t_ns)
{
    struct flight_state s;
    struct pose p = {.C_nb = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
    flight_at(f, t_ns, &s);
    pose_turn(&p, POSE_Z, s.lon_rad + EARTH_RATE_RADPS * sched_since_s(0, t_ns), 0.0, 0.0);
    pose_turn(&p, POSE_Y, -s.lat_rad - 0.25 * TURN_RAD, 0.0, 0.0);
    pose_turn(&p, POSE_Z, s.heading_rad, 0.0, 0.0);
    pose_turn(&p, POSE_Y, s.pitch_rad, 0.0, 0.0);
    pose_turn(&p, POSE_X, s.roll_rad, 0.0, 0.0);
    return p;
}

void flight_turn(const struct flight *f, int64_t from_ns, int64_t to_ns, double turn_rad[3])
{
    const struct pose a = inertial_pose(f, from_ns), b = inertial_pose(f, to_ns);
    double c[3][3] = {{0}};
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++)
            for (unsigned k = 0; k < 3; k++) c[i][j] += a.C_nb[k][i] * b.C_nb[k][j];
    const double twice[3] = {c[2][1] - c[1][2], c[0][2] - c[2][0], c[1][0] - c[0][1]};
    const double sine = 0.5 * sqrt(twice[0] * twice[0] + twice[1] * twice[1] + twice[2] * twice[2]);
    const double angle = det_atan2(sine, 0.5 * (c[0][0] + c[1][1] + c[2][2] - 1.0));
    const double scale = sine > 1e-9 ? 0.5 * angle / sine : 0.5;
    for (unsigned k = 0; k < 3; k++) turn_rad[k] = scale * twice[k];
}

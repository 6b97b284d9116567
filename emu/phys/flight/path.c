#include "phys/flight/path.h"

#include "base/sched.h"
#include "phys/flight/ellipsoid.h"

#include <math.h>
#include <stdio.h>

#define STEP_S        60.0 /* between nodes at most, */
#define TURN_STEP_RAD 0.1  /* with less turn than this, */
#define PIECES        16u  /* so many where speed, track or height are curves, */
#define PERIOD        72u  /* and so many a period of a swing */
#define SUBSTEPS      16u  /* of the integrator from node to node */

/* ---- motion without place */

static struct jet track_at(const struct flight_plan *p, int64_t t_ns)
{
    const struct jet mean = channel_at(&p->track_rad, t_ns), s = flight_plan_swing(p, SWING_TRACK, t_ns);
    return (struct jet){mean.at + s.at, mean.d1 + s.d1, mean.d2 + s.d2, mean.d3 + s.d3};
}

static void move_path(const struct flight_plan *plan, int64_t t_ns, struct path *p)
{
    const struct jet h = channel_at(&plan->height_m, t_ns);
    p->speed_mps = channel_at(&plan->speed_mps, t_ns);
    p->track_rad = track_at(plan, t_ns);
    p->h_m = h.at;
    p->up_mps = (struct jet){h.d1, h.d2, h.d3, 0.0};
    p->track = det_sin_cos(p->track_rad.at);
    const double u = p->speed_mps.at, along = p->speed_mps.d1, across = u * p->track_rad.d1;
    p->v_enu_mps[0] = u * p->track.sin;
    p->v_enu_mps[1] = u * p->track.cos;
    p->v_enu_mps[2] = h.d1;
    p->a_enu_mps2[0] = along * p->track.sin + across * p->track.cos;
    p->a_enu_mps2[1] = along * p->track.cos - across * p->track.sin;
    p->a_enu_mps2[2] = h.d2;
}

/* ---- the same at a latitude */

static void place_path(struct path *p, double lat_rad, double lon_rad)
{
    p->lat_rad = lat_rad;
    p->lon_rad = lon_rad;
    p->lat = det_sin_cos(lat_rad);
    const struct radii r = ellipsoid_radii(p->lat.sin, p->lat.cos);
    p->meridian_m = r.meridian_m + p->h_m;
    p->vertical_m = r.vertical_m + p->h_m;
    p->lat_d1_radps = p->v_enu_mps[1] / p->meridian_m;
    p->meridian_d1_mps = r.meridian_m_per_rad * p->lat_d1_radps + p->v_enu_mps[2];
    p->vertical_d1_mps = r.vertical_m_per_rad * p->lat_d1_radps + p->v_enu_mps[2];
    p->w_en_n_radps[0] = p->v_enu_mps[0] / p->vertical_m;
    p->w_en_n_radps[1] = -p->lat_d1_radps;
    p->w_en_n_radps[2] = -p->w_en_n_radps[0] * p->lat.sin / p->lat.cos;
}

static double lon_d1_radps(const struct path *p)
{
    return p->w_en_n_radps[0] / p->lat.cos;
}

static void set_node(const struct path *p, int64_t t_ns, struct flight_node *n)
{
    const double lon_d1 = lon_d1_radps(p);
    const double east = (p->a_enu_mps2[0] - p->w_en_n_radps[0] * p->vertical_d1_mps) / p->vertical_m;
    *n = (struct flight_node){
        .t_ns = t_ns,
        .lat = {p->lat_rad, p->lat_d1_radps, (p->a_enu_mps2[1] - p->lat_d1_radps * p->meridian_d1_mps) / p->meridian_m},
        .lon = {p->lon_rad, lon_d1, (east + lon_d1 * p->lat.sin * p->lat_d1_radps) / p->lat.cos},
    };
}

/* ---- nodes */

/* Rates of latitude and longitude; the longitude itself plays no part. */
static void slope_at(const struct path *moved, double lat_rad, double d[2])
{
    struct path p = *moved;
    place_path(&p, lat_rad, 0.0);
    d[0] = p.lat_d1_radps;
    d[1] = lon_d1_radps(&p);
}

/* A step of Runge and Kutta's fourth order. */
static void advance_place(const struct flight_plan *plan, int64_t from_ns, int64_t to_ns, double at[2])
{
    const double h = sched_since_s(from_ns, to_ns);
    struct path begin, middle, end;
    double k[4][2];
    move_path(plan, from_ns, &begin);
    move_path(plan, from_ns + (to_ns - from_ns) / 2, &middle);
    move_path(plan, to_ns, &end);
    slope_at(&begin, at[0], k[0]);
    slope_at(&middle, at[0] + 0.5 * h * k[0][0], k[1]);
    slope_at(&middle, at[0] + 0.5 * h * k[1][0], k[2]);
    slope_at(&end, at[0] + h * k[2][0], k[3]);
    for (unsigned i = 0; i < 2; i++) at[i] += h / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
}

static void add_node(struct flight *f, int64_t t_ns, const double at[2])
{
    struct path p;
    move_path(&f->plan, t_ns, &p);
    place_path(&p, at[0], at[1]);
    set_node(&p, t_ns, &f->node[f->nodes++]);
}

static double swing_nodes(const struct flight_plan *p, int64_t from_ns, int64_t to_ns)
{
    double most = 0.0;
    for (unsigned i = 0; i < p->swings; i++) {
        const struct swing *s = &p->swing[i];
        if (s->of == SWING_TRACK && s->from_ns < to_ns && s->to_ns > from_ns)
            most = fmax(most, (double)PERIOD * sched_since_s(from_ns, to_ns) / s->period_s);
    }
    return most;
}

/* How many nodes an interval needs in which all is smooth. */
static unsigned nodes_of(const struct flight_plan *plan, int64_t from_ns, int64_t to_ns)
{
    struct path begin, middle, end;
    move_path(plan, from_ns, &begin);
    move_path(plan, from_ns + (to_ns - from_ns) / 2, &middle);
    move_path(plan, to_ns, &end);
    if (begin.speed_mps.at == 0.0 && middle.speed_mps.at == 0.0 && end.speed_mps.at == 0.0) return 1;
    const double s = sched_since_s(from_ns, to_ns);
    const double rate = fmax(fabs(begin.track_rad.d1), fmax(fabs(middle.track_rad.d1), fabs(end.track_rad.d1)));
    const bool curved = middle.speed_mps.d2 != 0.0 || middle.track_rad.d2 != 0.0 || middle.up_mps.d1 != 0.0 ||
                        begin.speed_mps.d1 != end.speed_mps.d1 || begin.track_rad.d1 != end.track_rad.d1 ||
                        begin.up_mps.d1 != end.up_mps.d1;
    const double by_turn = s * rate / TURN_STEP_RAD, by_swing = swing_nodes(plan, from_ns, to_ns);
    return (unsigned)ceil(fmax(fmax(s / STEP_S, by_turn), fmax(by_swing, curved ? (double)PIECES : 1.0)));
}

static void cross_step(struct flight *f, int64_t from_ns, int64_t to_ns, double at[2])
{
    for (int64_t i = 0; i < SUBSTEPS; i++)
        advance_place(&f->plan, from_ns + (to_ns - from_ns) * i / SUBSTEPS,
                      from_ns + (to_ns - from_ns) * (i + 1) / SUBSTEPS, at);
}

static bool fail_at(const struct flight *f, int64_t t_ns, struct flight_error *e, const char *text)
{
    e->leg = flight_plan_leg(&f->plan, t_ns);
    e->key = flight_kind(f->cfg.plan.leg[e->leg].kind)->key;
    snprintf(e->text, sizeof e->text, "%s", text);
    return false;
}

static bool cross_smooth(struct flight *f, int64_t from_ns, int64_t to_ns, double at[2], struct flight_error *e)
{
    const unsigned n = nodes_of(&f->plan, from_ns, to_ns);
    if (f->nodes + n > FLIGHT_NODES)
        return fail_at(f, from_ns, e, "expected a shorter flight, got more turns than there is room for");
    for (int64_t i = 0; i < n; i++) {
        const int64_t end_ns = from_ns + (to_ns - from_ns) * (i + 1) / n;
        cross_step(f, from_ns + (to_ns - from_ns) * i / n, end_ns, at);
        if (fabs(at[0]) > FLIGHT_LATITUDE_MAX_DEG * RAD_PER_DEG)
            return fail_at(f, from_ns, e, "expected a latitude within 85 deg, got a path towards a pole");
        add_node(f, end_ns, at);
    }
    return true;
}

bool path_make(struct flight *f, struct flight_error *e)
{
    const int64_t end_ns = f->plan.leg_ns[f->cfg.plan.legs];
    double at[2] = {f->site.latitude_rad, f->site.longitude_rad};
    f->nodes = 0;
    add_node(f, 0, at);
    for (int64_t t_ns = 0; t_ns < end_ns;) {
        const int64_t smooth_ns = flight_plan_next_ns(&f->plan, t_ns);
        const int64_t to_ns = smooth_ns < end_ns ? smooth_ns : end_ns;
        if (!cross_smooth(f, t_ns, to_ns, at, e)) return false;
        t_ns = to_ns;
    }
    return true;
}

/* ---- between nodes */

static unsigned node_at(const struct flight *f, int64_t t_ns)
{
    unsigned low = 0, high = f->nodes;
    while (high - low > 1) {
        const unsigned middle = (low + high) / 2;
        if (f->node[middle].t_ns <= t_ns) low = middle;
        else high = middle;
    }
    return low;
}

/* The quintic through value and two derivatives at both ends of an interval of h seconds, as a + its rise. */
static double hermite_at(const double a[3], const double b[3], double h, double s)
{
    const double r = s * s * s;
    const double by_value = r * (10.0 + s * (-15.0 + 6.0 * s)) * (b[0] - a[0]);
    const double by_rate =
        h * (s * a[1] + r * ((-6.0 + s * (8.0 - 3.0 * s)) * a[1] + (-4.0 + s * (7.0 - 3.0 * s)) * b[1]));
    const double by_accel =
        0.5 * h * h * (s * s * a[2] + r * ((-3.0 + s * (3.0 - s)) * a[2] + (1.0 + s * (-2.0 + s)) * b[2]));
    return a[0] + (by_value + by_rate + by_accel);
}

void path_at(const struct flight *f, int64_t t_ns, struct path *p)
{
    const unsigned i = node_at(f, t_ns);
    const struct flight_node *a = &f->node[i];
    move_path(&f->plan, t_ns, p);
    if (i + 1 == f->nodes) {
        place_path(p, a->lat[0], a->lon[0]);
        return;
    }
    const struct flight_node *b = a + 1;
    const double h = sched_since_s(a->t_ns, b->t_ns), s = sched_since_s(a->t_ns, t_ns) / h;
    place_path(p, hermite_at(a->lat, b->lat, h, s), hermite_at(a->lon, b->lon, h, s));
}

/* The aircraft against numerical differentiation, its own limits, any order of calls; lists that cannot be flown; the altimeter. */
#include "rig.h"
#include "site.h"

#include "base/detmath.h"
#include "base/rng.h"
#include "phys/flight/ellipsoid.h"
#include "phys/flight/increment.h"

#include <math.h>
#include <string.h>

#define MS    INT64_C(1000000)
#define S     (1000 * MS)
#define FIELD 150.0

static struct flight_leg leg(enum flight_leg_kind kind, double value)
{
    return flight_leg_of(kind, value);
}

static struct flight_leg with(struct flight_leg l, enum flight_param p, double value)
{
    l.param[p] = value;
    return l;
}

/* Every kind, every channel at work. */
static struct flight_cfg tour(void)
{
    struct flight_cfg c = flight_default();
    const struct flight_leg legs[] = {
        with(with(leg(FLIGHT_PARK, 30.0), FLIGHT_ROLL_DEG, 0.3), FLIGHT_PITCH_DEG, 0.1),
        leg(FLIGHT_TAXI, 200.0),
        leg(FLIGHT_TURN, 90.0),
        leg(FLIGHT_STOP, 10.0),
        with(leg(FLIGHT_TAXI, 60.0), FLIGHT_SPEED_MPS, 5.0),
        leg(FLIGHT_TURN, -90.0),
        leg(FLIGHT_STOP, 5.0),
        leg(FLIGHT_TAKEOFF, 85.0),
        with(leg(FLIGHT_CLIMB, 900.0), FLIGHT_SPEED_MPS, 200.0),
        leg(FLIGHT_TURN, 100.0),
        with(leg(FLIGHT_SNAKE, 250.0), FLIGHT_PERIOD_S, 200.0),
        with(leg(FLIGHT_TURN, -40.0), FLIGHT_BANK_DEG, 45.0),
        with(leg(FLIGHT_FLY, 60.0), FLIGHT_SPEED_MPS, 150.0),
        with(leg(FLIGHT_DESCEND, 700.0), FLIGHT_SPEED_MPS, 100.0),
        leg(FLIGHT_LAND, 70.0),
        leg(FLIGHT_TURN, 90.0),
        leg(FLIGHT_STOP, 30.0),
    };
    c.present = true;
    c.plan.heading_deg = 40.0;
    c.plan.legs = COUNT(legs);
    memcpy(c.plan.leg, legs, sizeof legs);
    return c;
}

static void start(struct flight *f, const struct flight_cfg *c)
{
    struct flight_error e;
    const struct site site = site_at(55.7 * RAD_PER_DEG, FIELD, 0.0);
    if (!flight_init(f, c, &site, &e)) fail_msg("legs[%u].%s: %s", e.leg, e.key, e.text);
}

static const struct flight *toured(void)
{
    static struct flight f;
    static bool done;
    const struct flight_cfg c = tour();
    if (!done) start(&f, &c);
    done = true;
    return &f;
}

static int64_t end_ns(const struct flight *f)
{
    return f->plan.leg_ns[f->cfg.plan.legs];
}

static struct flight_state at(const struct flight *f, int64_t t_ns)
{
    struct flight_state s;
    flight_at(f, t_ns, &s);
    return s;
}

static void near(double got, double expected, double tol, const char *what, int64_t t_ns)
{
    if (!(fabs(got - expected) <= tol))
        fail_msg("%s at %.6f s: got %.12g, expected %.12g within %g", what, (double)t_ns / 1e9, got, expected, tol);
}

/* Sixth-order central difference: of a function that is smooth for 3 steps on either side. */
static double slope(const double v[6], double h_s)
{
    return (45.0 * (v[3] - v[2]) - 9.0 * (v[4] - v[1]) + (v[5] - v[0])) / (60.0 * h_s);
}

static const int steps[6] = {-3, -2, -1, 1, 2, 3};

/* Where a piece begins the differences see another polynomial. */
static bool smooth_about(const struct flight *f, int64_t t_ns, int64_t h_ns)
{
    return t_ns > 3 * h_ns && flight_smooth_ns(f, t_ns - 3 * h_ns - 1) > t_ns + 3 * h_ns;
}

/* d(lat, lon, h)/dt is the velocity; dv/dt the acceleration. */
static void place_and_velocity_are_integrals(void **state)
{
    (void)state;
    const struct flight *f = toured();
    const int64_t h_ns = 20 * MS;
    const double h_s = 0.02;
    unsigned taken = 0;
    for (int64_t t_ns = 61 * MS; t_ns < end_ns(f); t_ns += 137 * MS) {
        double lat[6], lon[6], up[6], v[3][6];
        if (!smooth_about(f, t_ns, h_ns)) continue;
        for (unsigned i = 0; i < 6; i++) {
            const struct flight_state s = at(f, t_ns + steps[i] * h_ns);
            lat[i] = s.lat_rad;
            lon[i] = s.lon_rad;
            up[i] = s.h_m;
            for (unsigned k = 0; k < 3; k++) v[k][i] = s.v_enu_mps[k];
        }
        const struct flight_state s = at(f, t_ns);
        const struct radii r = ellipsoid_radii(sin(s.lat_rad), cos(s.lat_rad));
        near(slope(lon, h_s) * (r.vertical_m + s.h_m) * cos(s.lat_rad), s.v_enu_mps[0], 4e-6, "east", t_ns);
        near(slope(lat, h_s) * (r.meridian_m + s.h_m), s.v_enu_mps[1], 4e-6, "north", t_ns);
        near(slope(up, h_s), s.v_enu_mps[2], 1e-8, "up", t_ns);
        for (unsigned k = 0; k < 3; k++) near(slope(v[k], h_s), s.a_enu_mps2[k], 1e-8, "acceleration", t_ns);
        taken++;
    }
    assert_true(taken > 5000);
}

/* Newton in axes that do not turn: second derivative of the place is gravitation and specific force. */
static void inertial_m(const struct flight_state *s, int64_t t_ns, double r_m[3], double C[3][3])
{
    const double lon = s->lon_rad + EARTH_RATE_RADPS * (double)t_ns / 1e9;
    const double cl = cos(s->lat_rad), sl = sin(s->lat_rad), co = cos(lon), so = sin(lon);
    const struct radii r = ellipsoid_radii(sl, cl);
    const double e2 = ELLIPSOID_FLATTENING * (2.0 - ELLIPSOID_FLATTENING);
    const double n = r.vertical_m + s->h_m;
    const double ned[3][3] = {{-sl * co, -so, -cl * co}, {-sl * so, co, -cl * so}, {cl, 0.0, -sl}};
    r_m[0] = n * cl * co;
    r_m[1] = n * cl * so;
    r_m[2] = (r.vertical_m * (1.0 - e2) + s->h_m) * sl;
    memcpy(C, ned, sizeof ned);
}

static void force_is_newton_s_in_inertial_space(void **state)
{
    (void)state;
    const struct flight *f = toured();
    static const double weight[7] = {2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0}; /* by 180 h^2 */
    const int64_t h_ns = 100 * MS;
    for (int64_t t_ns = S; t_ns < end_ns(f); t_ns += 317 * MS) {
        double r_m[3], C[3][3], a_i[3] = {0.0, 0.0, 0.0}, f_n[3], f_b[3];
        if (!smooth_about(f, t_ns, h_ns)) continue;
        for (int i = 0; i < 7; i++) {
            const struct flight_state s = at(f, t_ns + (i - 3) * h_ns);
            inertial_m(&s, t_ns + (i - 3) * h_ns, r_m, C);
            for (unsigned k = 0; k < 3; k++) a_i[k] += weight[i] / 1.8 * r_m[k];
        }
        const struct flight_state s = at(f, t_ns);
        inertial_m(&s, t_ns, r_m, C);
        const double w2 = EARTH_RATE_RADPS * EARTH_RATE_RADPS;
        for (unsigned k = 0; k < 2; k++) a_i[k] += w2 * r_m[k]; /* gravity has the centrifugal part in it */
        for (unsigned k = 0; k < 3; k++) f_n[k] = C[0][k] * a_i[0] + C[1][k] * a_i[1] + C[2][k] * a_i[2];
        f_n[2] -= earth_gravity_mps2(s.lat_rad, s.h_m);
        pose_into(&s.pose, f_n, f_b);
        for (unsigned k = 0; k < 3; k++) near(s.f_b_mps2[k], f_b[k], 1e-4, "force", t_ns);
    }
}

/* The attitudes of two instants against the rate between them, and the rate's derivative by differences. */
static void rate_is_the_attitude_s(void **state)
{
    (void)state;
    const struct flight *f = toured();
    for (int64_t t_ns = S; t_ns < end_ns(f); t_ns += 211 * MS) {
        double turn[3], angle[3], speed[3], w[3][6];
        flight_turn(f, t_ns, t_ns + MS, turn);
        flight_increment(f, t_ns, t_ns + MS, angle, speed);
        for (unsigned k = 0; k < 3; k++) near(turn[k], angle[k], 2e-9, "turn in 1 ms", t_ns);
        flight_increment(f, t_ns, t_ns + 80 * MS, turn, speed);
        for (unsigned i = 0; i < 8; i++) {
            double part[3], speed_part[3];
            flight_increment(f, t_ns + i * 10 * MS, t_ns + (i + 1) * 10 * MS, part, speed_part);
            for (unsigned k = 0; k < 3; k++) turn[k] -= part[k];
            for (unsigned k = 0; k < 3; k++) speed[k] -= speed_part[k];
        }
        for (unsigned k = 0; k < 3; k++) near(turn[k], 0.0, 1e-12, "angle in parts", t_ns);
        for (unsigned k = 0; k < 3; k++) near(speed[k], 0.0, 1e-9, "speed in parts", t_ns);
        if (!smooth_about(f, t_ns, 4 * MS)) continue;
        for (unsigned i = 0; i < 6; i++) {
            const struct flight_state s = at(f, t_ns + steps[i] * 4 * MS);
            for (unsigned k = 0; k < 3; k++) w[k][i] = s.pose.w_ib_b_radps[k];
        }
        const struct flight_state s = at(f, t_ns);
        for (unsigned k = 0; k < 3; k++)
            near(slope(w[k], 0.004), s.pose.dw_ib_b_radps2[k], 2e-10, "angular acceleration", t_ns);
    }
}

/* At every cut: nothing jumps, the acceleration neither; between cuts its derivative keeps the limit, and the bank's. */
static void jerk_keeps_its_limit(void **state)
{
    (void)state;
    const struct flight *f = toured();
    const double limit = f->cfg.plan.jerk_mps3;
    double most = 0.0, roll_most = 0.0;
    struct flight_state was = at(f, 0);
    for (int64_t t_ns = 8 * MS; t_ns < end_ns(f); t_ns += 8 * MS) {
        const struct flight_state s = at(f, t_ns);
        double square = 0.0;
        for (unsigned k = 0; k < 3; k++) square += pow((s.a_enu_mps2[k] - was.a_enu_mps2[k]) / 0.008, 2.0);
        most = fmax(most, sqrt(square));
        if (f->cfg.plan.leg[s.leg].kind == FLIGHT_TURN)
            roll_most = fmax(roll_most, fabs(s.roll_rad - was.roll_rad) / 0.008);
        was = s;
    }
    assert_true(most <= limit && most > 0.45 * limit); /* of each component at most half */
    near(roll_most / RAD_PER_DEG, f->cfg.plan.roll_rate_dps, 0.8, "largest rate of bank", 0);
}

static void nothing_jumps(void **state)
{
    (void)state;
    const struct flight *f = toured();
    unsigned cuts = 0;
    for (int64_t t_ns = flight_smooth_ns(f, 0); t_ns < INT64_MAX; t_ns = flight_smooth_ns(f, t_ns), cuts++) {
        const struct flight_state a = at(f, t_ns - 1), b = at(f, t_ns + 1);
        near(a.h_m, b.h_m, 1e-7, "height", t_ns);
        near(a.pitch_rad, b.pitch_rad, 1e-8, "pitch", t_ns);
        near(a.roll_rad, b.roll_rad, 1e-8, "roll", t_ns);
        for (unsigned k = 0; k < 3; k++) {
            near(a.v_enu_mps[k], b.v_enu_mps[k], 1e-7, "velocity", t_ns);
            near(a.a_enu_mps2[k], b.a_enu_mps2[k], 1e-7, "acceleration", t_ns);
            near(a.f_b_mps2[k], b.f_b_mps2[k], 1e-7, "force", t_ns);
            near(a.pose.w_ib_b_radps[k], b.pose.w_ib_b_radps[k], 1e-7, "rate", t_ns);
            near(a.pose.dw_ib_b_radps2[k], b.pose.dw_ib_b_radps2[k], 1e-7, "angular acceleration", t_ns);
        }
    }
    assert_true(cuts > 60);
}

/* In flight it is banked as its turn asks: next to no force across; the nose above the path by the angle of attack. */
static void turns_are_coordinated(void **state)
{
    (void)state;
    const struct flight *f = toured();
    double bank = 0.0;
    for (int64_t t_ns = f->plan.leg_ns[9]; t_ns < f->plan.leg_ns[13]; t_ns += 100 * MS) {
        const struct flight_state s = at(f, t_ns);
        const double u = hypot(s.v_enu_mps[0], s.v_enu_mps[1]);
        assert_true(fabs(s.f_b_mps2[1]) < 0.15); /* Coriolis 2 u v, g by latitude, g of coordination */
        near(s.pitch_rad, atan2(s.v_enu_mps[2], u) + 4.0 * RAD_PER_DEG, 1e-12, "pitch", t_ns);
        bank = fmax(bank, fabs(s.roll_rad));
    }
    near(bank / RAD_PER_DEG, 45.0, 0.01, "bank", 0);
}

static void it_begins_and_ends_at_rest(void **state)
{
    (void)state;
    const struct flight *f = toured();
    const struct flight_state a = at(f, 0), z = at(f, end_ns(f)), later = at(f, end_ns(f) + 3600 * S);
    const double g = earth_gravity_mps2(55.7 * RAD_PER_DEG, FIELD);
    near(a.f_b_mps2[2], -g, 1e-14, "force", 0);
    near(a.pose.w_ib_b_radps[0], EARTH_RATE_RADPS * cos(55.7 * RAD_PER_DEG) * cos(40.0 * RAD_PER_DEG), 1e-18, "rate",
         0);
    near(z.h_m, FIELD, 1e-9, "height", end_ns(f));
    near(z.heading_rad / RAD_PER_DEG, 40.0 + 90 - 90 + 100 - 40 + 90 - 360, 1e-9, "heading", end_ns(f));
    for (unsigned k = 0; k < 3; k++) near(z.v_enu_mps[k], 0.0, 1e-12, "velocity", end_ns(f));
    assert_true(z.lat_rad == later.lat_rad && z.lon_rad == later.lon_rad);
    assert_true(at(f, end_ns(f) - 1).leg == 16 && later.leg == 16);
}

static void any_order_of_calls_gives_the_same_bits(void **state)
{
    (void)state;
    enum { N = 500 };
    static struct flight_state first[N];
    const struct flight *f = toured();
    static struct flight again;
    const struct flight_cfg c = tour();
    struct rng r = rng_stream(rig_seed(1), 0, "order");
    int64_t t_ns[N];
    memset(&again, 0xA5, sizeof again);
    start(&again, &c);
    for (unsigned i = 0; i < N; i++) {
        t_ns[i] = (int64_t)(rng_uniform(&r) * (double)end_ns(f));
        first[i] = at(f, t_ns[i]);
    }
    for (unsigned i = N; i-- > 0;) {
        const struct flight_state s = at(&again, t_ns[i]);
        assert_memory_equal(s.f_b_mps2, first[i].f_b_mps2, sizeof s.f_b_mps2);
        assert_memory_equal(&s.pose, &first[i].pose, sizeof s.pose);
        assert_true(s.lat_rad == first[i].lat_rad && s.lon_rad == first[i].lon_rad && s.h_m == first[i].h_m);
    }
}

/* Gravity of a site that is not the ellipsoid's goes along. */
static void the_site_s_gravity_is_kept(void **state)
{
    (void)state;
    static struct flight f;
    struct flight_error e;
    const struct flight_cfg c = tour();
    struct site site = site_at(0.9, FIELD, 0.0);
    site.g_mps2 = 9.8;
    assert_true(flight_init(&f, &c, &site, &e));
    near(at(&f, 0).f_b_mps2[2], -9.8, 1e-14, "force", 0);
}

/* Short and long ones, each limit the one that binds: kept everywhere, reached somewhere. */
static void ramps_keep_their_limits(void **state)
{
    (void)state;
    static struct channel c;
    const double reach[] = {0.01, 1.0, 100.0}, limit[] = {0.5, 3.0, 40.0};
    for (unsigned i = 0; i < 81; i++) {
        const struct ramp_limits l = {limit[i / 3 % 3], limit[i / 9 % 3], limit[i / 27]};
        const double by = (i % 2 ? -1.0 : 1.0) * reach[i % 3];
        const struct ramp r = ramp_plan(by, &l);
        double most[3] = {0.0, 0.0, 0.0};
        channel_init(&c, 5.0);
        channel_ramp(&c, &r, S);
        for (int64_t t_ns = S; t_ns <= S + ramp_ns(&r); t_ns += ramp_ns(&r) / 4096) {
            const struct jet j = channel_at(&c, t_ns);
            most[0] = fmax(most[0], fabs(j.d1) / l.rate);
            most[1] = fmax(most[1], fabs(j.d2) / l.first);
            most[2] = fmax(most[2], fabs(j.d3) / l.second);
        }
        const double nearest = fmax(most[0], fmax(most[1], most[2]));
        if (nearest > 1.0 + 1e-9 || (nearest < 0.9 && r.rise_ns > 60 * MS))
            fail_msg("ramp %u: %g of a limit", i, nearest);
        near(channel_at(&c, S + ramp_ns(&r)).at, 5.0 + by, 1e-14 * 100.0, "end of a ramp", i);
        near(channel_at(&c, S + ramp_ns(&r) - 1).at, 5.0 + by, 1e-12, "before its end", i);
    }
}

/* ---- altimeter */

/* The equation of the lag, integrated in steps. */
static void altimeter_lags_and_drifts(void **state)
{
    (void)state;
    static struct flight f;
    struct flight_cfg c = tour();
    c.baro = (struct baro_cfg){.lag_s = 2.0, .scale_ppm = 1000.0, .offset_m = 10.0, .drift_m_per_h = 36.0};
    start(&f, &c);
    const double dt = 0.01;
    double y = FIELD, most = 0.0;
    for (int64_t t_ns = 0; t_ns < end_ns(&f); t_ns += 10 * MS) {
        const double shown = (1.001 * y) + 10.0 + 0.01 * (double)t_ns / 1e9;
        near(flight_baro_m(&f, t_ns), shown, 2e-4, "shown height", t_ns);
        most = fmax(most, fabs(y - at(&f, t_ns).h_m));
        const double a = (at(&f, t_ns).h_m - y) / 2.0, half = at(&f, t_ns + 5 * MS).h_m;
        y += dt * (half - (y + 0.5 * dt * a)) / 2.0;
    }
    near(most, 20.0, 0.1, "lag at 10 m/s", 0);
    c.baro = (struct baro_cfg){0};
    start(&f, &c);
    near(flight_baro_m(&f, f.plan.leg_ns[9] - 3 * S), at(&f, f.plan.leg_ns[9] - 3 * S).h_m, 0.0, "without", 0);
}

/* ---- lists that cannot be flown */

static void wrong(const struct flight_leg *legs, unsigned n, unsigned where, const char *text)
{
    static struct flight f;
    struct flight_error e = {.leg = 99};
    const struct site site = site_at(55.7 * RAD_PER_DEG, FIELD, 0.0);
    struct flight_cfg c = flight_default();
    c.plan.legs = n;
    memcpy(c.plan.leg, legs, n * sizeof *legs);
    assert_false(flight_init(&f, &c, &site, &e));
    assert_string_equal(e.text, text);
    assert_int_equal(e.leg, where);
}

#define WRONG(where, text, ...)                                                                                        \
    wrong((const struct flight_leg[]){__VA_ARGS__}, COUNT(((const struct flight_leg[]){__VA_ARGS__})), where, text)

static void a_list_that_cannot_be_flown_is_an_error(void **state)
{
    (void)state;
    const struct flight_leg roll = leg(FLIGHT_TAXI, 100.0), up = leg(FLIGHT_TAKEOFF, 80.0);
    WRONG(1, "expected an aircraft at rest (a stop_s before it), got one at 8 m/s", roll, leg(FLIGHT_PARK, 10.0));
    WRONG(0, "expected up to half of park_s (2), got 3", with(leg(FLIGHT_PARK, 4.0), FLIGHT_ROLL_DEG, 0.1));
    WRONG(0, "expected 43 or more, the way to 8 m/s, got 40", leg(FLIGHT_TAXI, 40.0));
    WRONG(0, "expected 0.5 to 50 on the ground, got 0 (stop_s comes to rest)", with(roll, FLIGHT_SPEED_MPS, 0.0));
    WRONG(0, "expected 0.5 to 50 on the ground, got 60 (stop_s comes to rest)",
          with(leg(FLIGHT_TAXI, 9000.0), FLIGHT_SPEED_MPS, 60.0));
    WRONG(1, "expected 0.5 to 50 on the ground, got 0.1 (stop_s comes to rest)", up,
          with(leg(FLIGHT_LAND, 70.0), FLIGHT_SPEED_MPS, 0.1));
    WRONG(1, "expected 20 or more in flight, got 1", up, with(leg(FLIGHT_FLY, 900.0), FLIGHT_SPEED_MPS, 1.0));
    WRONG(1, "expected 20 or more in flight, got 1", up, with(leg(FLIGHT_CLIMB, 900.0), FLIGHT_SPEED_MPS, 1.0));
    WRONG(1, "expected an aircraft on the ground (a land_mps before it), got one in flight", up, roll);
    WRONG(1, "expected an aircraft on the ground (a land_mps before it), got one in flight", up, up);
    WRONG(1, "expected an aircraft on the ground (a land_mps before it), got one in flight", up, leg(FLIGHT_STOP, 1.0));
    WRONG(0, "expected an aircraft in flight (a takeoff_mps before it), got one on the ground",
          leg(FLIGHT_CLIMB, 100.0));
    WRONG(0, "expected an aircraft in flight (a takeoff_mps before it), got one on the ground",
          leg(FLIGHT_SNAKE, 900.0));
    WRONG(0, "expected an aircraft in flight (a takeoff_mps before it), got one on the ground", leg(FLIGHT_FLY, 90.0));
    WRONG(0, "expected an aircraft in flight (a takeoff_mps before it), got one on the ground", leg(FLIGHT_LAND, 70.0));
    WRONG(0, "expected a moving aircraft (a taxi_m before it), got one at rest", leg(FLIGHT_TURN, 90.0));
    WRONG(1, "expected 32 or more at 8 m/s, got 20", roll, with(leg(FLIGHT_TURN, 90.0), FLIGHT_RADIUS_M, 20.0));
    WRONG(1, "expected a turn whose jerk of 3.606 m/s3 is within 0.8 of jerk_mps3 4, got 60", up,
          with(leg(FLIGHT_TURN, 90.0), FLIGHT_BANK_DEG, 60.0));
    WRONG(2, "expected up to 100, the height above the field, got 200", up, leg(FLIGHT_CLIMB, 100.0),
          leg(FLIGHT_DESCEND, 200.0));
    WRONG(1, "expected 120.9 or more, the time to 200 m/s, got 20", up,
          with(leg(FLIGHT_FLY, 20.0), FLIGHT_SPEED_MPS, 200.0));
    WRONG(1, "expected period_s (600) or more, got 500", up, leg(FLIGHT_SNAKE, 500.0));
    WRONG(1, "expected a jerk of up to half of jerk_mps3 (2), got 17.64", up,
          with(with(leg(FLIGHT_SNAKE, 500.0), FLIGHT_PERIOD_S, 10.0), FLIGHT_AMPLITUDE_DEG, 10.0));
    WRONG(1, "expected a bank of up to 60 deg, got 66.33", up, with(leg(FLIGHT_SNAKE, 500.0), FLIGHT_PERIOD_S, 20.0));
    WRONG(0, "expected a last leg that ends at rest (stop_s), got 8 m/s", roll);
    WRONG(1, "expected a latitude within 85 deg, got a path towards a pole", up,
          with(leg(FLIGHT_FLY, 80000.0), FLIGHT_SPEED_MPS, 300.0), leg(FLIGHT_LAND, 70.0), leg(FLIGHT_STOP, 1.0));
    WRONG(2, "expected a shorter flight, got more turns than there is room for", up, leg(FLIGHT_TURN, 90.0),
          leg(FLIGHT_SNAKE, 60000.0), leg(FLIGHT_LAND, 70.0), leg(FLIGHT_STOP, 1.0));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(place_and_velocity_are_integrals),
        cmocka_unit_test(force_is_newton_s_in_inertial_space),
        cmocka_unit_test(rate_is_the_attitude_s),
        cmocka_unit_test(jerk_keeps_its_limit),
        cmocka_unit_test(nothing_jumps),
        cmocka_unit_test(turns_are_coordinated),
        cmocka_unit_test(it_begins_and_ends_at_rest),
        cmocka_unit_test(any_order_of_calls_gives_the_same_bits),
        cmocka_unit_test(the_site_s_gravity_is_kept),
        cmocka_unit_test(ramps_keep_their_limits),
        cmocka_unit_test(altimeter_lags_and_drifts),
        cmocka_unit_test(a_list_that_cannot_be_flown_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

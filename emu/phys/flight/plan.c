#include "phys/flight/plan.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#define G_MPS2            9.80665 /* of coordination: tan(bank) = speed * turn rate / g */
#define BOUNDLESS         1e12
#define VERTICAL_MPS2     1.5                 /* of a change of the rate of climb (E0) */
#define ROTATION_RADPS    (3.0 * RAD_PER_DEG) /* nose up and down again (E0) */
#define ROTATION_RADPS2   (3.0 * RAD_PER_DEG)
#define APPROACH_MPS2     1.0 /* of the change to the speed of touchdown (E0) */
#define TAXI_LATERAL_MPS2 2.0 /* in a turn on the ground (E0) */
#define TAXI_MIN_MPS      0.5 /* slower ones turn almost without end */
#define TAXI_MAX_MPS      50.0
#define FLY_MIN_MPS       20.0
#define SNAKE_ACCEL       3.2 /* largest d2 of a snake by A w^2, and */
#define SNAKE_RATE        1.7 /* largest d1 by A w, while the envelope rises over half a period */

#define BIT(p) (1u << (p))
#define CHANGE (BIT(FLIGHT_SPEED_MPS) | BIT(FLIGHT_ACCEL_MPS2))
#define SWAY   (BIT(FLIGHT_ROLL_DEG) | BIT(FLIGHT_ROLL_S) | BIT(FLIGHT_PITCH_DEG) | BIT(FLIGHT_PITCH_S))

// clang-format off
static const struct flight_kind kinds[FLIGHT_KINDS] = {
    [FLIGHT_PARK] = {"park_s", SWAY, {[FLIGHT_ROLL_S] = 3, [FLIGHT_PITCH_S] = 4}},
    [FLIGHT_TAXI] = {"taxi_m", CHANGE, {[FLIGHT_SPEED_MPS] = 8, [FLIGHT_ACCEL_MPS2] = 0.8}},
    [FLIGHT_STOP] = {"stop_s", BIT(FLIGHT_ACCEL_MPS2), {[FLIGHT_ACCEL_MPS2] = 1}},
    [FLIGHT_TURN] = {"turn_deg", BIT(FLIGHT_BANK_DEG) | BIT(FLIGHT_RADIUS_M), {[FLIGHT_BANK_DEG] = 25, [FLIGHT_RADIUS_M] = 40}},
    [FLIGHT_TAKEOFF] = {"takeoff_mps", BIT(FLIGHT_ACCEL_MPS2), {[FLIGHT_ACCEL_MPS2] = 4}},
    [FLIGHT_CLIMB] = {"climb_m", CHANGE | BIT(FLIGHT_RATE_MPS), {[FLIGHT_ACCEL_MPS2] = 1, [FLIGHT_RATE_MPS] = 10}},
    [FLIGHT_DESCEND] = {"descend_m", CHANGE | BIT(FLIGHT_RATE_MPS), {[FLIGHT_ACCEL_MPS2] = 1, [FLIGHT_RATE_MPS] = 8}},
    [FLIGHT_FLY] = {"fly_s", CHANGE, {[FLIGHT_ACCEL_MPS2] = 1}},
    [FLIGHT_SNAKE] = {"snake_s", BIT(FLIGHT_AMPLITUDE_DEG) | BIT(FLIGHT_PERIOD_S), {[FLIGHT_AMPLITUDE_DEG] = 30, [FLIGHT_PERIOD_S] = 600}},
    [FLIGHT_LAND] = {"land_mps", CHANGE | BIT(FLIGHT_RATE_MPS), {[FLIGHT_SPEED_MPS] = 8, [FLIGHT_ACCEL_MPS2] = 2.5, [FLIGHT_RATE_MPS] = 4}},
};
// clang-format on

const struct flight_kind *flight_kind(enum flight_leg_kind kind)
{
    return &kinds[kind];
}

struct flight_leg flight_leg_of(enum flight_leg_kind kind, double value)
{
    struct flight_leg l = {.kind = kind, .value = value};
    for (unsigned i = 0; i < FLIGHT_PARAMS; i++) l.param[i] = kinds[kind].standard[i];
    return l;
}

/* ---- what is built, leg by leg */

struct builder {
    struct flight_plan *p;
    struct flight_error *e;
    unsigned leg;
    int64_t t_ns;
    double speed_mps, height_m; /* at t_ns; the aircraft is level, on a straight track */
    double field_m;
    bool airborne;
};

__attribute__((format(printf, 3, 4))) static bool fail_leg(struct builder *b, const char *key, const char *format, ...)
{
    va_list ap;
    va_start(ap, format);
    vsnprintf(b->e->text, sizeof b->e->text, format, ap);
    va_end(ap);
    b->e->leg = b->leg;
    b->e->key = key ? key : kinds[b->p->cfg.leg[b->leg].kind].key;
    return false;
}

/* Half of the jerk for each of the two components that change at a time. */
static double half_jerk(const struct builder *b)
{
    return 0.5 * b->p->cfg.jerk_mps3;
}

static struct ramp speed_ramp(const struct builder *b, double to_mps, double accel_mps2)
{
    return ramp_plan(to_mps - b->speed_mps, &(struct ramp_limits){accel_mps2, half_jerk(b), BOUNDLESS});
}

static struct ramp height_ramp(const struct builder *b, double by_m, double rate_mps)
{
    return ramp_plan(by_m, &(struct ramp_limits){rate_mps, VERTICAL_MPS2, half_jerk(b)});
}

static double mean_mps(const struct builder *b, double to_mps)
{
    return 0.5 * (b->speed_mps + to_mps);
}

static void change_speed(struct builder *b, const struct ramp *r)
{
    channel_ramp(&b->p->speed_mps, r, b->t_ns);
    b->speed_mps += r->by;
    if (fabs(b->speed_mps) < 1e-9) b->speed_mps = 0.0;
}

static void change_height(struct builder *b, const struct ramp *r)
{
    channel_ramp(&b->p->height_m, r, b->t_ns);
    b->height_m += r->by;
}

static int64_t longer_ns(const struct ramp *a, const struct ramp *b)
{
    return ramp_ns(a) > ramp_ns(b) ? ramp_ns(a) : ramp_ns(b);
}

static int64_t whole_ns(double t_s)
{
    return (int64_t)nearbyint(t_s * 1e3) * (NS_PER_S / 1000);
}

static double ramp_s(const struct ramp *r)
{
    return sched_since_s(0, ramp_ns(r));
}

static void turn_nose(struct builder *b, double by_rad)
{
    const struct ramp r = ramp_plan(by_rad, &(struct ramp_limits){ROTATION_RADPS, ROTATION_RADPS2, BOUNDLESS});
    channel_ramp(&b->p->attack_rad, &r, b->t_ns);
    b->t_ns += ramp_ns(&r);
}

static void add_swing(struct builder *b, enum swing_of of, double amplitude_deg, double period_s, int64_t ns,
                      int64_t edge_ns)
{
    if (amplitude_deg == 0.0) return;
    b->p->swing[b->p->swings++] =
        (struct swing){of, b->t_ns, b->t_ns + ns, edge_ns, amplitude_deg * RAD_PER_DEG, period_s};
}

/* ---- what a leg needs */

static bool at_rest(struct builder *b)
{
    return (!b->airborne && b->speed_mps == 0.0) ||
           fail_leg(b, NULL, "expected an aircraft at rest (a stop_s before it), got one at %.10g m/s", b->speed_mps);
}

static bool on_ground(struct builder *b)
{
    return !b->airborne ||
           fail_leg(b, NULL, "expected an aircraft on the ground (a land_mps before it), got one in flight");
}

static bool in_flight(struct builder *b)
{
    return b->airborne ||
           fail_leg(b, NULL, "expected an aircraft in flight (a takeoff_mps before it), got one on the ground");
}

static bool speed_taxies(struct builder *b, double speed_mps)
{
    return (speed_mps >= TAXI_MIN_MPS && speed_mps <= TAXI_MAX_MPS) ||
           fail_leg(b, "speed_mps", "expected %g to %g on the ground, got %.10g (stop_s comes to rest)", TAXI_MIN_MPS,
                    TAXI_MAX_MPS, speed_mps);
}

static bool speed_flies(struct builder *b, double speed_mps)
{
    return speed_mps >= FLY_MIN_MPS ||
           fail_leg(b, "speed_mps", "expected %g or more in flight, got %.10g", FLY_MIN_MPS, speed_mps);
}

/* ---- legs */

static bool sway_fits(struct builder *b, const struct flight_leg *l, enum flight_param amplitude,
                      enum flight_param period, const char *key)
{
    return l->param[amplitude] == 0.0 || 2.0 * l->param[period] <= l->value ||
           fail_leg(b, key, "expected up to half of park_s (%.10g), got %.10g", 0.5 * l->value, l->param[period]);
}

static bool make_park(struct builder *b, const struct flight_leg *l)
{
    const double *p = l->param;
    const int64_t ns = whole_ns(l->value);
    if (!at_rest(b) || !sway_fits(b, l, FLIGHT_ROLL_DEG, FLIGHT_ROLL_S, "roll_s") ||
        !sway_fits(b, l, FLIGHT_PITCH_DEG, FLIGHT_PITCH_S, "pitch_s"))
        return false;
    add_swing(b, SWING_ROLL, p[FLIGHT_ROLL_DEG], p[FLIGHT_ROLL_S], ns, whole_ns(p[FLIGHT_ROLL_S]));
    add_swing(b, SWING_PITCH, p[FLIGHT_PITCH_DEG], p[FLIGHT_PITCH_S], ns, whole_ns(p[FLIGHT_PITCH_S]));
    b->t_ns += ns;
    return true;
}

static bool make_taxi(struct builder *b, const struct flight_leg *l)
{
    const double to_mps = l->param[FLIGHT_SPEED_MPS];
    const struct ramp r = speed_ramp(b, to_mps, l->param[FLIGHT_ACCEL_MPS2]);
    const double least_m = mean_mps(b, to_mps) * ramp_s(&r);
    if (!on_ground(b)) return false;
    if (!speed_taxies(b, to_mps)) return false;
    if (l->value < least_m)
        return fail_leg(b, NULL, "expected %.4g or more, the way to %.10g m/s, got %.10g", least_m, to_mps, l->value);
    change_speed(b, &r);
    b->t_ns += ramp_ns(&r) + whole_ns((l->value - least_m) / to_mps);
    return true;
}

static bool make_stop(struct builder *b, const struct flight_leg *l)
{
    const struct ramp r = speed_ramp(b, 0.0, l->param[FLIGHT_ACCEL_MPS2]);
    if (!on_ground(b)) return false;
    change_speed(b, &r);
    b->t_ns += ramp_ns(&r) + whole_ns(l->value);
    return true;
}

/* Rate of the turn; 0, with the error: too steep. */
static double turn_radps(struct builder *b, const struct flight_leg *l)
{
    const double v = b->speed_mps, jerk = b->p->cfg.jerk_mps3;
    const double bank_rad = l->param[FLIGHT_BANK_DEG] * RAD_PER_DEG;
    const double radius_m = l->param[FLIGHT_RADIUS_M], least_m = v * v / TAXI_LATERAL_MPS2;
    if (!b->airborne && radius_m < least_m)
        return (double)fail_leg(b, "radius_m", "expected %.4g or more at %.10g m/s, got %.10g", least_m, v, radius_m);
    const double rate = b->airborne ? G_MPS2 * det_sin(bank_rad) / det_cos(bank_rad) / v : v / radius_m;
    if (v * rate * rate > 0.8 * jerk)
        return (double)fail_leg(b, b->airborne ? "bank_deg" : "radius_m",
                                "expected a turn whose jerk of %.4g m/s3 is within 0.8 of jerk_mps3 %.10g, got %.10g",
                                v * rate * rate, jerk, l->param[b->airborne ? FLIGHT_BANK_DEG : FLIGHT_RADIUS_M]);
    return rate;
}

static bool make_turn(struct builder *b, const struct flight_leg *l)
{
    if (b->speed_mps == 0.0)
        return fail_leg(b, NULL, "expected a moving aircraft (a taxi_m before it), got one at rest");
    const double rate = turn_radps(b, l);
    if (rate == 0.0) return false;
    const double roll_radps = b->airborne ? b->p->cfg.roll_rate_dps * RAD_PER_DEG : BOUNDLESS;
    const double accel = fmin(half_jerk(b), G_MPS2 * roll_radps) / b->speed_mps;
    const struct ramp r = ramp_plan(l->value * RAD_PER_DEG, &(struct ramp_limits){rate, accel, BOUNDLESS});
    channel_ramp(&b->p->track_rad, &r, b->t_ns);
    b->t_ns += ramp_ns(&r);
    return true;
}

static bool make_takeoff(struct builder *b, const struct flight_leg *l)
{
    const struct ramp r = speed_ramp(b, l->value, l->param[FLIGHT_ACCEL_MPS2]);
    if (!on_ground(b)) return false;
    change_speed(b, &r);
    b->t_ns += ramp_ns(&r);
    turn_nose(b, b->p->cfg.angle_of_attack_deg * RAD_PER_DEG);
    b->airborne = true;
    return true;
}

/* Height and speed change together; the leg lasts as long as the longer. */
static bool change_both(struct builder *b, const struct flight_leg *l, double by_m)
{
    const double asked_mps = l->param[FLIGHT_SPEED_MPS], to_mps = asked_mps > 0.0 ? asked_mps : b->speed_mps;
    const struct ramp up = height_ramp(b, by_m, l->param[FLIGHT_RATE_MPS]);
    const struct ramp faster = speed_ramp(b, to_mps, l->param[FLIGHT_ACCEL_MPS2]);
    if (!speed_flies(b, to_mps)) return false;
    change_height(b, &up);
    change_speed(b, &faster);
    b->t_ns += longer_ns(&up, &faster);
    return true;
}

static bool make_climb(struct builder *b, const struct flight_leg *l)
{
    return in_flight(b) && change_both(b, l, l->value);
}

static bool make_descend(struct builder *b, const struct flight_leg *l)
{
    const double most_m = b->height_m - b->field_m;
    if (!in_flight(b)) return false;
    if (l->value > most_m)
        return fail_leg(b, NULL, "expected up to %.10g, the height above the field, got %.10g", most_m, l->value);
    return change_both(b, l, -l->value);
}

static bool make_fly(struct builder *b, const struct flight_leg *l)
{
    const double asked_mps = l->param[FLIGHT_SPEED_MPS], to_mps = asked_mps > 0.0 ? asked_mps : b->speed_mps;
    const struct ramp r = speed_ramp(b, to_mps, l->param[FLIGHT_ACCEL_MPS2]);
    if (!in_flight(b)) return false;
    if (!speed_flies(b, to_mps)) return false;
    if (l->value < ramp_s(&r))
        return fail_leg(b, NULL, "expected %.4g or more, the time to %.10g m/s, got %.10g", ramp_s(&r), to_mps,
                        l->value);
    change_speed(b, &r);
    b->t_ns += whole_ns(l->value);
    return true;
}

static bool make_snake(struct builder *b, const struct flight_leg *l)
{
    const double period_s = l->param[FLIGHT_PERIOD_S], amplitude_deg = l->param[FLIGHT_AMPLITUDE_DEG];
    const double w = TURN_RAD / period_s, swing_radps = amplitude_deg * RAD_PER_DEG * w;
    const double jerk_mps3 = b->speed_mps * swing_radps * w * SNAKE_ACCEL;
    const double bank_rad = det_atan2(b->speed_mps * swing_radps * SNAKE_RATE, G_MPS2);
    if (!in_flight(b)) return false;
    if (l->value < period_s)
        return fail_leg(b, NULL, "expected period_s (%.10g) or more, got %.10g", period_s, l->value);
    if (bank_rad > FLIGHT_BANK_MAX_DEG * RAD_PER_DEG)
        return fail_leg(b, "amplitude_deg", "expected a bank of up to %g deg, got %.4g", FLIGHT_BANK_MAX_DEG,
                        bank_rad / RAD_PER_DEG);
    if (jerk_mps3 > half_jerk(b))
        return fail_leg(b, "period_s", "expected a jerk of up to half of jerk_mps3 (%.10g), got %.4g", half_jerk(b),
                        jerk_mps3);
    const int64_t ns = whole_ns(l->value);
    add_swing(b, SWING_TRACK, amplitude_deg, period_s, ns, whole_ns(0.5 * period_s));
    b->t_ns += ns;
    return true;
}

/* Approach, touchdown without a bump, nose down, brakes. */
static bool make_land(struct builder *b, const struct flight_leg *l)
{
    const struct ramp down = height_ramp(b, b->field_m - b->height_m, l->param[FLIGHT_RATE_MPS]);
    const struct ramp slower = speed_ramp(b, l->value, APPROACH_MPS2);
    if (!in_flight(b) || (l->param[FLIGHT_SPEED_MPS] > 0.0 && !speed_taxies(b, l->param[FLIGHT_SPEED_MPS])))
        return false;
    change_height(b, &down);
    change_speed(b, &slower);
    b->t_ns += longer_ns(&down, &slower);
    b->height_m = b->field_m;
    turn_nose(b, -b->p->cfg.angle_of_attack_deg * RAD_PER_DEG);
    const struct ramp brake = speed_ramp(b, l->param[FLIGHT_SPEED_MPS], l->param[FLIGHT_ACCEL_MPS2]);
    change_speed(b, &brake);
    b->t_ns += ramp_ns(&brake);
    b->airborne = false;
    return true;
}

static bool (*const make[FLIGHT_KINDS])(struct builder *b, const struct flight_leg *l) = {
    [FLIGHT_PARK] = make_park,       [FLIGHT_TAXI] = make_taxi,       [FLIGHT_STOP] = make_stop,
    [FLIGHT_TURN] = make_turn,       [FLIGHT_TAKEOFF] = make_takeoff, [FLIGHT_CLIMB] = make_climb,
    [FLIGHT_DESCEND] = make_descend, [FLIGHT_FLY] = make_fly,         [FLIGHT_SNAKE] = make_snake,
    [FLIGHT_LAND] = make_land};

bool flight_plan_make(struct flight_plan *p, const struct flight_plan_cfg *cfg, double height_m, struct flight_error *e)
{
    struct builder b = {.p = p, .e = e, .height_m = height_m, .field_m = height_m};
    p->cfg = *cfg;
    p->swings = 0;
    channel_init(&p->speed_mps, 0.0);
    channel_init(&p->height_m, height_m);
    channel_init(&p->track_rad, cfg->heading_deg * RAD_PER_DEG);
    channel_init(&p->attack_rad, 0.0);
    for (b.leg = 0; b.leg < cfg->legs; b.leg++) {
        p->leg_ns[b.leg] = b.t_ns;
        p->banked[b.leg] = b.airborne;
        if (!make[cfg->leg[b.leg].kind](&b, &cfg->leg[b.leg])) return false;
    }
    p->leg_ns[cfg->legs] = b.t_ns;
    if (cfg->legs) b.leg = cfg->legs - 1;
    return b.speed_mps == 0.0 ||
           fail_leg(&b, NULL, "expected a last leg that ends at rest (stop_s), got %.10g m/s", b.speed_mps);
}

/* ---- questions */

unsigned flight_plan_leg(const struct flight_plan *p, int64_t t_ns)
{
    unsigned low = 0, high = p->cfg.legs;
    while (high - low > 1) {
        const unsigned middle = (low + high) / 2;
        if (p->leg_ns[middle] <= t_ns) low = middle;
        else high = middle;
    }
    return low;
}

static int64_t earlier_ns(int64_t a_ns, int64_t b_ns)
{
    return a_ns < b_ns ? a_ns : b_ns;
}

int64_t flight_plan_next_ns(const struct flight_plan *p, int64_t t_ns)
{
    enum { CHANNELS = 4 };
    const struct channel *const all[CHANNELS] = {&p->speed_mps, &p->height_m, &p->track_rad, &p->attack_rad};
    int64_t next_ns = INT64_MAX;
    for (unsigned i = 0; i < CHANNELS; i++) next_ns = earlier_ns(next_ns, channel_next_ns(all[i], t_ns));
    for (unsigned i = 0; i < p->swings; i++) next_ns = earlier_ns(next_ns, swing_next_ns(&p->swing[i], t_ns));
    return next_ns;
}

struct jet flight_plan_swing(const struct flight_plan *p, enum swing_of of, int64_t t_ns)
{
    struct jet sum = {0};
    for (unsigned i = 0; i < p->swings; i++) {
        const struct swing *s = &p->swing[i];
        if (s->of != of || t_ns <= s->from_ns || t_ns >= s->to_ns) continue;
        const struct jet j = swing_at(s, t_ns);
        sum = (struct jet){sum.at + j.at, sum.d1 + j.d1, sum.d2 + j.d2, sum.d3 + j.d3};
    }
    return sum;
}

/* Modes, turns, settling, windows; and the rates that follow from them. */
#include "board/gyro/internal.h"

#include "base/detmath.h"

#include <math.h>

#define RADPS_PER_DPH (RAD_PER_DEG / 3600.0)
#define TURN_MARGIN   0.9 /* of the torquers' limit: the rest is for the servo */
#define MEAN_NS       1000000000

static int64_t ns_of(double s)
{
    return (int64_t)(s * 1e9 + 0.5);
}

static void enter_phase(struct gyro *b, enum gyro_phase phase, int64_t t_ns)
{
    b->run.phase = phase;
    b->run.phase_ns = t_ns;
    b->run.servo_radps = 0.0;
    b->run.servo_steps = 0;
}

bool gyro_running(const struct gyro *b)
{
    return b->run.mode == GYRO_COMPASS || b->run.mode == GYRO_CALIBRATE;
}

void gyro_run_stop(struct gyro *b, enum gyro_mode mode)
{
    b->run.mode = mode;
    b->run.phase = GYRO_IDLE;
    b->run.position = 0;
    b->run.servoed = mode == GYRO_HOLD;
}

/* ---- a new mode ---- */

static void begin_turn(struct gyro *b, double to_deg, int64_t t_ns)
{
    const double limit_radps = TURN_MARGIN * b->profile.torquer_limit_dps * RAD_PER_DEG;
    b->run.turn = gyro_turn_of(b->run.q_ref_rad, to_deg * RAD_PER_DEG, fmin(b->set.slew_dps * RAD_PER_DEG, limit_radps),
                               b->set.slew_dps2 * RAD_PER_DEG, t_ns);
    if (b->base.io.platform) b->base.io.platform->reposition(b->base.io.ctx, t_ns);
    enter_phase(b, GYRO_SLEWING, t_ns);
    board_notify(&b->base, GYRO_EV_SLEW, t_ns);
}

static void begin_position(struct gyro *b, unsigned position, int64_t t_ns)
{
    b->run.position = position;
    begin_turn(b, b->set.position_deg[(position - 1) % (unsigned)b->set.count], t_ns);
}

static const char *mode_error(const struct gyro *b, enum gyro_mode mode)
{
    if (!b->ready) return "the gyroscope runs up, or there is no power";
    if (mode == GYRO_OFF) return NULL;
    if (b->base.cfg.level_node == 0) return "no level unit is fitted: the scenario's unit key level names it";
    if (b->silent) return "the level unit is silent: it has to be operational and send frame form 0";
    if (mode == GYRO_COMPASS && b->set.count * b->set.repeat > GYRO_RUN_MAX)
        return "count times repeat is more than 127 positions";
    return NULL;
}

const char *gyro_set_mode(struct gyro *b, enum gyro_mode mode, int64_t t_ns)
{
    const char *why = mode_error(b, mode);
    b->counters.refused += why != NULL;
    if (why) return why;
    const bool servoed = b->run.servoed;
    const double q_ref_rad = b->run.q_ref_rad;
    gyro_run_stop(b, mode);
    gyro_condition(b, GYRO_ENCODER_FAULT, false, t_ns);
    gyro_condition(b, GYRO_NOT_SETTLED, false, t_ns);
    gyro_check_begin(b, t_ns);
    gyro_past_begin(b);
    b->run.servoed = mode >= GYRO_HOLD && mode <= GYRO_CALIBRATE;
    b->run.q_ref_rad = servoed && mode != GYRO_HOLD ? q_ref_rad : b->servo_rad;
    b->run.positions = (unsigned)(b->set.count * b->set.repeat);
    board_notify(&b->base, GYRO_EV_MODE, t_ns);
    if (mode == GYRO_SLEW) begin_turn(b, b->set.slew_deg, t_ns);
    if (mode == GYRO_COMPASS) begin_position(b, 1, t_ns);
    if (mode == GYRO_CALIBRATE) enter_phase(b, GYRO_SETTLING, t_ns);
    return NULL;
}

/* ---- phases ---- */

static double servo_error_rad(const struct gyro *b)
{
    return gyro_wrap_rad(b->servo_rad - b->run.q_ref_rad);
}

static void step_slewing(struct gyro *b, int64_t t_ns)
{
    double rate_radps;
    b->run.q_ref_rad = gyro_turn_at(&b->run.turn, t_ns, &rate_radps);
    if (t_ns - b->run.turn.from_ns < ns_of(b->run.turn.total_s)) return;
    b->run.q_ref_rad = gyro_wrap_rad(b->run.q_ref_rad);
    enter_phase(b, GYRO_SETTLING, t_ns);
}

static void end_settling(struct gyro *b, int64_t t_ns)
{
    if (!gyro_running(b)) {
        enter_phase(b, GYRO_IDLE, t_ns);
        return;
    }
    b->run.frozen = b->set.freeze != 0.0 && b->run.servo_steps > 0;
    b->run.frozen_radps = b->run.frozen ? b->run.servo_radps / b->run.servo_steps : 0.0;
    enter_phase(b, GYRO_WINDOW, t_ns);
    board_notify(&b->base, GYRO_EV_WINDOW, t_ns);
}

static void step_settling(struct gyro *b, int64_t t_ns)
{
    const int64_t age_ns = t_ns - b->run.phase_ns, least_ns = ns_of(b->set.settle_s);
    const double tolerance_rad = b->set.tolerance_arcmin * RAD_PER_ARCMIN;
    if (age_ns < least_ns) return;
    const bool level = fabs(b->level.beta_rad) <= tolerance_rad && !(b->flags & GYRO_LEVEL_LOST);
    if (level && fabs(servo_error_rad(b)) <= tolerance_rad) {
        end_settling(b, t_ns);
        return;
    }
    if (age_ns < least_ns + ns_of(b->set.settle_limit_s)) return;
    b->counters.unsettled++;
    gyro_run_stop(b, GYRO_HOLD);
    gyro_condition(b, GYRO_NOT_SETTLED, true, t_ns);
}

static void step_window(struct gyro *b, int64_t t_ns)
{
    const double length_s = b->run.mode == GYRO_CALIBRATE ? b->set.calibration_s : b->set.window_s;
    if (t_ns - b->run.phase_ns < ns_of(length_s)) return;
    b->counters.windows++;
    board_notify(&b->base, GYRO_EV_WINDOW_END, t_ns);
    const bool more = b->run.mode == GYRO_COMPASS && b->run.position < b->run.positions;
    if (more) begin_position(b, b->run.position + 1, t_ns);
    else gyro_run_stop(b, GYRO_HOLD);
}

void gyro_run_step(struct gyro *b, int64_t t_ns)
{
    static void (*const phase[])(struct gyro *, int64_t) = {[GYRO_IDLE] = NULL,
                                                            [GYRO_SLEWING] = step_slewing,
                                                            [GYRO_SETTLING] = step_settling,
                                                            [GYRO_WINDOW] = step_window};
    if (phase[b->run.phase]) phase[b->run.phase](b, t_ns);
}

/* ---- rates ---- */

/* The servo's part of u2; in the last second of settling it is noted, for windows that freeze it. */
static double servo_radps(struct gyro *b, int64_t t_ns)
{
    struct gyro_run *r = &b->run;
    if (r->phase == GYRO_WINDOW && r->frozen) return r->frozen_radps;
    const double u_radps = -b->set.m2_per_s * servo_error_rad(b);
    if (r->phase != GYRO_SETTLING || t_ns - r->phase_ns < ns_of(b->set.settle_s) - MEAN_NS) return u_radps;
    r->servo_radps += u_radps;
    r->servo_steps++;
    return u_radps;
}

void gyro_run_rates(struct gyro *b, int64_t t_ns, double u_radps[2])
{
    double turn_radps = b->run.mode == GYRO_NAVIGATE ? gyro_nod_radps(b, t_ns) : 0.0;
    if (b->run.mode == GYRO_OFF) {
        u_radps[0] = u_radps[1] = 0.0;
        return;
    }
    if (b->run.phase == GYRO_SLEWING) (void)gyro_turn_at(&b->run.turn, t_ns, &turn_radps);
    u_radps[0] = gyro_law_level(b->set.m1_per_s, &b->level, b->place.up_radps, turn_radps);
    if (b->run.mode == GYRO_NAVIGATE) {
        u_radps[0] += b->set.drift1_degph * RADPS_PER_DPH;
        u_radps[1] = gyro_law_keep(&b->level, &b->place, b->sin_a, b->cos_a) + b->set.drift2_degph * RADPS_PER_DPH;
        u_radps[1] += gyro_law_vertical(&b->level, 0.0, turn_radps);
        return;
    }
    u_radps[1] = gyro_law_vertical(&b->level, b->place.up_radps, turn_radps);
    if (b->run.servoed) u_radps[1] += servo_radps(b, t_ns);
}

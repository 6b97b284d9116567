#include "board/gyro/gyro.h"

#include "base/detmath.h"
#include "board/gyro/internal.h"

#include <math.h>
#include <string.h>

#define CALM_NS 1000000000 /* after which lost frames and limited rates are over */

const struct board_line gyro_lines[GYRO_LINES] = {
    [GYRO_LINE_STEP] = {"STEP", false},     [GYRO_LINE_READY] = {"READY", false},
    [GYRO_LINE_SLEW] = {"SLEW", false},     [GYRO_LINE_SETTLE] = {"SETTLE", false},
    [GYRO_LINE_WINDOW] = {"WINDOW", false}, [GYRO_LINE_FAULT] = {"FAULT", false},
};
const char *const gyro_events[GYRO_EVENTS] = {GYRO_EVENT_LIST(BOARD_EVENT_NAME)};

/* ---- settings ---- */

static struct gyro_settings default_settings(void)
{
    return (struct gyro_settings){
        .slew_dps = 9.0,
        .slew_dps2 = 20.0,
        .settle_s = 10.0,
        .settle_limit_s = 30.0,
        .tolerance_arcmin = 5.0,
        .count = 3.0,
        .repeat = 1.0,
        .window_s = 10.0,
        .calibration_s = 60.0,
        .position_deg = {0.0, 90.0, 180.0, 270.0},
        .m1_per_s = 1.0,
        .m2_per_s = 2.0,
        .latitude_deg = 50.0,
        .scale_x_v_per_g = -1.2,
        .scale_y_v_per_g = -1.2,
    };
}

void gyro_settings_changed(struct gyro *b)
{
    b->place = gyro_place_of(b->set.latitude_deg, b->set.speed_mps, b->set.track_deg);
    const struct det_pair azimuth = det_sin_cos(b->set.azimuth_deg * RAD_PER_DEG);
    b->sin_a = azimuth.sin;
    b->cos_a = azimuth.cos;
}

double gyro_heading_deg(const struct gyro *b)
{
    const double turned_deg = b->latest.encoder_rad / RAD_PER_DEG - b->set.azimuth_deg;
    return turned_deg - 360.0 * floor(turned_deg / 360.0);
}

/* ---- level unit ---- */

void gyro_take_level(struct gyro *b, int32_t x_lsb, int32_t y_lsb, uint16_t seq, int64_t t_ns)
{
    struct gyro_inlet *in = &b->inlet;
    const uint16_t missing = (uint16_t)(seq - in->seq - 1);
    b->counters.level_frames++;
    if (in->any && missing != 0) {
        in->gap = true;
        b->counters.level_lost += missing;
    }
    in->x_lsb += x_lsb;
    in->y_lsb += y_lsb;
    in->frames++;
    in->any = true;
    in->seq = seq;
    in->last_ns = t_ns;
}

/* The level angles of this step; false: a frame is missing, or there has been none for too long. */
static bool take_inlet(struct gyro *b, int64_t t_ns)
{
    struct gyro_inlet *in = &b->inlet;
    const bool was_silent = b->silent, whole = !in->gap;
    b->silent = !in->any || t_ns - in->last_ns >= b->profile.silent_ns;
    b->counters.level_silent += b->silent && !was_silent;
    if (in->frames > 0) {
        const double volts = GYRO_VOLTS / in->frames;
        b->level = gyro_level_of(((double)in->y_lsb * volts - b->set.zero_y_v) / b->set.scale_y_v_per_g,
                                 ((double)in->x_lsb * volts - b->set.zero_x_v) / b->set.scale_x_v_per_g);
    }
    in->x_lsb = in->y_lsb = 0;
    in->frames = 0;
    in->gap = false;
    return whole && !b->silent;
}

/* ---- conditions ---- */

/* One that comes and goes ends when it has not come for a while. */
static void update_intermittent(struct gyro *b, enum gyro_flag what, bool now, int64_t *calm_ns, int64_t t_ns)
{
    if (now) *calm_ns = t_ns;
    if (now || t_ns - *calm_ns >= CALM_NS) gyro_condition(b, what, now, t_ns);
}

/* ---- steps ---- */

static bool clamp_rate(double *u_radps, double limit_radps)
{
    const double asked = *u_radps;
    *u_radps = fmin(fmax(asked, -limit_radps), limit_radps);
    return *u_radps != asked;
}

static void drive_torquers(struct gyro *b, int64_t t_ns)
{
    const double limit_radps = b->profile.torquer_limit_dps * RAD_PER_DEG;
    gyro_run_rates(b, t_ns, b->u_radps);
    const bool one = clamp_rate(&b->u_radps[0], limit_radps), two = clamp_rate(&b->u_radps[1], limit_radps);
    if (one || two) b->flags |= GYRO_SATURATED;
    b->counters.saturated += one || two;
    if (!gyro_check_step(b, t_ns)) {
        gyro_run_stop(b, GYRO_LEVEL);
        gyro_report_encoder_fault(b, t_ns);
    }
    if (b->base.io.platform) b->base.io.platform->torque(b->base.io.ctx, b->u_radps[0], b->u_radps[1], t_ns);
}

static void put_lines(struct gyro *b, int64_t t_ns)
{
    static const uint64_t of_phase[] = {[GYRO_IDLE] = 0,
                                        [GYRO_SLEWING] = TRACE_BIT(GYRO_LINE_SLEW),
                                        [GYRO_SETTLING] = TRACE_BIT(GYRO_LINE_SETTLE),
                                        [GYRO_WINDOW] = TRACE_BIT(GYRO_LINE_WINDOW)};
    const uint64_t all = TRACE_FIRST(GYRO_LINES);
    const uint64_t level = TRACE_BIT(GYRO_LINE_STEP) | TRACE_BIT(GYRO_LINE_READY) | of_phase[b->run.phase] |
                           (b->latest.flags ? TRACE_BIT(GYRO_LINE_FAULT) : 0);
    trace_put(&b->base.trace, all, level, t_ns);
    trace_set(&b->base.trace, GYRO_LINE_STEP, false, t_ns + GYRO_STEP_PULSE_NS);
}

static struct gyro_reading make_reading(const struct gyro *b, int64_t t_ns)
{
    const struct board_platform_io *platform = b->base.io.platform;
    double magnetic_rad = 0.0;
    const bool magnetic = platform && platform->magnetic_rad(b->base.io.ctx, t_ns, &magnetic_rad);
    return (struct gyro_reading){
        .mode = b->run.mode,
        .phase = b->run.phase,
        .position = b->run.position,
        .flags = b->flags | (b->standing & (GYRO_ENCODER_FAULT | GYRO_NOT_SETTLED)),
        .u1_radps = b->u_radps[0],
        .u2_radps = b->u_radps[1],
        .encoder_rad = platform ? platform->encoder_rad(b->base.io.ctx, t_ns) : 0.0,
        .beta_rad = b->level.beta_rad,
        .gamma_rad = b->level.gamma_rad,
        .level_seq = b->inlet.seq,
        .magnetic = magnetic,
        .magnetic_rad = magnetic_rad,
    };
}

static void publish_reading(struct gyro *b, int64_t t_ns)
{
    b->number++;
    if (!(b->base.faults & GYRO_FAULT_FROZEN_WORDS)) b->latest = make_reading(b, t_ns);
    b->latest.step = b->number;
    put_lines(b, t_ns);
    board_notify(&b->base, GYRO_EV_STEP, t_ns);
    if (b->host.reading) b->host.reading(b->host.ctx, &b->latest, t_ns);
}

/* Steps lie on whole multiples of the period since power-on of the bench, as the platform's do. */
static int64_t next_step_ns(const struct gyro *b, int64_t after_ns)
{
    const int64_t period = b->profile.step_ns;
    return (after_ns + period - 1) / period * period;
}

static void run_step(void *ctx, int64_t t_ns)
{
    struct gyro *b = ctx;
    sched_at(b->base.sched, &b->step, t_ns + b->profile.step_ns);
    if (!b->ready) board_notify(&b->base, GYRO_EV_READY, t_ns);
    b->ready = true;
    b->counters.steps++;
    b->flags = take_inlet(b, t_ns) ? 0 : GYRO_LEVEL_LOST;
    b->servo_rad = b->base.io.platform ? b->base.io.platform->servo_rad(b->base.io.ctx, t_ns) : 0.0;
    gyro_run_step(b, t_ns);
    drive_torquers(b, t_ns);
    const bool at_work = b->run.mode != GYRO_OFF;
    update_intermittent(b, GYRO_LEVEL_LOST, at_work && b->flags & GYRO_LEVEL_LOST, &b->calm_ns[0], t_ns);
    update_intermittent(b, GYRO_SATURATED, b->flags & GYRO_SATURATED && b->run.phase != GYRO_SLEWING, &b->calm_ns[1],
                        t_ns);
    publish_reading(b, t_ns);
}

/* ---- life ---- */

void gyro_init(struct gyro *b, const struct gyro_profile *p, const struct board_cfg *cfg, const struct board_io *io,
               struct sched *s)
{
    board_clear(&b->base, sizeof *b);
    b->profile = *p;
    board_init(&b->base, gyro_lines, GYRO_LINES, cfg, io, s);
    if (io->platform) sched_ev(&b->step, run_step, b); /* it moves what is mounted there */
    else sched_ev_inner(&b->step, run_step, b);
}

/* Nothing is left but the counters. */
static void reset_state(struct gyro *b, int64_t t_ns)
{
    b->ready = false;
    b->set = default_settings();
    gyro_settings_changed(b);
    b->inlet = (struct gyro_inlet){.any = false};
    b->level = gyro_level_of(0.0, 0.0);
    gyro_run_stop(b, GYRO_OFF);
    b->silent = true;
    b->flags = b->standing = 0;
    gyro_check_begin(b, t_ns);
    b->u_radps[0] = b->u_radps[1] = 0.0;
    b->calm_ns[0] = b->calm_ns[1] = -CALM_NS;
    b->latest = (struct gyro_reading){.step = 0};
    b->number = 0;
    gyro_past_begin(b);
    trace_put(&b->base.trace, TRACE_FIRST(GYRO_LINES), 0, t_ns);
    if (b->base.io.platform) b->base.io.platform->torque(b->base.io.ctx, 0.0, 0.0, t_ns);
}

void gyro_power_up(struct gyro *b, int64_t t_ns)
{
    if (b->on) return;
    b->on = true;
    reset_state(b, t_ns);
    board_notify(&b->base, GYRO_EV_POWER_UP, t_ns);
    sched_at(b->base.sched, &b->step, next_step_ns(b, t_ns + b->profile.start_ns));
}

void gyro_power_down(struct gyro *b, int64_t t_ns)
{
    if (!b->on) return;
    b->on = false;
    sched_cancel(b->base.sched, &b->step);
    reset_state(b, t_ns);
    board_notify(&b->base, GYRO_EV_POWER_DOWN, t_ns);
}

void gyro_reset(struct gyro *b, int64_t t_ns)
{
    if (!b->on) return;
    b->counters.res++;
    reset_state(b, t_ns);
    board_notify(&b->base, GYRO_EV_RES, t_ns);
    sched_at(b->base.sched, &b->step, next_step_ns(b, t_ns + b->profile.start_ns));
}

/* No input of its own. */
void gyro_sample_until(struct gyro *b, int64_t t_ns)
{
    (void)b;
    (void)t_ns;
}

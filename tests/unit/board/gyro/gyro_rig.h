/* A gyro unit on a platform whose level sensors have fine codes: GAIN times those of a PSA-2, so that only the loops are left. */
#ifndef PSABENCH_TESTS_GYRO_RIG_H
#define PSABENCH_TESTS_GYRO_RIG_H

#include "rig.h"
#include "site.h"

#include "base/detmath.h"
#include "board/gyro/board.h"
#include "board/gyro/gyro.h"
#include "phys/motion/platform.h"

#include <math.h>
#include <string.h>

#define GAIN         100.0
#define FRAME_NS     4000000 /* 250 a second */
#define STEP_NS      10000000
#define DEGPH        (RAD_PER_DEG / 3600.0)
#define ARCMIN       (RAD_PER_DEG / 60.0)
#define RIG_READINGS 40000u

struct rig {
    struct sched s;
    struct gyro b;
    struct platform p;
    struct sched_ev feed;
    double g_mps2;
    uint16_t seq;
    bool mute;     /* the level unit sends nothing */
    unsigned lose; /* frames that are lost */
    bool magnetic; /* an induction sensor is fitted, and shows this */
    double magnetic_rad;
    double torque_radps[2];
    unsigned repositions;
    struct gyro_reading reading[RIG_READINGS];
    unsigned readings;
    unsigned events[GYRO_EVENTS], conditions; /* bits that stand */
};

static inline int32_t rig_code(double f_g)
{
    return (int32_t)floor(-1.2 * GAIN * f_g / GYRO_VOLTS + 0.5);
}

static inline void rig_feed(void *ctx, int64_t t_ns)
{
    struct rig *r = ctx;
    double f_mps2[3];
    sched_at(&r->s, &r->feed, t_ns + FRAME_NS);
    if (r->mute) return;
    const uint16_t seq = r->seq++;
    if (r->lose > 0) {
        r->lose--;
        return;
    }
    platform_force_mps2(&r->p, t_ns, f_mps2);
    gyro_take_level(&r->b, rig_code(f_mps2[0] / r->g_mps2), rig_code(f_mps2[1] / r->g_mps2), seq, t_ns);
}

static inline void rig_torque(void *ctx, double u1_radps, double u2_radps, int64_t t_ns)
{
    struct rig *r = ctx;
    r->torque_radps[0] = u1_radps;
    r->torque_radps[1] = u2_radps;
    (void)platform_torque(&r->p, u1_radps, u2_radps, t_ns);
}

static inline void rig_reposition(void *ctx, int64_t t_ns)
{
    struct rig *r = ctx;
    r->repositions++;
    platform_reposition(&r->p, t_ns);
}

static inline double rig_servo(void *ctx, int64_t t_ns)
{
    return platform_servo_rad(&((struct rig *)ctx)->p, t_ns);
}

static inline double rig_encoder(void *ctx, int64_t t_ns)
{
    return platform_encoder_rad(&((struct rig *)ctx)->p, t_ns);
}

static inline void rig_event(void *ctx, unsigned event, int64_t t_ns)
{
    (void)t_ns;
    ((struct rig *)ctx)->events[event]++;
}

static inline void rig_reading(void *ctx, const struct gyro_reading *reading, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_int_equal(t_ns % STEP_NS, 0);
    if (r->readings < RIG_READINGS) r->reading[r->readings++] = *reading;
}

static inline void rig_condition(void *ctx, enum gyro_flag what, bool active, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    assert_true(((r->conditions & what) != 0) != active); /* told once each */
    r->conditions = active ? r->conditions | what : r->conditions & ~(unsigned)what;
}

/* No error but the drifts. */
static inline struct platform_cfg rig_platform(void)
{
    struct platform_cfg c = platform_default();
    c.present = true;
    c.gm_sigma_degph = c.level_repeat_arcmin = c.angle_zero_arcmin = c.angle_set_arcmin = c.angle_read_arcmin = 0.0;
    c.level_tilt_arcmin[0] = c.level_tilt_arcmin[1] = c.angle_step_arcsec = 0.0;
    return c;
}

static bool rig_magnetic(void *ctx, int64_t t_ns, double *heading_rad)
{
    (void)t_ns;
    *heading_rad = ((struct rig *)ctx)->magnetic_rad;
    return ((struct rig *)ctx)->magnetic;
}

static const struct board_platform_io rig_platform_io = {rig_torque, rig_reposition, rig_servo, rig_encoder,
                                                         rig_magnetic};

/* The check case: latitude 50, heading 40, pitch 5, roll -4. */
static inline void rig_up(struct rig *r, const struct platform_cfg *platform, double latitude_deg)
{
    const struct board_cfg cfg = {.seed = 7, .serial = 3, .level_node = 5};
    const struct board_io io = {.ctx = r, .event = rig_event, .platform = &rig_platform_io};
    const struct site site = site_at(latitude_deg * RAD_PER_DEG, 0.0, 0.0);
    struct vehicle_cfg vehicle = vehicle_default();
    struct gyro_profile profile;
    vehicle.heading_deg = 40.0;
    vehicle.pitch_deg = 5.0;
    vehicle.roll_deg = -4.0;
    memset(r, 0, sizeof *r);
    r->g_mps2 = site.g_mps2;
    sched_init(&r->s);
    platform_init(&r->p, platform, &vehicle, &site, 7);
    fields_default(&gyro_fields, &profile);
    gyro_init(&r->b, &profile, &cfg, &io, &r->s);
    r->b.base.observed = true;
    r->b.host = (struct gyro_host){.ctx = r, .reading = rig_reading, .condition = rig_condition};
    sched_ev(&r->feed, rig_feed, r);
    sched_at(&r->s, &r->feed, 1000000);
    gyro_power_up(&r->b, 0);
    sched_run_until(&r->s, 500000000);
    r->b.set.latitude_deg = latitude_deg;
    r->b.set.scale_x_v_per_g = r->b.set.scale_y_v_per_g = -1.2 * GAIN;
    gyro_settings_changed(&r->b);
    assert_true(gyro_board.ready(&r->b.base));
}

static inline void rig_run(struct rig *r, double for_s)
{
    sched_run_until(&r->s, r->s.now_ns + (int64_t)(for_s * 1e9 + 0.5));
}

static inline void rig_mode(struct rig *r, enum gyro_mode mode)
{
    const char *why = gyro_set_mode(&r->b, mode, r->s.now_ns);
    if (why) fail_msg("%s", why);
}

static inline const struct gyro_reading *rig_last(const struct rig *r)
{
    assert_true(r->readings > 0);
    return &r->reading[r->readings - 1];
}

#endif

/* An inertial unit on a rate table whose axes turn it about its x, then y, then z; readings straight from the computer. */
#ifndef PSABENCH_TESTS_BINS_RIG_H
#define PSABENCH_TESTS_BINS_RIG_H

#include "rig.h"

#include "base/detmath.h"
#include "unit/unit.h"

#include <math.h>
#include <string.h>

#define DEGPH        (RAD_PER_DEG / 3600.0)
#define RIG_S        INT64_C(1000000000)
#define RIG_G_MPS2   9.8
#define RIG_LATITUDE (55.7 * RAD_PER_DEG)
#define RIG_PERIOD_S 0.01

struct rig {
    struct sched s;
    struct lab lab;
    struct unit u;
    void (*on_reading)(struct rig *r, const struct bins_reading *g);
    struct bins_reading last;
    unsigned readings, flags;         /* flags: of all readings; SETTLED where one lacked it */
    int64_t gyro[3], accel[3], words; /* sums */
    int64_t from_ns;                  /* where they begin */
    void *own;
};

static inline struct bins *rig_bins(struct rig *r)
{
    return (struct bins *)r->u.board;
}

static inline void rig_take(void *ctx, const struct bins_reading *g, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    r->readings++;
    r->flags |= (g->flags ^ BINS_SETTLED) & ~(unsigned)BINS_TEMP_NEW;
    for (unsigned i = 0; i < 3; i++) {
        r->gyro[i] += g->gyro[i];
        r->accel[i] += g->accel[i];
    }
    r->words += g->words;
    r->last = *g;
    if (r->on_reading) r->on_reading(r, g);
}

static inline struct bins_profile rig_ideal(void)
{
    struct bins_profile p;
    fields_default(&bins_fields, &p);
    p.gyro_bias_sd_degph = p.gyro_scale_sd = p.gyro_misalignment_sd_arcmin = 0.0;
    p.accel_bias_sd_mps2 = p.accel_scale_sd = p.accel_misalignment_sd_arcmin = 0.0;
    p.gyro_noise_degph = p.accel_noise_mps2 = 0.0;
    return p;
}

/* placed: the Earth turns; the bench's x is north. */
static inline void rig_up(struct rig *r, const struct bins_profile *p, bool placed, uint64_t seed)
{
    static const enum pose_axis along[] = {POSE_X, POSE_Y, POSE_Z};
    struct lab_cfg lab = lab_default();
    struct unit_cfg cfg = unit_default("a");
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    lab.site = (struct site){.g_mps2 = RIG_G_MPS2, .latitude_rad = RIG_LATITUDE, .placed = placed};
    lab.table = table_default(3);
    for (unsigned i = 0; i < 3; i++) lab.table.axis[i].along = along[i];
    for (unsigned i = 0; i < 3; i++) lab.table.axis[i].wobble_arcsec = 0.0;
    lab_init(&r->lab, &lab, 1);
    unit_cfg_type(&cfg, &bins_board);
    cfg.profile = p;
    cfg.board.seed = seed;
    cfg.board.adc_noise_scale = 0.0;
    cfg.board.adc_chain = ADS1282_CHAIN_DIRECT;
    cfg.mounting.on = LAB_TABLE;
    unit_init(&r->u, &cfg, &r->lab, &r->s);
    rig_bins(r)->host = (struct bins_host){.ctx = r, .reading = rig_take};
    unit_power_up(&r->u, 0);
}

static inline void rig_run(struct rig *r, double s)
{
    sched_run_until(&r->s, r->s.now_ns + (int64_t)(s * 1e9 + 0.5));
}

/* The table's commands, as the control socket gives them. */
static inline void rig_rate(struct rig *r, unsigned axis, double rate_dps)
{
    unit_sample_until(&r->u, r->s.now_ns);
    assert_int_equal(table_rate(&r->lab.table, axis, rate_dps, r->s.now_ns), MOTION_OK);
}

static inline void rig_position(struct rig *r, unsigned axis, double angle_deg, double rate_dps)
{
    unit_sample_until(&r->u, r->s.now_ns);
    assert_int_equal(table_position(&r->lab.table, axis, angle_deg, rate_dps, r->s.now_ns), MOTION_OK);
}

/* Sums begin with the next reading. */
static inline void rig_forget(struct rig *r)
{
    memset(r->gyro, 0, sizeof r->gyro);
    memset(r->accel, 0, sizeof r->accel);
    r->words = r->readings = r->flags = 0;
    r->from_ns = r->last.t_ns;
}

static inline double rig_span_s(const struct rig *r)
{
    return 1e-9 * (double)(r->last.t_ns - r->from_ns);
}

static inline double rig_angle_rad(struct rig *r, unsigned axis)
{
    return (double)r->gyro[axis] * rig_bins(r)->profile.gyro_arcsec_per_count * RAD_PER_ARCSEC;
}

static inline double rig_velocity_mps(struct rig *r, unsigned axis)
{
    return ((double)r->accel[axis] + 0.5 * (double)r->words) * bins_accel_mps_per_code(rig_bins(r));
}

#endif

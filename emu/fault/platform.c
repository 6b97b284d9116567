/* Faults of the gyro-stabilised platform: torquers and drift of an axis, the gimbal's angle sensor. */
#include "fault/internal.h"

static struct platform *platform_of(const struct fault *f)
{
    return &f->engine->bench->lab->platform;
}

/* What is active of the kind at the point: its number, and the sum of its value. */
static unsigned count_active(const struct fault *f, enum fault_arg arg, double *sum)
{
    unsigned n = 0;
    *sum = 0.0;
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        const struct fault *other = &f->engine->fault[i];
        if (other->kind != f->kind || !fault_lasts_at(f, other)) continue;
        n++;
        *sum += other->value[arg];
    }
    return n;
}

static void refresh_torquer(struct fault *f, int64_t t_ns)
{
    double unused;
    const double gain = count_active(f, FAULT_ID, &unused) ? 0.0 : 1.0;
    platform_set_torquer(platform_of(f), (enum platform_axis)f->point.index, gain, t_ns);
}

static void refresh_drift(struct fault *f, int64_t t_ns)
{
    double degph;
    (void)count_active(f, FAULT_DRIFT_DEGPH, &degph);
    platform_step_drift(platform_of(f), (enum platform_axis)f->point.index, degph, t_ns);
}

static void refresh_sensor(struct fault *f, int64_t t_ns)
{
    double unused;
    platform_stick(platform_of(f), count_active(f, FAULT_ID, &unused) > 0, t_ns);
}

// clang-format off
static const struct fault_kind platform[] = {
    {"platform.torquer", "The torquer of the axis gives no torque.", "the gyro unit gives no windows. Level: it does not settle (EMCY FF23h). Azimuth: the angle sensor does not follow (EMCY FF22h)",
     .places = FAULT_BIT(FAULT_AT_TORQUER), .lift = refresh_torquer},
    {"platform.drift_step", "The gyroscope drift about the axis changes by drift_degph.", "the levelling rate (azimuth: the rate of the azimuth torquer) changes by drift_degph",
     .places = FAULT_BIT(FAULT_AT_TORQUER), .need = FAULT_BIT(FAULT_DRIFT_DEGPH), .nonzero = FAULT_BIT(FAULT_DRIFT_DEGPH), .lift = refresh_drift},
    {"platform.encoder_stuck", "The angle sensor of the outer gimbal freezes at its last value.", "ENCODER is constant; during a turn the unit reports it (EMCY FF22h)",
     .places = FAULT_BIT(FAULT_AT_ENCODER), .lift = refresh_sensor},
};
// clang-format on
const struct fault_table fault_platform = {platform, sizeof platform / sizeof *platform};

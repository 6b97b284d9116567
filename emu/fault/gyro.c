/* Faults of gyros that count angle (board_type.gyros). Those at a gyro add up: it is given the sum of what is active; of
 * limits the lowest holds. */
#include "base/detmath.h"
#include "fault/internal.h"

#include <math.h>

enum { STUCK, SATURATION, BIAS, SCALE, LOCK_IN };

#define RADPS_PER_DEGPH (RAD_PER_DEG / 3600.0)

static double lower_limit(double a, double b)
{
    return a > 0.0 ? fmin(a, b) : b;
}

static void add_to_sum(const struct fault *f, struct board_gyro_fault *sum)
{
    switch (f->kind->variant) {
    case STUCK:
        sum->stuck = true;
        break;
    case SATURATION:
        sum->limit_radps = lower_limit(sum->limit_radps, f->value[FAULT_LIMIT_DPS] * RAD_PER_DEG);
        break;
    case BIAS:
        sum->bias_radps += f->value[FAULT_DRIFT_DEGPH] * RADPS_PER_DEGPH;
        break;
    case SCALE:
        sum->scale += f->value[FAULT_SCALE_PPM] * 1e-6;
        break;
    default:
        sum->lock_in_radps += f->value[FAULT_LOCK_IN_DEGPH] * RADPS_PER_DEGPH;
    }
}

static void refresh_gyro(struct fault *f, int64_t t_ns)
{
    const struct unit *u = fault_unit(f);
    struct board_gyro_fault sum = {.stuck = false};
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        const struct fault *other = &f->engine->fault[i];
        if (fault_lasts_at(f, other)) add_to_sum(other, &sum);
    }
    u->type->gyros->set_fault(u->board, f->point.index, &sum, t_ns);
}

// clang-format off
#define GYRO(v) .variant = (v), .places = FAULT_BIT(FAULT_AT_GYRO), .lift = refresh_gyro
static const struct fault_kind gyro[] = {
    {"gyro.stuck", "The counter of the gyro stands still.", "increments of the axis are 0 at any rate; no flag",
     GYRO(STUCK)},
    {"gyro.saturation", "The counter of the gyro follows no rate above limit_dps.", "increments of the axis stop at the limit, without noise; no flag",
     GYRO(SATURATION), .need = FAULT_BIT(FAULT_LIMIT_DPS)},
    {"gyro.bias", "Adds drift_degph to the rate that the gyro measures.", "a step in the mean increment of the axis",
     GYRO(BIAS), .need = FAULT_BIT(FAULT_DRIFT_DEGPH), .nonzero = FAULT_BIT(FAULT_DRIFT_DEGPH)},
    {"gyro.scale", "The scale factor of the gyro changes by scale_ppm.", "an error of the increments of the axis proportional to its rate",
     GYRO(SCALE), .need = FAULT_BIT(FAULT_SCALE_PPM), .nonzero = FAULT_BIT(FAULT_SCALE_PPM)},
    {"gyro.lock_in", "The dither fails: the zone of lock-in of the gyro is wider by lock_in_degph.", "the axis counts nothing but noise below that rate, and less than the rate above it",
     GYRO(LOCK_IN), .need = FAULT_BIT(FAULT_LOCK_IN_DEGPH)},
};
// clang-format on
const struct fault_table fault_gyro = {gyro, sizeof gyro / sizeof *gyro};

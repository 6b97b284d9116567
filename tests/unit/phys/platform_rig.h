/* A platform for tests: without errors unless a test sets them, on a vehicle parked at 50 deg. */
#ifndef PSABENCH_TESTS_PLATFORM_RIG_H
#define PSABENCH_TESTS_PLATFORM_RIG_H

#include "rig.h"
#include "site.h"

#include "base/sched.h"
#include "phys/motion/platform.h"

#include <math.h>

#define RAD_PER_DEG    0.017453292519943295
#define RAD_PER_ARCMIN (RAD_PER_DEG / 60.0)
#define DEGPH          (RAD_PER_DEG / 3600.0) /* rad/s */
#define STEP_NS        (NS_PER_S / 100)

static inline void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

static inline int64_t ns(double t_s)
{
    return (int64_t)nearbyint(t_s * 1e9);
}

static inline struct site at_latitude(double latitude_deg)
{
    return site_at(latitude_deg * RAD_PER_DEG, 0.0, 0.0);
}

static inline struct platform_cfg ideal(void)
{
    return (struct platform_cfg){.present = true, .step_ns = STEP_NS, .torquer_limit_dps = 20.0};
}

static inline struct vehicle_cfg parked(double heading_deg, double pitch_deg, double roll_deg)
{
    struct vehicle_cfg c = vehicle_default();
    c.heading_deg = heading_deg;
    c.pitch_deg = pitch_deg;
    c.roll_deg = roll_deg;
    return c;
}

static inline struct platform_state look(struct platform *p, double t_s)
{
    struct platform_state s;
    platform_at(p, ns(t_s), &s);
    return s;
}

#endif

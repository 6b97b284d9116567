#include "board/gyro/profile.h"

#include <stdio.h>

#define NAME(...) FIELD_NAME(struct gyro_profile, __VA_ARGS__)
#define ROW(...)  FIELD_ROW(struct gyro_profile, __VA_ARGS__)

// clang-format off
static const struct field rows[] = {
    NAME("gyro", "name of the profile"),
    ROW(step_ns, U32, 10000000, 1000000, 20000000, "period of the controller: 100 a second (E0; the article simulates with 10 ms)"),
    ROW(start_ns, U32, 200000000, 1000000, 900000000, "time from Res or power-up to the first step (gyroscope run-up, E0)"),
    ROW(silent_ns, U32, 50000000, 10000000, 1000000000, "time without a frame of the level unit after which it is lost (E0)"),
    ROW(torquer_limit_dps, REAL, 20.0, 0.1, 50, "limit of both rates in the controller (E0)"),
    ROW(stuck_turn_deg, REAL, 5.0, 0.1, 90, "angle driven in half a second for the stuck check (E0)"),
    ROW(stuck_moved_deg, REAL, 0.5, 0, 45, "least motion of the angle sensor for that drive; less: sensor or torquer fault (E0)"),
};
const struct fields gyro_fields = FIELDS_OF(struct gyro_profile, rows);
// clang-format on

bool gyro_profile_check(const void *profile, char *why, size_t cap)
{
    const struct gyro_profile *p = profile;
    if (!fields_check(&gyro_fields, p, why, cap)) return false;
    if (p->stuck_moved_deg < p->stuck_turn_deg) return true;
    (void)snprintf(why, cap, "stuck_moved_deg: expected less than stuck_turn_deg = %g, got %g", p->stuck_turn_deg,
                   p->stuck_moved_deg);
    return false;
}

#include "board/gyro/profile.h"

#include <stdio.h>

#define AT(field) .offset = offsetof(struct gyro_profile, field)
#define ROW(field, kind, low, high, text)                                                                              \
    {                                                                                                                  \
        .key = #field, .type = BOARD_FIELD_##kind, AT(field), .min = (low), .max = (high), .what = (text)              \
    }

// clang-format off
const struct board_field gyro_fields[GYRO_FIELDS] = {
    ROW(name, STRING, 1, 31, "name of the profile"),
    ROW(step_ns, UINT, 1000000, 20000000, "period of the controller: 100 a second (E0; the article simulates with 10 ms)"),
    ROW(start_ns, UINT, 1000000, 900000000, "time from Res or power-up to the first step (gyroscope run-up, E0)"),
    ROW(silent_ns, UINT, 10000000, 1000000000, "time without a frame of the level unit after which it is lost (E0)"),
    ROW(torquer_limit_dps, REAL, 0.1, 50, "limit of both rates in the controller (E0)"),
    ROW(stuck_turn_deg, REAL, 0.1, 90, "angle driven in half a second for the stuck check (E0)"),
    ROW(stuck_moved_deg, REAL, 0, 45, "least motion of the angle sensor for that drive; less: sensor or torquer fault (E0)"),
};
// clang-format on

void gyro_profile_default(void *profile)
{
    *(struct gyro_profile *)profile = (struct gyro_profile){
        .name = "gyro",
        .step_ns = 10000000,
        .start_ns = 200000000,
        .silent_ns = 50000000,
        .torquer_limit_dps = 20.0,
        .stuck_turn_deg = 5.0,
        .stuck_moved_deg = 0.5,
    };
}

bool gyro_profile_check(const void *profile, char *why, size_t cap)
{
    const struct gyro_profile *p = profile;
    if (!board_field_check(gyro_fields, GYRO_FIELDS, p, why, cap)) return false;
    if (p->stuck_moved_deg < p->stuck_turn_deg) return true;
    (void)snprintf(why, cap, "stuck_moved_deg: expected less than stuck_turn_deg = %g, got %g", p->stuck_turn_deg,
                   p->stuck_moved_deg);
    return false;
}

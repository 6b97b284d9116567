/* What is soldered or programmed in a gyro unit: one plain struct per profile; field table and check as in board/field.h. Pure. */
#ifndef PSABENCH_BOARD_GYRO_PROFILE_H
#define PSABENCH_BOARD_GYRO_PROFILE_H

#include "board/field.h"

#include <stdint.h>

struct gyro_profile {
    char name[32];
    unsigned step_ns, start_ns, silent_ns;
    double torquer_limit_dps;
    double stuck_turn_deg, stuck_moved_deg;
};

extern const struct fields gyro_fields;

bool gyro_profile_check(const void *profile, char *why, size_t cap);

#endif

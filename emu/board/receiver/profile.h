/* What is programmed or assumed in a satellite receiver: one plain struct per profile. Pure. */
#ifndef PSABENCH_BOARD_RECEIVER_PROFILE_H
#define PSABENCH_BOARD_RECEIVER_PROFILE_H

#include "board/field.h"
#include "board/receiver/nmea.h"
#include "phys/receiver/errors.h"

#include <stdint.h>

/* What leaves the serial port after a solution; the sentences first, numbered as by enum nmea_kind. */
enum receiver_message { RECEIVER_PVT = NMEA_KINDS, RECEIVER_MESSAGES };

struct receiver_profile {
    char name[32];
    uint32_t rate_hz;
    uint32_t baud; /* 8N1 */
    enum receiver_message message[RECEIVER_MESSAGES];
    unsigned message_count;
    char start_utc[32]; /* at power-on of the bench */
    uint32_t leap_s, compute_ms;
    double first_fix_s;
    /* errors, phys/receiver/errors.h */
    double position_delay_s, velocity_delay_s;
    double white_m, slow_m, white_mps, slow_mps, slow_s, vertical_ratio;
    double outliers_per_h, outlier_m, jumps_per_h, jump_m, outages_per_h, outage_s;
    /* reported, not computed */
    uint32_t sats;
    double hdop, vdop, geoid_m;
};

extern const struct fields receiver_fields;

bool receiver_profile_check(const void *profile, char *why, size_t cap);
int64_t receiver_period_ns(const void *profile);
struct receiver_errors_cfg receiver_profile_errors(const struct receiver_profile *p);

/* Bytes of a message at most, and what the bit rate leaves of them: the names of the messages that do not fit into a period, with
 * commas; "" if all do. */
unsigned receiver_message_bytes(enum receiver_message m);
void receiver_profile_unfit(const struct receiver_profile *p, char *names, size_t cap);

#endif

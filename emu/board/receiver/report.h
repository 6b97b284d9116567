/* A solution as the receiver reports it: integers in the resolution of UBX-NAV-PVT, from which NMEA 0183, UBX and CAN are
 * written, so that all three agree to the digit. And the calendar: UTC, GPS week and time of week. Pure. */
#ifndef PSABENCH_BOARD_RECEIVER_REPORT_H
#define PSABENCH_BOARD_RECEIVER_REPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define REPORT_SATS_MAX 12u /* fields of GSA */

enum report_fix { REPORT_NO_FIX = 0, REPORT_FIX_3D = 3 }; /* as fixType of UBX */

struct report {
    enum report_fix fix;
    int64_t utc_ms;         /* since 1970-01-01, without leap seconds */
    int leap_s;             /* GPS time less UTC */
    int32_t lat_e7, lon_e7; /* 1e-7 deg: -900000000 ... 900000000, -1799999999 ... 1800000000 */
    int32_t h_mm, geoid_mm; /* above the ellipsoid; of the geoid above it */
    int32_t v_n_mmps[3];    /* east, north, up */
    uint32_t h_acc_mm, v_acc_mm, s_acc_mmps, t_acc_ns; /* believed, standard deviation */
    unsigned sats;                                     /* used, 0 ... REPORT_SATS_MAX: numbers 1 ... */
    unsigned hdop_e2, vdop_e2;                         /* 0.01 */
};

struct calendar {
    int year; /* 1 ... 9999 */
    unsigned month, day, hour, minute, second, ms;
};

/* Of the proleptic Gregorian calendar. */
struct calendar calendar_of(int64_t utc_ms);
int64_t calendar_utc_ms(const struct calendar *c);

/* "2026-01-05T00:00:00", a whole second of the years 1980 to 2099 (from GPS time's beginning on). False: it is no such text. */
bool calendar_parse(const char *text, int64_t *utc_ms);

/* Whole weeks since 1980-01-06 and ms in the week, GPS time. */
void report_gps_time(const struct report *r, uint32_t *week, uint32_t *tow_ms);

/* Horizontal speed, 1 mm/s, and course over ground, 1e-5 deg, 0 ... 35999999; 0 at rest. */
uint32_t report_speed_mmps(const struct report *r);
uint32_t report_course_e5(const struct report *r);
uint32_t report_pdop_e2(const struct report *r);

#endif

#include "board/receiver/profile.h"

#include "base/why.h"
#include "board/receiver/ubx.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define NS_A_S INT64_C(1000000000)

static const char *const names[RECEIVER_MESSAGES] = {[NMEA_GGA] = "GGA", [NMEA_GSA] = "GSA", [NMEA_RMC] = "RMC",
                                                     [NMEA_VTG] = "VTG", [NMEA_ZDA] = "ZDA", [RECEIVER_PVT] = "PVT"};

static bool parse_message(void *profile, unsigned i, const char *text)
{
    struct receiver_profile *p = profile;
    for (unsigned k = 0; k < RECEIVER_MESSAGES; k++) {
        if (strcmp(text, names[k]) != 0) continue;
        p->message[i] = (enum receiver_message)k;
        p->message_count = i + 1;
        return true;
    }
    return false;
}

static bool message_text(const void *profile, unsigned i, char *out, size_t cap)
{
    const struct receiver_profile *p = profile;
    if (i >= p->message_count) return false;
    (void)snprintf(out, cap, "%s", names[p->message[i]]);
    return true;
}

#define NAME(...) FIELD_NAME(struct receiver_profile, __VA_ARGS__)
#define ROW(...)  FIELD_ROW(struct receiver_profile, __VA_ARGS__)

// clang-format off
static const struct field rows[] = {
    NAME("receiver", "Name of the profile."),
    ROW(rate_hz, U32, 10, 1, 10, "Solutions a second: 1, 2, 4, 5 or 10."),
    ROW(baud, U32, 115200, 4800, 460800, "Bit rate of the serial port, 8 data bits, no parity, 1 stop bit: 4800 times 1, 2, 4, 8, 12, 24, 48 or 96."),
    {.key = "messages", .type = FIELD_LIST, .offset = offsetof(struct receiver_profile, message), .min = 1, .max = RECEIVER_MESSAGES,
     .what = "What leaves the serial port after a solution, in this order: sentences of NMEA 0183, and PVT, the packet UBX-NAV-PVT.",
     .like = "one of GGA, GSA, RMC, VTG, ZDA, PVT", .parse = parse_message, .text = message_text,
     .standard_of = (const char *const[]){"GGA", "GSA", "RMC", "VTG", "ZDA", "PVT", NULL}},
    {.key = "start_utc", .type = FIELD_TEXT, .offset = offsetof(struct receiver_profile, start_utc), .min = 1, .max = 32,
     .what = "UTC at power-on of the bench, a whole second from 1980-01-06 on, as 2026-01-05T00:00:00.", .standard_of = (const char *const[]){"2026-01-05T00:00:00", NULL}},
    ROW(leap_s, U32, 18, 0, 60, "GPS time less UTC."),
    ROW(compute_ms, U32, 20, 0, 900, "From the instant of a solution to its output."),
    ROW(first_fix_s, REAL, 0, 0, 600, "Time without a fix after power-up or Res."),
    ROW(position_delay_s, REAL, 0.1, 0, 2, "Latency of the position: its true instant is so much before its time stamp."),
    ROW(velocity_delay_s, REAL, 0.05, -2, 2, "Latency of the velocity behind the position."),
    ROW(white_m, REAL, 1, 0, 1000, "White noise of the position, standard deviation of each horizontal axis."),
    ROW(slow_m, REAL, 1.5, 0, 1000, "Slow error of the position (Gauss-Markov), standard deviation of each horizontal axis."),
    ROW(white_mps, REAL, 0.03, 0, 100, "White noise of the velocity, each horizontal axis."),
    ROW(slow_mps, REAL, 0.01, 0, 100, "Slow error of the velocity (Gauss-Markov), each horizontal axis."),
    ROW(slow_s, REAL, 300, 1, 1e5, "Time constant of the slow errors."),
    ROW(vertical_ratio, REAL, 1.5, 0, 10, "Vertical errors relative to horizontal ones."),
    ROW(outliers_per_h, REAL, 0, 0, 36000, "Solutions an hour whose position is off by outlier_m."),
    ROW(outlier_m, REAL, 50, 0, 1e6, "Size of an outlier, in a random direction of the horizon."),
    ROW(jumps_per_h, REAL, 0, 0, 36000, "Steps of the position an hour, as satellites come and go."),
    ROW(jump_m, REAL, 3, 0, 1e4, "Standard deviation of a step, each horizontal axis."),
    ROW(outages_per_h, REAL, 0, 0, 36000, "Outages an hour."),
    ROW(outage_s, REAL, 10, 0, 1e4, "Mean duration of an outage."),
    ROW(sats, U32, 8, 4, REPORT_SATS_MAX, "Satellites reported as used."),
    ROW(hdop, REAL, 1, 0.5, 50, "Horizontal dilution of precision, as reported."),
    ROW(vdop, REAL, 1.5, 0.5, 50, "Vertical dilution of precision, as reported."),
    ROW(geoid_m, REAL, 0, -110, 110, "Height of the geoid above the ellipsoid; GGA has the height above the geoid."),
};
const struct fields receiver_fields = FIELDS_OF(struct receiver_profile, rows);
// clang-format on

int64_t receiver_period_ns(const void *profile)
{
    return NS_A_S / ((const struct receiver_profile *)profile)->rate_hz;
}

static int64_t ns_of(double s)
{
    return (int64_t)nearbyint(s * (double)NS_A_S);
}

struct receiver_errors_cfg receiver_profile_errors(const struct receiver_profile *p)
{
    return (struct receiver_errors_cfg){
        .white_m = p->white_m,
        .slow_m = p->slow_m,
        .white_mps = p->white_mps,
        .slow_mps = p->slow_mps,
        .vertical_ratio = p->vertical_ratio,
        .slow_s = p->slow_s,
        .outliers_per_h = p->outliers_per_h,
        .outlier_m = p->outlier_m,
        .jumps_per_h = p->jumps_per_h,
        .jump_m = p->jump_m,
        .outages_per_h = p->outages_per_h,
        .outage_s = p->outage_s,
        .position_delay_ns = ns_of(p->position_delay_s),
        .velocity_delay_ns = ns_of(p->velocity_delay_s),
        .period_ns = receiver_period_ns(p),
    };
}

unsigned receiver_message_bytes(enum receiver_message m)
{
    return m == RECEIVER_PVT ? (unsigned)UBX_PVT_LEN : NMEA_MAX;
}

/* At their greatest length: a start bit, eight of data, a stop bit. */
void receiver_profile_unfit(const struct receiver_profile *p, char *out, size_t cap)
{
    const unsigned room = p->baud / 10 / p->rate_hz;
    unsigned bytes = 0;
    out[0] = '\0';
    for (unsigned i = 0; i < p->message_count; i++) {
        bytes += receiver_message_bytes(p->message[i]);
        if (bytes > room) why_list_add(out, cap, names[p->message[i]]);
    }
}

static bool is_baud(uint32_t baud)
{
    static const uint32_t times[] = {1, 2, 4, 8, 12, 24, 48, 96};
    for (unsigned i = 0; i < sizeof times / sizeof *times; i++)
        if (baud == 4800 * times[i]) return true;
    return false;
}

bool receiver_profile_check(const void *profile, char *why, size_t cap)
{
    const struct receiver_profile *p = profile;
    int64_t utc_ms;
    if (!fields_check(&receiver_fields, p, why, cap)) return false;
    if (100 % p->rate_hz != 0) return why_expected(why, cap, "rate_hz", WHY_REAL(p->rate_hz), "1, 2, 4, 5 or 10");
    if (!is_baud(p->baud))
        return why_expected(why, cap, "baud", WHY_REAL(p->baud), "4800 times 1, 2, 4, 8, 12, 24, 48 or 96");
    if (!calendar_parse(p->start_utc, &utc_ms))
        return why_expected(why, cap, "start_utc", WHY_TEXT(p->start_utc),
                            "a date and a whole second from 1980-01-06T00:00:00 to 2099-12-31T23:59:59");
    if (p->compute_ms * 1000000LL >= receiver_period_ns(p))
        return why_expected(why, cap, "compute_ms", WHY_REAL(p->compute_ms), "less than the period, %.0f ms",
                            (double)receiver_period_ns(p) * 1e-6);
    if (p->position_delay_s + p->velocity_delay_s < 0.0)
        return why_expected(why, cap, "velocity_delay_s", WHY_REAL(p->velocity_delay_s), "at least -position_delay_s");
    return true;
}

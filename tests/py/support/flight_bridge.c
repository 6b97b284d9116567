/* emu/phys/flight as flat functions of numbers, for ctypes: compiled and loaded by tests/py/support/flight.py only. */
#include "phys/flight/increment.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

/* place: latitude, longitude (rad), height. plan: heading deg, jerk, roll rate, angle of attack. baro: lag, ppm, offset, drift.
 * leg rows: kind, value, parameters; NaN: the default. NULL, with the leg and the text in why: it cannot be flown. */
EXPORT struct flight *bridge_flight(const double place[3], const double plan[4], const double baro[4], unsigned legs,
                                    const double leg[][2 + FLIGHT_PARAMS], char *why, size_t cap)
{
    struct flight *f = malloc(sizeof *f);
    struct flight_cfg c = {.present = true, .plan = {plan[0], plan[1], plan[2], plan[3], legs, {{0}}}};
    struct flight_error e;
    const struct site site = {earth_gravity_mps2(place[0], place[2]), place[0], place[1], place[2], 0.0, true};
    c.baro = (struct baro_cfg){baro[0], baro[1], baro[2], baro[3]};
    for (unsigned i = 0; i < legs; i++) {
        c.plan.leg[i] = flight_leg_of((enum flight_leg_kind)leg[i][0], leg[i][1]);
        for (unsigned k = 0; k < FLIGHT_PARAMS; k++)
            if (!isnan(leg[i][2 + k])) c.plan.leg[i].param[k] = leg[i][2 + k];
    }
    if (f && flight_init(f, &c, &site, &e)) return f;
    snprintf(why, cap, "legs[%u].%s: %s", e.leg, e.key, e.text);
    free(f);
    return NULL;
}

EXPORT void bridge_flight_free(struct flight *f)
{
    free(f);
}

EXPORT int64_t bridge_flight_end_ns(const struct flight *f)
{
    return f->plan.leg_ns[f->cfg.plan.legs];
}

EXPORT int64_t bridge_flight_leg_ns(const struct flight *f, unsigned leg)
{
    return f->plan.leg_ns[leg];
}

/* Latitude, longitude, height; velocity, acceleration (east, north, up); heading, pitch, roll; C_nb; force; rate; barometric height; gravity of
 * the ellipsoid. */
EXPORT void bridge_flight_states(const struct flight *f, const int64_t *t_ns, unsigned n, double out[][29])
{
    for (unsigned i = 0; i < n; i++) {
        struct flight_state s;
        flight_at(f, t_ns[i], &s);
        const double first[12] = {s.lat_rad,       s.lon_rad,      s.h_m,           s.v_enu_mps[0],
                                  s.v_enu_mps[1],  s.v_enu_mps[2], s.a_enu_mps2[0], s.a_enu_mps2[1],
                                  s.a_enu_mps2[2], s.heading_rad,  s.pitch_rad,     s.roll_rad};
        memcpy(out[i], first, sizeof first);
        memcpy(out[i] + 12, s.pose.C_nb, sizeof s.pose.C_nb);
        memcpy(out[i] + 21, s.f_b_mps2, sizeof s.f_b_mps2);
        memcpy(out[i] + 24, s.pose.w_ib_b_radps, sizeof s.pose.w_ib_b_radps);
        out[i][27] = flight_baro_m(f, t_ns[i]);
        out[i][28] = earth_gravity_mps2(s.lat_rad, s.h_m);
    }
}

/* Of n intervals of dt_ns: angle, speed. */
EXPORT void bridge_flight_increments(const struct flight *f, int64_t from_ns, int64_t dt_ns, unsigned n,
                                     double out[][6])
{
    for (unsigned i = 0; i < n; i++)
        flight_increment(f, from_ns + i * dt_ns, from_ns + (i + 1) * dt_ns, out[i], out[i] + 3);
}

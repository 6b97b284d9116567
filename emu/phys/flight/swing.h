/* A sine that grows from nothing and dies away: a parked aircraft in wind, a snake. Pure.
 *
 * amplitude e sin(2 pi t / period), t from the beginning. The envelope e rises over edge_ns at the beginning and falls over the last
 * edge_ns by the septic -20 s^7 + 70 s^6 - 84 s^5 + 35 s^4: three continuous derivatives. */
#ifndef PSABENCH_PHYS_FLIGHT_SWING_H
#define PSABENCH_PHYS_FLIGHT_SWING_H

#include "phys/flight/channel.h"

enum swing_of { SWING_TRACK, SWING_PITCH, SWING_ROLL };

struct swing {
    enum swing_of of;
    int64_t from_ns, to_ns, edge_ns; /* edge: at most half of it */
    double amplitude_rad, period_s;
};

/* All zero outside. */
struct jet swing_at(const struct swing *s, int64_t t_ns);

/* Where the envelope is another function after t_ns; INT64_MAX: nowhere. */
int64_t swing_next_ns(const struct swing *s, int64_t t_ns);

#endif

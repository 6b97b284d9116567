/* The path over the ellipsoid: what follows from speed, height and track, without attitude. Of flight.c alone. */
#ifndef PSABENCH_PHYS_FLIGHT_PATH_H
#define PSABENCH_PHYS_FLIGHT_PATH_H

#include "base/detmath.h"
#include "phys/flight/flight.h"

struct path {
    struct jet speed_mps, up_mps, track_rad; /* speed: over the ground; up: to its second derivative */
    double lat_rad, lon_rad, h_m;
    struct det_pair lat, track;
    double v_enu_mps[3], a_enu_mps2[3];
    double meridian_m, vertical_m; /* M + h, N + h */
    double meridian_d1_mps, vertical_d1_mps;
    double lat_d1_radps;
    double w_en_n_radps[3]; /* NED */
};

/* Integrates latitude and longitude over the whole plan. False, with the error: towards a pole, or more nodes than there are. */
bool path_make(struct flight *f, struct flight_error *e);

void path_at(const struct flight *f, int64_t t_ns, struct path *p);

#endif

/* Where an antenna is and how it moves: what a receiver is asked to find.
 *
 * place_at_fn is the motion of an antenna: at rest at the site of the bench, or that of a flight. It is defined for past instants, too:
 * a receiver looks back by its latency. */
#ifndef PSABENCH_PHYS_RECEIVER_PLACE_H
#define PSABENCH_PHYS_RECEIVER_PLACE_H

#include <stdint.h>

struct place {
    double lat_rad, lon_rad, h_m; /* geodetic, WGS 84; longitude in (-pi, pi] */
    double v_n_mps[3];            /* relative to the Earth: east, north, up */
};

typedef void place_at_fn(void *ctx, int64_t t_ns, struct place *out);

/* The place displaced by so many metres east, north, up: along the radii of curvature of WGS 84, across a pole and the
 * antimeridian. Within 1e-9 rad for displacements up to a kilometre, 100 m from a pole or more. Velocities stay. */
void place_displace(struct place *p, const double by_m[3]);

#endif

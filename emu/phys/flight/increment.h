/* What ideal integrating sensors of the aircraft give over an interval, and the turn that they stand for. Pure. */
#ifndef PSABENCH_PHYS_FLIGHT_INCREMENT_H
#define PSABENCH_PHYS_FLIGHT_INCREMENT_H

#include "phys/flight/flight.h"

/* Integrals of the rate, rad, and the specific force, m/s, along the axes of b: Gauss-Legendre with five nodes on panels of up to
 * 100 ms that end where flight_smooth_ns() says. */
void flight_increment(const struct flight *f, int64_t from_ns, int64_t to_ns, double angle_rad[3], double speed_mps[3]);

/* Rotation vector of b from one instant to the other relative to inertial space, less than half a turn: of the attitudes alone. */
void flight_turn(const struct flight *f, int64_t from_ns, int64_t to_ns, double turn_rad[3]);

#endif

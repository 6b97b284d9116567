/* A place on the Earth for tests of motion. */
#ifndef PSABENCH_TESTS_SITE_H
#define PSABENCH_TESTS_SITE_H

#include "phys/motion/earth.h"

/* Placed, with the normal gravity there, as a scenario without g_mps2 has it. */
static inline struct site site_at(double latitude_rad, double height_m, double azimuth_rad)
{
    return (struct site){.g_mps2 = earth_gravity_mps2(latitude_rad, height_m),
                         .latitude_rad = latitude_rad,
                         .height_m = height_m,
                         .azimuth_rad = azimuth_rad,
                         .placed = true};
}

#endif

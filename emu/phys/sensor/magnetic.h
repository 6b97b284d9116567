/* Induction sensor of the magnetic heading, on the vehicle under the platform (docs/instruments.md).
 *
 * The Earth's field is data of the scenario: horizontal strength, declination, dip, the last two linear in latitude. The sensor
 * measures two components in its own plane. That plane hangs on a pendulum, so it follows the apparent vertical, or is fixed to
 * the vehicle; where it is not level the field's vertical part gets in, by the tangent of the dip. The vehicle's iron and the
 * setting of the sensor are the deviation A + B sin m + C cos m + D sin 2m + E cos 2m, m the heading that it would show without.
 * Plain struct, one thread; the noise of an instant is a function of seed and instant. */
#ifndef PSABENCH_PHYS_SENSOR_MAGNETIC_H
#define PSABENCH_PHYS_SENSOR_MAGNETIC_H

#include "base/draws.h"
#include "phys/motion/vehicle.h"

#define MAGNETIC_DEVIATIONS 5u

struct magnetic_cfg {
    bool present;
    double declination_deg,
        declination_slope;     /* at the site, to the east; its change per degree of latitude to the north */
    double dip_deg, dip_slope; /* below the horizon */
    double horizontal_ut;
    bool pendulous;                            /* else fixed to the vehicle */
    double tilt_arcmin[2];                     /* of the plane: nose up, right side down */
    double deviation_deg[MAGNETIC_DEVIATIONS]; /* A to E */
    double noise_ut;                           /* of each component, standard deviation of a reading */
};

struct magnetic {
    struct magnetic_cfg cfg;
    struct draws noise[2];
};

/* Not present; the figures of docs/instruments.md. */
struct magnetic_cfg magnetic_default(void);

void magnetic_init(struct magnetic *m, const struct magnetic_cfg *cfg, uint64_t seed);
void magnetic_reseed(struct magnetic *m, uint64_t seed);

/* Declination where the vehicle is. */
double magnetic_declination_rad(const struct magnetic *m, const struct vehicle *v, const struct vehicle_state *at);

/* What it shows of the vehicle's heading at that instant, from magnetic north, clockwise; in (-pi, pi]. */
double magnetic_heading_rad(const struct magnetic *m, const struct vehicle *v, int64_t t_ns);

#endif

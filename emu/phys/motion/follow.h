/* Follow-up of a gimbal: the gyroscope's pickoff, a dead zone, and a motor that turns the platform after the rotor at a rate
 * proportional to the angle between them, up to a limit. Pure. */
#ifndef PSABENCH_PHYS_MOTION_FOLLOW_H
#define PSABENCH_PHYS_MOTION_FOLLOW_H

struct follow_cfg {
    double hz;          /* bandwidth; 0: the platform is where the rotor is */
    double dead_arcsec; /* on each side of zero */
    double limit_dps;   /* of the motor */
};

/* The angle from platform to rotor h_s later. The rotor turns at rotor_radps, the platform's carrier at carrier_radps, and the motor
 * turns the platform on its carrier: e' = rotor - carrier - motor(e). Exact for rates that stay. */
double follow_after(const struct follow_cfg *cfg, double e_rad, double rotor_radps, double carrier_radps, double h_s);

#endif

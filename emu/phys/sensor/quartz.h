/* Quartz pendulum accelerometer with current output (sources 5.6).
 *
 * The torquer balances the pendulum: I = S (a + zero), S = mL/K_DM. What is balanced is the acceleration along the input axis
 * with its misalignment, its square and the pendulum's own deflection, and the zero signal. Scale, zero and base (the direction
 * of the input axis towards y, the pendulous axis) follow the temperature of the element along one smooth curve,
 *
 *   y(T) = y(30) + curve x exp((1 - x^2) / 2) + slope (T - 30),   x = (T - centre) / width,
 *
 * T with a play, which its owner has (chamber.h); the zero has a part for case - element besides. A positive curve is the
 * article's group (a), a negative one its group (b). Two causes move all three from start to start: the residual stress of the
 * glue, of which each thermal cycle leaves a part, and the position of the pendulum, sealed in for good but for a scatter that
 * is drawn at each start.
 *
 * The loop answers as one oscillator of second order, exactly for an input held since the look before. What it holds of the past
 * is finite: it starts again, in balance, at the first look of each period of a fixed grid, and answers in the next period;
 * what it did not know then has decayed by exp(-40). Two pasts that agree for two periods have the same answer to the bit.
 * Deflected, the pendulum feels the acceleration along y (vibropendulous error). Then the white noise, one draw for each
 * instant (looks.h), and the limits. a = projection of gravity on the sensor's axes as in mems.h, m/s^2; output in amperes.
 * Plain struct, one thread. */
#ifndef PSABENCH_PHYS_SENSOR_QUARTZ_H
#define PSABENCH_PHYS_SENSOR_QUARTZ_H

#include "base/draws.h"
#include "base/looks.h"
#include "phys/sensor/pendulum.h"

#include <stdbool.h>
#include <stdint.h>

#define QUARTZ_REFERENCE_DEGC 30.0 /* at which the scale is given */

/* As a passport and a scenario give it. */
struct quartz_g {
    double scale_a_per_g;
    double scale_tc_ppm_per_k, scale_curve_ppm;
    double zero_ug, curve_ug, curve_centre_degc, curve_width_k, slope_ug_per_k; /* millionths of g */
    double play_k;                                     /* half the width of the hysteresis in temperature */
    double gradient_ug_per_k;                          /* for case warmer than element */
    double tilt_y_mrad, tilt_z_mrad;                   /* of the input axis towards y and z */
    double base_slope_arcsec_per_k, base_curve_arcsec; /* towards y over temperature */
    double square_ug_per_g2;
    double pendulous_ug_per_g2; /* of the accelerations along x and y: the deflection for one g, in urad */
    double alpha0_deg;          /* error of setting, as in mems.h */
    /* residual stress of the glue: what it adds in a unit that has had no thermal cycle, and what each cycle leaves of it */
    double glue_ug, glue_ppm, glue_arcsec, glue_keep;
    double cycles; /* that it has had */
    /* position of the pendulum: off its null, sealed in; scatter from start to start, rms */
    double position_urad, hinge_ug_per_urad;
    double start_ug, start_ppm, start_arcsec;
    double starts;              /* that it has had */
    double natural_hz, damping; /* of the loop; 0 Hz: answers at once */
    double noise_a_rthz;        /* white, one-sided */
    double limit_a;             /* either sign; 0: none */
    bool pendulum_given;        /* scale, loop, coupling, hinge and a limit follow from it */
    struct pendulum pendulum;
};

/* What temperature, cycles and starts make of a unit, and for which of them it holds. */
struct quartz_terms {
    double felt_degc, element_degc, case_degc, cycles;
    int64_t start;
    double scale_a_per_g, zero_ug, tilt_y_mrad;
};

struct quartz_loop {
    double input_g;
    double off_g[2]; /* deflection off the input, and its rate times the step's unit */
};

struct quartz {
    struct quartz_g cfg; /* with what follows from its pendulum */
    double g_mps2;
    /* Its owner keeps them up; the reference temperature from quartz_init() on. felt: element with play. */
    double case_degc, element_degc, felt_degc;
    double cycles;             /* thermal cycles since then, as chamber_body_cycles() counts them; its owner too */
    uint32_t starts;           /* since then: quartz_start() */
    struct quartz_terms terms; /* of the last look */
    struct draws noise;
    struct draws scatter, later_scatter; /* of the present start; of those to come */
    int64_t t_ns;                        /* of the last look; -1 before the first */
    int64_t dt_ns;                       /* for which the coefficients of the loop hold */
    int64_t every_ns;                    /* period of the loop's grid; 0: its memory is too long for one */
    int64_t end_ns;                      /* of the present period; 0: a look is the first */
    struct quartz_loop loop[2];          /* that answers now, and that will in the next period */
    double step[2][2];                   /* (deviation, rate / w) of the loop over dt_ns */
    double held_a;                       /* of the last look, without noise */
};

/* Plausible figures (E0): 1.28 mA/g, 350 Hz with 0.7, zero 60 ug with a curve of 300 ug, 55 K wide about 12 degC. Of the two
 * causes only the hinge's stiffness and the half that a cycle leaves have figures: the unit has been run in. */
struct quartz_g quartz_default(void);

/* With what follows from its pendulum, if that is given. */
struct quartz_g quartz_with_pendulum(const struct quartz_g *cfg, double g_mps2);

/* g is the site's: a scale per g means per this g. */
void quartz_init(struct quartz *q, const struct quartz_g *cfg, double g_mps2, struct draws noise, struct draws scatter);

/* It is switched on: the pendulum comes to rest elsewhere. */
void quartz_start(struct quartz *q);

/* Noise from here on, and what later starts add, come from another seed. */
void quartz_reseed(struct quartz *q, uint64_t seed);

/* What it would give at rest without noise: truth. */
double quartz_true_a(const struct quartz *q, const double a_mps2[3]);

/* Bias at rest, hours after a change of temperature, of a unit that has been run in, without the scatter of starts. */
double quartz_settled_ug(const struct quartz_g *cfg, double degc);

/* Output current at a row of looks; a_mps2 holds three numbers a look, or, if `felt` is 1, three for all. No look is
 * earlier than the last call's; the same instant gives the same current. */
void quartz_out_row_a(struct quartz *q, const double *a_mps2, unsigned felt, const struct looks *at, double *out_a);

/* Its pickoff at the last look: truth. False: nothing is known of its pendulum. */
bool quartz_pickoff(const struct quartz *q, struct pickoff *out);

/* How much of the past an output shows: looks since then decide it to the bit. -1: no one knows. */
int64_t quartz_past_ns(const struct quartz *q);

/* Whatever was before: as if the last look had been at t_ns. Outputs are true quartz_past_ns() after the next one. */
void quartz_skip(struct quartz *q, int64_t t_ns);

/* What its outputs stay within for accelerations of at most a_max, looks every_ns apart, at -100 to 200 degC. */
struct looks_range quartz_range_a(const struct quartz *q, double a_max_mps2, int64_t every_ns);

#endif

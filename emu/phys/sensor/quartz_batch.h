/* A production batch of quartz accelerometers: how its units differ, and the unit that a serial number is (sources 5.10).
 *
 * A share of the units is of the article's group (a), a share of (b); the rest has a straight line in place of the curve. Of each
 * unit the bias over -60 to +85 degC changes by a ratio within the batch's limits, and lies at 30 degC within others; draws beside
 * them are drawn again. The stress of the glue moves bias, scale and base together: the correlation is that of the logarithms of
 * their sizes, their signs are independent. Each parameter has draws of its own: another one does not shift the others. Pure. */
#ifndef PSABENCH_PHYS_SENSOR_QUARTZ_BATCH_H
#define PSABENCH_PHYS_SENSOR_QUARTZ_BATCH_H

#include "phys/sensor/quartz.h"

#define QUARTZ_COLD_DEGC (-60)
#define QUARTZ_HOT_DEGC  85

/* Pairs of least and greatest are uniform, of either sign where the sign is open; sd: of a normal law about 0. */
struct quartz_batch {
    char name[32];
    double share_a, share_b;
    double curve_min_ug, curve_max_ug, centre_min_degc, centre_max_degc, width_min_k, width_max_k;
    double slope_ug_per_k;                                   /* sd, of both groups */
    double rest_slope_min_ug_per_k, rest_slope_max_ug_per_k; /* either sign, of the rest */
    double zero_min_ug, zero_max_ug;                         /* at 30 degC, either sign, glue and starts apart */
    double ratio_min, ratio_max;                             /* of the greatest bias to that at 30 degC */
    double scale_tc_ppm_per_k, scale_curve_ppm, base_slope_arcsec_per_k, base_curve_arcsec; /* sd */
    double position_urad;                                                                   /* sd */
    double glue_ug, glue_ppm, glue_arcsec;                                                  /* mean size, either sign */
    double glue_spread, glue_correlation;     /* sd of the logarithm; between two of the three */
    double glue_keep, glue_keep_spread;       /* median left by a cycle; sd of the logarithm */
    double start_ug, start_ppm, start_arcsec; /* of every unit */
    /* largest change from start to start that acceptance allows: nothing is drawn by them */
    double zero_tolerance_ug, scale_tolerance_ppm, base_tolerance_arcsec;
};

enum quartz_group { QUARTZ_GROUP_A, QUARTZ_GROUP_B, QUARTZ_REST, QUARTZ_GROUPS };

/* Shares E0; forms, ratios and the law of run-in as instruments 3.2 and 3.5. */
struct quartz_batch quartz_batch_default(void);

/* By the sign of its curve. */
enum quartz_group quartz_group(const struct quartz_g *g);
const char *quartz_group_name(enum quartz_group group); /* "a", "b", "rest" */

/* Greatest size of the bias between QUARTZ_COLD_DEGC and QUARTZ_HOT_DEGC over that at 30 degC, run in. */
double quartz_ratio(const struct quartz_g *g);

/* The unit with this serial number on this axis (0 ... 2): what the batch says over what is in *g, whose hinge counts. False: in a
 * thousand draws none was within the batch's ratios; *g is the last one. */
bool quartz_batch_draw(const struct quartz_batch *b, uint64_t seed, uint32_t serial, unsigned axis, struct quartz_g *g);

#endif

/* What is soldered, programmed or assumed in an inertial unit (БИНС), and the errors of its sensors: one plain struct per profile.
 *
 * An error is the number given and a draw of the spread beside it, by seed and serial number; a spread of 0 leaves the number.
 * Letters and priors are those of the article on calibration (docs/boards/bins.md). Pure. */
#ifndef PSABENCH_BOARD_BINS_PROFILE_H
#define PSABENCH_BOARD_BINS_PROFILE_H

#include "board/field.h"
#include "board/psa2/profile.h"
#include "phys/sensor/inertial.h"

#include <stdint.h>

struct bins_profile {
    char name[32];
    uint32_t accel_sps;         /* words of the accelerometers' converters */
    uint32_t words_per_reading; /* summed in the unit */
    bool aligned;               /* gyros are latched so that both increments belong to one interval */
    double accel_v_per_g;       /* at the load, per STANDARD_G_MPS2 */
    double gyro_arcsec_per_count;
    /* errors given */
    double gyro_bias_degph[3], gyro_theta[9], gyro_g_degph_per_g[9];
    double accel_bias_mps2[3], accel_gamma[9];
    /* their spread among specimens */
    double gyro_bias_sd_degph, gyro_scale_sd, gyro_misalignment_sd_arcmin, gyro_g_sd_degph_per_g;
    double accel_bias_sd_mps2, accel_scale_sd, accel_misalignment_sd_arcmin;
    /* noise: standard deviation of a mean of one second */
    double gyro_noise_degph, accel_noise_mps2;
    uint32_t nav_every;        /* readings between two outputs of the unit's own navigation */
    double gyro_lock_in_degph; /* rates below it are not seen; 0: dithered away */
    double gyro_instability_degph, accel_instability_mps2; /* B of IEEE Std 952: flicker (phys/sensor/noise.h) */
};

#define BINS_STANDARD_G_MPS2 9.80665

extern const struct fields bins_fields;

bool bins_profile_check(const void *profile, char *why, size_t cap);
int64_t bins_period_ns(const void *profile); /* of the readings */

/* The PSA-2 inside: of profile "article" but for its data rate. */
void bins_profile_psa2(const struct bins_profile *p, struct psa2_profile *inside);

/* The specimen with this seed and number. */
struct inertial_errors bins_profile_errors(const struct bins_profile *p, uint64_t seed, uint64_t serial);

#endif

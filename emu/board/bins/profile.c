#include "board/bins/profile.h"

#include "base/detmath.h"
#include "base/why.h"

#define NAME(...) FIELD_NAME(struct bins_profile, __VA_ARGS__)
#define ROW(...)  FIELD_ROW(struct bins_profile, __VA_ARGS__)
#define LIST(member, n, most, words)                                                                                   \
    {                                                                                                                  \
        .key = #member, .type = FIELD_REALS, .offset = offsetof(struct bins_profile, member), .count = (n),            \
        .min = -(most), .max = (most), .what = (words)                                                                 \
    }

// clang-format off
static const struct field rows[] = {
    NAME("bins", "Name of the profile."),
    ROW(accel_sps, U32, 500, 500, 2000, "Words a second of the accelerometers' converters: 500, 1000 or 2000."),
    ROW(words_per_reading, U32, 5, 1, 200, "Words summed in a reading: 5 of 500 a second are 10 ms."),
    ROW(aligned, BOOL, true, 0, 1, "Gyros are latched by the converters' delay earlier, so that both increments of a reading belong to one interval; false: with the last word's data-ready."),
    ROW(accel_v_per_g, REAL, 1.2, 0.1, 10, "Volts of an accelerometer per 9.80665 m/s2; the converters take 10 V."),
    ROW(gyro_arcsec_per_count, REAL, 0.01, 1e-4, 1000, "Angle per count of a gyro."),
    LIST(gyro_bias_degph, 3, 1000.0, "Drifts nu0 of the gyros x, y, z: measured less true."),
    LIST(gyro_theta, 9, 0.1, "Theta of the gyros, row by row: scale errors and misalignments."),
    LIST(gyro_g_degph_per_g, 9, 1000.0, "Drift of a gyro per 9.80665 m/s2 of specific force along x, y, z, row by row."),
    LIST(accel_bias_mps2, 3, 1.0, "Zeros df0 of the accelerometers x, y, z: measured less true."),
    LIST(accel_gamma, 9, 0.1, "Gamma of the accelerometers, row by row: scale errors and misalignments."),
    ROW(gyro_bias_sd_degph, REAL, 0.5, 0, 1000, "Spread of the drifts among specimens, standard deviation."),
    ROW(gyro_scale_sd, REAL, 1e-3, 0, 0.02, "Spread of the gyros' scale errors."),
    ROW(gyro_misalignment_sd_arcmin, REAL, 3.0, 0, 60, "Spread of the gyros' misalignments."),
    ROW(gyro_g_sd_degph_per_g, REAL, 0.0, 0, 100, "Spread of the drifts per g."),
    ROW(accel_bias_sd_mps2, REAL, 0.02, 0, 0.2, "Spread of the accelerometers' zeros."),
    ROW(accel_scale_sd, REAL, 1e-3, 0, 0.02, "Spread of the accelerometers' scale errors."),
    ROW(accel_misalignment_sd_arcmin, REAL, 3.0, 0, 60, "Spread of the accelerometers' misalignments."),
    ROW(gyro_noise_degph, REAL, 0.1, 0, 1000, "White noise of a gyro: standard deviation of a mean of one second."),
    ROW(accel_noise_mps2, REAL, 1e-3, 0, 1, "White noise of an accelerometer: standard deviation of a mean of one second."),
    ROW(nav_every, U32, 20, 1, 1000, "Readings between two outputs of the unit's own navigation: 20 are 0.2 s."),
    ROW(gyro_lock_in_degph, REAL, 0.0, 0, 3600, "Lock-in of a gyro: it counts sqrt(w^2 - lock-in^2), and nothing below; 0: its dither removes it."),
    ROW(gyro_instability_degph, REAL, 0.0, 0, 1000, "Bias instability B of a gyro, flicker: the Allan deviation is 0.664 of it from 1 s to 300 s."),
    ROW(accel_instability_mps2, REAL, 0.0, 0, 1, "The same of an accelerometer."),
};
const struct fields bins_fields = FIELDS_OF(struct bins_profile, rows);
// clang-format on

#define RADPS_PER_DEGPH (RAD_PER_DEG / 3600.0)
#define NS_A_SECOND     INT64_C(1000000000)

int64_t bins_period_ns(const void *profile)
{
    const struct bins_profile *p = profile;
    return p->words_per_reading * NS_A_SECOND / p->accel_sps;
}

bool bins_profile_check(const void *profile, char *why, size_t cap)
{
    const struct bins_profile *p = profile;
    if (!fields_check(&bins_fields, p, why, cap)) return false;
    if (p->accel_sps != 500 && p->accel_sps != 1000 && p->accel_sps != 2000)
        return why_expected(why, cap, "accel_sps", WHY_REAL(p->accel_sps), "500, 1000 or 2000");
    if (bins_period_ns(p) < NS_A_SECOND / 500)
        return why_expected(why, cap, "words_per_reading", WHY_REAL(p->words_per_reading),
                            "%u or more: a reading takes 2 ms at least", p->accel_sps / 500);
    return true;
}

/* DR of CONFIG0: 001 500, 010 1000, 011 2000 words a second. */
static uint8_t config0_of(const struct bins_profile *p)
{
    const unsigned dr = p->accel_sps == 500 ? 1 : p->accel_sps == 1000 ? 2 : 3;
    return (uint8_t)(0x46u | dr << 3);
}

void bins_profile_psa2(const struct bins_profile *p, struct psa2_profile *inside)
{
    fields_default(&psa2_fields, inside);
    for (unsigned i = 0; i < inside->setup_count; i++) {
        struct psa2_setup_step *s = &inside->setup[i];
        if (s->action == PSA2_WRITE_A && s->bytes[0] == 0x41) s->bytes[2] = config0_of(p);
    }
}

struct inertial_errors bins_profile_errors(const struct bins_profile *p, uint64_t seed, uint64_t serial)
{
    const struct inertial_spread sd = {
        .nu0_radps = p->gyro_bias_sd_degph * RADPS_PER_DEGPH,
        .theta_scale = p->gyro_scale_sd,
        .theta_misalignment = p->gyro_misalignment_sd_arcmin * RAD_PER_ARCMIN,
        .g_drift_radps_per_mps2 = p->gyro_g_sd_degph_per_g * RADPS_PER_DEGPH / BINS_STANDARD_G_MPS2,
        .df0_mps2 = p->accel_bias_sd_mps2,
        .gamma_scale = p->accel_scale_sd,
        .gamma_misalignment = p->accel_misalignment_sd_arcmin * RAD_PER_ARCMIN,
    };
    struct inertial_errors e = {.nu0_radps = {0.0}};
    for (unsigned i = 0; i < 3; i++) {
        e.nu0_radps[i] = p->gyro_bias_degph[i] * RADPS_PER_DEGPH;
        e.df0_mps2[i] = p->accel_bias_mps2[i];
        for (unsigned j = 0; j < 3; j++) {
            e.theta[i][j] = p->gyro_theta[3 * i + j];
            e.gamma[i][j] = p->accel_gamma[3 * i + j];
            e.g_drift_radps_per_mps2[i][j] = p->gyro_g_degph_per_g[3 * i + j] * RADPS_PER_DEGPH / BINS_STANDARD_G_MPS2;
        }
    }
    inertial_draw(&e, &sd, seed, serial);
    return e;
}

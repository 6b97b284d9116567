/* North from a platform that levels itself: its levelling command in four positions is all that is needed. */
#include <nav/nav.h>
#include <stdio.h>

#define DEG   0.017453292519943295
#define DEGPH (DEG / 3600.0)

int main(void)
{
    /* Levelling commands of four 10 s windows, 20 s apart, at gimbal angles 0, 180, 90, 270 deg; latitude 50 deg. */
    const double s_degph[4] = {30.27, 19.71, 33.08, 16.90};
    const double turn_deg[4] = {0, 180, 90, 270};
    struct nav_position p[4] = {{0}};
    for (int i = 0; i < 4; i++) {
        p[i].s_radps = s_degph[i] * DEGPH;
        p[i].delta_rad = turn_deg[i] * DEG;
        p[i].t_mid_s = 20 * i;
        p[i].window_s = 10;
    }
    struct nav_gyrocompass_cfg cfg = {.latitude_rad = 50 * DEG, .method = NAV_GLS};
    cfg.noise.gm_sigma_radps = 0.2 * DEGPH;
    cfg.noise.gm_tau_s = 1000;
    cfg.noise.angle_sd_rad = 0.5 / 60 * DEG;
    struct nav_compass north;
    const int status = nav_gyrocompass(p, 4, &cfg, &north);
    if (status != NAV_OK) {
        fprintf(stderr, "%s\n", nav_status_text(status));
        return 1;
    }
    printf("alpha %.2f deg, 95 %% within %.2f deg\n", north.alpha1_rad / DEG, north.alpha1_half95_rad / DEG);
    printf("drift %.2f deg/h, sd %.2f deg/h\n", north.drift1_radps / DEGPH, north.drift1_sd_radps / DEGPH);
    printf("quality %.4f%s\n", north.quality, north.flags ? ": look at the flags" : "");
    return nav_gyrocompass(p, 2, &cfg, &north) == NAV_TOO_FEW ? 0 : 1;
}

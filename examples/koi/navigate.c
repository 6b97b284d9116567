/* Navigates a recorded flight of a strapdown unit with a satellite receiver: navigate FILE
 * (docs/nav.md, examples/koi/record.py). Lines, in order of time:
 *   I  angle x y z, rad, velocity x y z, m/s: raw increments of 10 ms, from the beginning, parked for ALIGN_S
 *   F  time, s, latitude, longitude, rad, height, m, velocity east, north, up, m/s: the receiver
 *   H  time, s, height, m: the barometer */
#include <nav/koi.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#define DEG     0.017453292519943295
#define EARTH_M 6.37e6

enum { RATE = 100, ALIGN_S = 600, COARSE_S = 120, STATES = 48 };

static double angle[ALIGN_S * RATE][3], velocity[ALIGN_S * RATE][3]; /* while parked */
static const double none[3];

static void check(int status, const char *what)
{
    if (status >= 0) return;
    fprintf(stderr, "navigate: %s: %s\n", what, nav_status_text(status));
    exit(1);
}

static void take(nav_koi *k, int kind, double t_s, const double value[3])
{
    const struct nav_koi_measurement m = {kind, 1, t_s, {value[0], value[1], value[2]}, {0}};
    nav_koi_take(k, &m);
}

/* Coarse attitude, then zero velocity every second, then the correction of what was found. */
static nav_koi *align(const double place[3])
{
    struct nav_koi_cfg cfg;
    struct nav_state at = {.lat_rad = place[0], .lon_rad = place[1], .h_m = place[2]};
    const unsigned char moving[STATES] = {1, 1, 1, 1, 1, 1, 1, 1, 1}; /* place, velocity, attitude */
    nav_koi *k;
    check(nav_koi_default(NAV_KOI_BINS, &cfg), "class");
    cfg.alignment_s = 0.0; /* its errors are found here, not assumed */
    cfg.alpha_sd_rad = 0.0006;
    cfg.beta3_sd_rad = 0.03;
    check(nav_koi_coarse(angle[0], velocity[0], COARSE_S * RATE, 0.01, at.lat_rad, at.C_nb, NULL, NULL), "coarse");
    check(nav_koi_start(malloc(nav_koi_bytes()), nav_koi_bytes(), &cfg, 0.0, &at, NULL, NULL, NULL, &k), "start");
    for (int s = 0; s < ALIGN_S; s++) {
        check(nav_koi_push(k, angle[s * RATE], velocity[s * RATE], RATE), "increments");
        take(k, NAV_KOI_STOP, s + 1, none);
    }
    check(nav_koi_correct(k, moving), "alignment");
    return k;
}

static void print_state(const struct nav_koi_state *s)
{
    const struct nav_state *h = &s->hybrid, *a = &s->autonomous;
    printf("%5.0f s  %.4f %.4f deg %5.0f m  %5.1f m/s; autonomous %+5.0f m north, %+5.0f m east of it\n", s->t_s,
           h->lat_rad / DEG, h->lon_rad / DEG, h->h_m, hypot(h->v_n_mps[0], h->v_n_mps[1]),
           (a->lat_rad - h->lat_rad) * EARTH_M, (a->lon_rad - h->lon_rad) * EARTH_M * cos(h->lat_rad));
}

/* Zero velocity at stops. At take-off the one-off correction, once; whether to believe the estimates: psabench.koi.take_off. */
static void end_second(nav_koi *k, int *corrected)
{
    unsigned char good[STATES];
    struct nav_koi_state s;
    nav_koi_get(k, &s);
    const double speed_mps = hypot(s.hybrid.v_n_mps[0], s.hybrid.v_n_mps[1]);
    if (speed_mps < 0.3) take(k, NAV_KOI_STOP, s.t_s, none);
    if (speed_mps > 40.0 && !(*corrected)++) {
        printf("take-off after %.0f s: %d of the states are corrected\n", s.t_s, nav_koi_converged(k, 0.7, good));
        check(nav_koi_correct(k, good), "correction");
    }
    if ((long)s.t_s % 120 == 0) print_state(&s);
}

int main(int argc, char **argv)
{
    FILE *file = fopen(argc == 2 ? argv[1] : "", "r");
    double f[7], fix[7] = {0};
    char kind;
    int corrected = 0;
    nav_koi *k = NULL;
    if (!file) return fprintf(stderr, "navigate: expected a recorded flight, got none\n"), 2;
    for (long line = 1, samples = 0; fscanf(file, " %c", &kind) == 1; line++) {
        const int count = kind == 'I' ? 6 : kind == 'F' ? 7 : kind == 'H' ? 2 : 0;
        int read = 0;
        while (read < count && fscanf(file, "%lf", &f[read]) == 1) read++;
        if (!count || read < count) return fprintf(stderr, "navigate: line %ld: expected I, F, H\n", line), 1;
        if (kind == 'I' && samples < ALIGN_S * RATE)
            memcpy(angle[samples], f, 24), memcpy(velocity[samples], f + 3, 24);
        if (kind == 'I' && k) check(nav_koi_push(k, f, f + 3, 1), "increments");
        if (kind == 'I' && ++samples == ALIGN_S * RATE) k = align(fix + 1);
        else if (kind == 'I' && k && samples % RATE == 0) end_second(k, &corrected);
        if (kind == 'F') memcpy(fix, f, sizeof f);
        if (kind == 'F' && k) take(k, NAV_KOI_POSITION, f[0], f + 1), take(k, NAV_KOI_VELOCITY, f[0], f + 4);
        if (kind == 'H' && k) take(k, NAV_KOI_HEIGHT, f[0], f + 1);
    }
    return fclose(file), k ? 0 : 1;
}

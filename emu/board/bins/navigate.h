/* The unit's own navigation: aligns at rest, then navigates by its own increments, with all their errors. n is east, north, up. */
#ifndef PSABENCH_BOARD_BINS_NAVIGATE_H
#define PSABENCH_BOARD_BINS_NAVIGATE_H

#include <stdbool.h>
#include <stdint.h>

#define BINS_ALIGNMENT_S 600.0

struct bins_reading;

enum bins_nav_state { BINS_NAV_OFF, BINS_NAV_ALIGNING, BINS_NAV_RUNNING, BINS_NAV_FAILED };

/* What an operator sets before it starts; kept over a stop. */
struct bins_nav_settings {
    double lat_rad, lon_rad, h_m, alignment_s;
};

/* The unit's own navigation; n is east, north, up. */
struct bins_nav {
    struct bins_nav_settings set, taken; /* for the next start; at the last one */
    enum bins_nav_state state;
    bool due; /* outputs, after this reading */
    uint32_t since, every;
    double gyro_rad, accel_mps; /* of a count, of a code */
    int64_t t_ns;               /* end of the last reading */
    double time_s;              /* of the alignment */
    double rate[3], force[3];   /* sums of it, in b */
    double lat_rad, lon_rad;
    double v_mps[2]; /* east, north */
    double q[4];     /* b to n, scalar first */
    double a_before[3], v_before[3];
    double turned_rad[3]; /* since the outputs before, in b */
    int64_t shown_ns;     /* when those were */
};

/* From the end of this reading on; gyro_rad, accel_mps: of a count, of a code. The settings are taken as they are. */
void bins_nav_start(struct bins_nav *n, const struct bins_reading *from, uint32_t every, double gyro_rad,
                    double accel_mps);
void bins_nav_stop(struct bins_nav *n);
bool bins_nav_take(struct bins_nav *n, const struct bins_reading *r); /* true: outputs are due */
void bins_nav_rates(const struct bins_nav *n, double w_radps[3]);     /* mean since the outputs before */
void bins_nav_shown(struct bins_nav *n);

#endif

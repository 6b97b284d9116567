/* Motion of one axis of a table: what it was given, and where that takes it under its limits.
 *
 * A command makes a plan: pieces of constant acceleration, then rest, a constant rate or a sine. Angle, rate and acceleration
 * are closed forms of time; a command in mid-motion starts from the angle and rate of that instant, so both are continuous.
 * A rejected command changes nothing. The axis knows its last MOTION_HISTORY plans: an instant before the latest command gets
 * the state of then. Plain struct, one thread; commands in order of time. */
#ifndef PSABENCH_PHYS_MOTION_MOTION_H
#define PSABENCH_PHYS_MOTION_MOTION_H

#include <stdbool.h>
#include <stdint.h>

#define MOTION_PROFILE_MAX 32u /* points of a rate profile */
#define MOTION_PIECES      (2u * MOTION_PROFILE_MAX + 4u)
#define MOTION_HISTORY     4u

enum motion_mode { MOTION_STOPPED, MOTION_POSITION, MOTION_RATE, MOTION_PROFILE, MOTION_SINE };

enum motion_result {
    MOTION_OK,
    MOTION_RATE_LIMIT,  /* asks for more rate than the axis has */
    MOTION_ACCEL_LIMIT, /* a sine, or two steps of a profile, ask for more acceleration */
    MOTION_ANGLE_LIMIT, /* would leave the axis's range of angles */
    MOTION_BAD_PROFILE, /* no points, too many, or times that do not rise from 0 */
    MOTION_BAD_SINE,    /* amplitude or frequency not above 0 */
    MOTION_NO_AXIS      /* the table has no such axis */
};

struct motion_limits {
    double rate_radps, accel_radps2; /* both above 0 */
    bool bounded;
    double min_rad, max_rad; /* if bounded */
};

struct motion_state {
    double angle_rad, rate_radps, accel_radps2;
};

/* From t_s after the plan's start until the next piece. */
struct motion_piece {
    double t_s;
    struct motion_state from; /* acceleration stays */
};

struct motion_plan {
    enum motion_mode mode;
    int64_t start_ns;
    unsigned count;
    struct motion_piece piece[MOTION_PIECES];
    double sine_rad, sine_hz; /* of the last piece, which starts at the sine's lowest point; 0 Hz: none */
    bool ends;                /* the last piece is rest */
};

struct motion {
    struct motion_limits limits;
    struct motion_plan plan[MOTION_HISTORY];
    unsigned latest; /* index of the plan under way */
};

/* At rest at angle 0, or at the nearest angle that the limits allow. */
void motion_init(struct motion *m, const struct motion_limits *limits);

/* To the angle, at rest there, no faster than rate_radps (0: the axis's limit). */
enum motion_result motion_position(struct motion *m, double angle_rad, double rate_radps, int64_t t_ns);

/* To the rate, and on; a bounded axis comes to rest at its limit. */
enum motion_result motion_rate(struct motion *m, double rate_radps, int64_t t_ns);

/* At times_s[i] after the command the axis starts towards rates_radps[i] with its acceleration limit: rates constant but for
 * the ramps, as the calibration plans want them. Each ramp has to end before the next begins. The last rate goes on. */
enum motion_result motion_profile(struct motion *m, const double *times_s, const double *rates_radps, unsigned n,
                                  int64_t t_ns);

/* About the angle at which the axis would stop: it goes to the lowest point first, at rest there, and swings from then on. */
enum motion_result motion_sine(struct motion *m, double amplitude_rad, double frequency_hz, int64_t t_ns);

/* To rest with the acceleration limit. */
void motion_stop(struct motion *m, int64_t t_ns);

struct motion_state motion_at(const struct motion *m, int64_t t_ns);
enum motion_mode motion_mode(const struct motion *m);
bool motion_at_rest(const struct motion *m, int64_t t_ns);

/* From which instant on motion_at() knows: the start of the oldest plan that is kept. */
int64_t motion_known_ns(const struct motion *m);

/* The first instant after t_ns at which the acceleration may jump without a further command; INT64_MAX: none. */
int64_t motion_smooth_ns(const struct motion *m, int64_t t_ns);

/* When the present motion ends or the last one ended; INT64_MAX if it does not end. */
int64_t motion_rest_ns(const struct motion *m);

/* "stopped", "position", "rate", "profile", "sine"; "exceeds the rate limit" and so on. */
const char *motion_mode_name(enum motion_mode mode);
const char *motion_result_text(enum motion_result result);

#endif

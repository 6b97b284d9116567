/* Gyro unit: controller of a two-axis gyro-stabilised platform (docs/boards/gyro.md, docs/reference/protocol_gyro.md).
 *
 * A hundred times a second it takes what the level unit has sent since the step before, its angle sensor and its settings, and
 * asks the torquers for two rates; runs of positions are turns, settling and windows, step by step. Of the platform it knows
 * the angle sensor alone, and the codes of the level sensors: the truth is nowhere in here. It has no analog inputs of its own.
 * Plain struct owned by the caller, one thread, no allocation. */
#ifndef PSABENCH_BOARD_GYRO_GYRO_H
#define PSABENCH_BOARD_GYRO_GYRO_H

#include "base/sched.h"
#include "board/board.h"
#include "board/gyro/law.h"
#include "board/gyro/profile.h"

#include <stdbool.h>
#include <stdint.h>

#define GYRO_POSITIONS 32u
#define GYRO_RUN_MAX   127u                   /* positions of a run, repeats included */
#define GYRO_VOLTS     1.1920928955078125e-06 /* of a code of the level unit: 10 V / 2^23 at the load */

enum gyro_mode { GYRO_OFF, GYRO_LEVEL, GYRO_HOLD, GYRO_SLEW, GYRO_COMPASS, GYRO_CALIBRATE, GYRO_NAVIGATE, GYRO_MODES };
enum gyro_phase { GYRO_IDLE, GYRO_SLEWING, GYRO_SETTLING, GYRO_WINDOW };

enum gyro_flag { /* of a reading */
                 GYRO_SATURATED = 1,
                 GYRO_LEVEL_LOST = 2,
                 GYRO_ENCODER_FAULT = 4,
                 GYRO_NOT_SETTLED = 8
};
#define GYRO_FLAGS 4u

enum gyro_test { GYRO_TEST_NONE, GYRO_TEST_PASSED, GYRO_TEST_FAILED, GYRO_TEST_UNCLEAR };

enum gyro_line {
    GYRO_LINE_STEP, /* a pulse of GYRO_STEP_PULSE_NS each step */
    GYRO_LINE_READY,
    GYRO_LINE_SLEW,
    GYRO_LINE_SETTLE,
    GYRO_LINE_WINDOW,
    GYRO_LINE_FAULT, /* any flag is set */
    GYRO_LINES
};
#define GYRO_STEP_PULSE_NS 100000

#define GYRO_EVENT_LIST(X)                                                                                             \
    X(GYRO, RES)                                                                                                       \
    X(GYRO, READY)                                                                                                     \
    X(GYRO, STEP)                                                                                                      \
    X(GYRO, MODE)                                                                                                      \
    X(GYRO, SLEW)   /* a turn begins */                                                                                \
    X(GYRO, WINDOW) /* a window begins */                                                                              \
    X(GYRO, WINDOW_END)                                                                                                \
    X(GYRO, FAULT) /* a flag has come */                                                                               \
    X(GYRO, POWER_DOWN)                                                                                                \
    X(GYRO, POWER_UP)
enum gyro_event { GYRO_EVENT_LIST(BOARD_EVENT) GYRO_EVENTS };

/* By object, docs/reference/protocol_gyro.md; numbers as the object dictionary has them. */
struct gyro_settings {
    double slew_deg, slew_dps, slew_dps2, settle_s, settle_limit_s, tolerance_arcmin;
    double count, repeat, window_s, calibration_s, freeze;
    double position_deg[GYRO_POSITIONS];
    double m1_per_s, m2_per_s;
    double latitude_deg, speed_mps, track_deg;
    double azimuth_deg;
    double drift1_degph, drift2_degph;
    double zero_x_v, zero_y_v, scale_x_v_per_g, scale_y_v_per_g;
};

/* What a step came to. */
struct gyro_reading {
    uint32_t step; /* since Res, from 1 */
    enum gyro_mode mode;
    enum gyro_phase phase;
    unsigned position; /* of the run, from 1; 0: none */
    unsigned flags;    /* enum gyro_flag */
    double u1_radps, u2_radps;
    double encoder_rad, beta_rad, gamma_rad;
    uint16_t level_seq;
    bool magnetic; /* an induction sensor is fitted */
    double magnetic_rad;
};

struct gyro_counters {
    uint32_t steps, res, level_frames, level_lost, level_silent, saturated, windows, unsettled, encoder_faults, refused;
};

/* Receiver of the readings, and of the conditions (enum gyro_flag) as they begin and end. */
struct gyro_host {
    void *ctx;
    void (*reading)(void *ctx, const struct gyro_reading *r, int64_t t_ns);
    void (*condition)(void *ctx, enum gyro_flag what, bool active, int64_t t_ns);
};

#include "board/gyro/state.h" /* struct gyro, read-only outside the board's own files */

/* Faults of the controller: bits of board.faults. */
enum gyro_controller_fault {
    GYRO_FAULT_FROZEN_WORDS = 4 /* the reading before, over and over */
};

extern const char *const gyro_events[GYRO_EVENTS];
extern const struct board_line gyro_lines[GYRO_LINES];

void gyro_init(struct gyro *b, const struct gyro_profile *p, const struct board_cfg *cfg, const struct board_io *io,
               struct sched *s);
void gyro_power_up(struct gyro *b, int64_t t_ns);
void gyro_power_down(struct gyro *b, int64_t t_ns);
void gyro_reset(struct gyro *b, int64_t t_ns); /* settings to their defaults, mode 0 */
void gyro_sample_until(struct gyro *b, int64_t t_ns);

/* A frame of the level unit. */
void gyro_take_level(struct gyro *b, int32_t x_lsb, int32_t y_lsb, uint16_t seq, int64_t t_ns);

/* Takes over what was written to set. */
void gyro_settings_changed(struct gyro *b);

/* NULL, or why it is rejected. */
const char *gyro_set_mode(struct gyro *b, enum gyro_mode mode, int64_t t_ns);

/* In navigation: nods once or up to three times, a tenth of a degree there and back, and looks whether the angle sensor follows;
 * b->nod.result. NULL, or why it is rejected. */
const char *gyro_self_test(struct gyro *b, int64_t t_ns);
bool gyro_running(const struct gyro *b); /* a run of positions, or a calibration */

double gyro_heading_deg(const struct gyro *b); /* of mode 6, 0 to 360 */

#endif

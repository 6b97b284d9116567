/* State of a gyro unit: included by board/gyro/gyro.h, read-only outside board/gyro*.c. */
#ifndef PSABENCH_BOARD_GYRO_STATE_H
#define PSABENCH_BOARD_GYRO_STATE_H

/* Codes of the level unit since the step before. */
struct gyro_inlet {
    int64_t x_lsb, y_lsb;
    unsigned frames;
    bool any, gap; /* ever, since Res; a frame is missing */
    uint16_t seq;  /* of the last */
    int64_t last_ns;
};

struct gyro_run {
    enum gyro_mode mode;
    enum gyro_phase phase;
    unsigned position, positions; /* under way, of so many */
    bool servoed;                 /* q_ref is held */
    double q_ref_rad;
    struct gyro_turn turn;
    int64_t phase_ns;   /* began */
    double servo_radps; /* the servo's part of u2, summed over the last second of settling */
    unsigned servo_steps;
    bool frozen; /* in a window: its mean in place of the servo */
    double frozen_radps;
};

/* The angle sensor against the torquer, half a second at a time, while servoed. */
struct gyro_check {
    unsigned steps;
    double turned_rad, from_rad;
};

/* In navigation (gyro/check.c). */
struct gyro_watch {
    double turned_rad, from_rad,
        track_deg;    /* of a block: asked of the azimuth torquer; sensor and track when it began */
    unsigned against; /* blocks in a row */
    int64_t level_ns; /* last level */
    double still_rad; /* the sensor has not left its degree, */
    int64_t still_ns; /* since then */
    double told_deg;  /* reported track at that time */
    int64_t told_ns;  /* last time it was still the same */
};

struct gyro_nod {
    enum { GYRO_NOD_NONE, GYRO_NOD_REST, GYRO_NOD_THERE, GYRO_NOD_BACK } way;
    enum gyro_test result;
    unsigned nods, stayed; /* so many so far; of them the sensor stayed where it was */
    int64_t begun_ns, there_ns;
    double from_rad, top_rad, rate_radps;
};

/* A condition since the mode began. */
struct gyro_past {
    uint32_t begun, step; /* how often; the step in which it did last */
};

struct gyro {
    struct board base;
    struct gyro_profile profile;
    struct gyro_host host; /* set by the receiver */
    struct gyro_counters counters;

    bool on, ready;
    uint32_t number; /* of the step, since Res */
    struct sched_ev step;
    struct gyro_settings set;
    struct gyro_place place; /* of the settings */
    double sin_a, cos_a;     /* of the azimuth angle given */
    struct gyro_inlet inlet;
    struct gyro_level level; /* latest */
    double servo_rad;        /* of this step */
    struct gyro_run run;
    struct gyro_check check;
    struct gyro_watch watch;
    struct gyro_nod nod;
    struct gyro_past past[GYRO_FLAGS];
    double u_radps[2];  /* asked of the torquers, as limited */
    unsigned flags;     /* of this step */
    bool silent;        /* the level unit */
    unsigned standing;  /* conditions notified to the host */
    int64_t calm_ns[2]; /* last time the level was lost, a rate limited */
    struct gyro_reading latest;
};

#endif

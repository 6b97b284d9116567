/* БИНС: an inertial unit, three accelerometers read by a PSA-2 and three counting gyros, as those of PSD-1's registers, joined by
 * a computer that sends increments of velocity and angle.
 *
 * The union is ours (E0): PSA-2 is of БИНС-СП-2, PSD-1 of БИНС-СП-1. The struct begins with a whole PSA-2, whose frames go to the
 * computer. From its data-ready the computer knows when a sum of words ends, less the converters' delay, and latches the gyros
 * then. Plain struct owned by the caller, one thread, no allocation. */
#ifndef PSABENCH_BOARD_BINS_BINS_H
#define PSABENCH_BOARD_BINS_BINS_H

#include "board/bins/navigate.h"
#include "board/bins/profile.h"
#include "board/psa2/inside.h"
#include "phys/sensor/inertial.h"
#include "phys/sensor/noise.h"

#define BINS_TICK_PULSE_NS 100000
#define BINS_LATCHES       8u /* that wait for their words */

enum bins_line { BINS_LINE_TICK = PSA2_LINES, BINS_LINES }; /* a pulse when the gyros are latched */
extern const struct board_line bins_lines[BINS_LINES];

enum bins_event { BINS_EV_LATCH = PSA2_EVENTS, BINS_EV_READING, BINS_EVENTS };
extern const char *const bins_events[BINS_EVENTS];

/* Faults of the controller: bits of board.faults, beside those of a PSA-2. */
enum bins_controller_fault {
    BINS_FAULT_FROZEN_WORDS = 0x100
}; /* the increments of the reading before, over and over */

/* bins_reading.flags */
enum bins_flag {
    BINS_SETTLED = 1,    /* the converters had settled in each word */
    BINS_CLIP = 2,       /* a word was at its limit */
    BINS_INCOMPLETE = 4, /* words are missing in the sums */
    BINS_STRETCHED = 8,  /* the interval is longer than one period: a latch is missing */
    BINS_TEMP_NEW = 16   /* a temperature has come since the reading before */
};

/* Increments since the reading before, in the instrument's axes. */
struct bins_reading {
    uint32_t seq;     /* from power-up or reset, from 1 */
    int64_t t_ns;     /* end of the interval of the gyros */
    int32_t gyro[3];  /* counts */
    int32_t accel[3]; /* sums of codes; a code is truncated: half of one is missing in each word */
    uint8_t words, flags;
    int32_t baro_mm; /* height that the barometric altimeter shows at t_ns */
};

struct bins_counters {
    uint32_t readings, resets;
    uint32_t missed_words;   /* frames of the PSA-2 that did not come */
    uint32_t missed_latches; /* intervals without a latch: the reading after is longer */
    uint32_t saturated;      /* readings with a word at its limit */
};

struct bins_host {
    void *ctx;
    void (*reading)(void *ctx, const struct bins_reading *r, int64_t t_ns);
    void (*navigated)(void *ctx, int64_t t_ns);            /* after the reading: outputs of bins.nav are due */
    void (*fault)(void *ctx, uint16_t code, int64_t t_ns); /* enum psa2_fault */
};

/* Counts of the gyros at an instant. */
struct bins_latch {
    uint32_t last_word; /* of the interval that ends there */
    int64_t t_ns;
    int64_t count[3];
};

struct bins_gyros {
    int64_t t_ns; /* integrated up to here; -1: without power */
    double angle_rad[3];
    double walk_rad; /* of the noise in a step */
    struct draws noise[3];
    struct noise slow[3]; /* rad/s: bias instability */
    struct board_gyro_fault fault[3];
    bool limited[3]; /* at its fault's limit */
    struct sched_ev ev;
};

/* The computer's sums and latches. */
struct bins_sums {
    bool based;       /* from which a reading begins is known */
    uint32_t word;    /* number of the last, from 0 */
    int64_t word_ns;  /* its data-ready, when it was due; -1: none has come */
    uint32_t words;   /* in the sums */
    int64_t delay_ns; /* of the converters, known from the first word on */
    int64_t sum[3];
    uint8_t status; /* of all of them: enum psa2_status, SETTLED and CLIP turned into what is wrong */
    bool incomplete, temp_new;
    struct bins_latch from; /* of the reading before */
    uint32_t next;          /* interval whose latch comes next */
    struct bins_latch latch[BINS_LATCHES];
    unsigned first, count;
    struct sched_ev ev; /* of the next latch */
};

struct bins {
    struct psa2 psa2; /* first; its base is the board's */
    struct bins_profile profile;
    struct bins_host host;
    struct inertial_errors errors;
    struct bins_gyros gyros;
    struct bins_sums sums;
    struct bins_counters counters;
    struct bins_reading latest;
    uint16_t temp_code[4];
    struct bins_nav nav;
};

void bins_init(struct bins *b, const struct bins_profile *p, const struct board_cfg *cfg, const struct board_io *io,
               struct sched *s);
void bins_power_up(struct bins *b, int64_t t_ns);
void bins_power_down(struct bins *b, int64_t t_ns);
void bins_reset(struct bins *b, int64_t t_ns);
void bins_sample_until(struct bins *b, int64_t t_ns);

/* What the unit knows of itself. */
int64_t bins_word_ns(const struct bins *b); /* between two words */
int64_t
bins_accel_age_ns(const struct bins *b); /* by how much the sums' interval is older than the gyros'; 0: aligned */
double bins_accel_mps_per_code(const struct bins *b); /* a code of a word, as velocity */

/* ---- bins/gyro.c: counts of the angle about each axis, exact integrals of what the lab has as functions of time ---- */
void bins_gyro_init(struct bins *b);
void bins_gyro_power(struct bins *b, bool on, int64_t t_ns);
void bins_gyro_until(struct bins *b, int64_t t_ns);
void bins_gyro_counts(struct bins *b, int64_t t_ns, int64_t count[3]);
extern const struct board_gyros bins_gyros_faults;

#endif

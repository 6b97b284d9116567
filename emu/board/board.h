/* What every board gives the bench: one const table a type. The bench, links, control, faults, snapshots and scenarios know
 * boards only through it; unit/boards.h lists the types.
 *
 * A board is a plain struct that its unit owns, one thread, no allocation; its first member is a struct board. `can` points to
 * its CAN side, `profile` to its profile struct. Times are simulated ns since power-on of the bench. */
#ifndef PSABENCH_BOARD_BOARD_H
#define PSABENCH_BOARD_BOARD_H

#include "base/sched.h"
#include "base/sha256.h"
#include "board/bus.h"
#include "board/can.h"
#include "board/cfg.h"
#include "board/field.h"
#include "board/gyros.h"
#include "board/part.h"
#include "board/satellite.h"
#include "board/serial.h"
#include "phys/sensor/mems.h"
#include "trace/line_fault.h"
#include "trace/trace.h"

#define BOARD_NOISES_MAX 9u

struct board {
    const struct board_type *type; /* set by the unit */
    struct trace trace;            /* lines numbered as in board_type.lines */
    struct line_faults line;
    struct board_cfg cfg;
    struct board_io io;
    struct sched *sched;
    struct afe afe[BOARD_AXES]; /* its analog inputs, if it has any */
    uint32_t faults;            /* of the controller: bits of board_type.controller_faults; outlive resets and power */
    bool observed;              /* board_io.event has a subscriber */
};

/* Fault of the controller, "controller.frozen_words", and its bit in board.faults. */
struct board_controller_fault {
    const char *kind;
    uint32_t bit;
};

/* Operations on the gyro-stabilised platform that the board controls. */
struct board_platform {
    const char *(*set_mode)(struct board *b, unsigned mode,
                            int64_t t_ns); /* enum gyro_mode; NULL, or why it is rejected */
};

typedef void board_truth_fn(void *ctx, const char *name, double value);

struct board_type {
    const char *name, *title; /* "psa2", "PSA-2" */
    size_t size;              /* of its struct */
    /* profile */
    const struct fields *fields; /* of its struct, each with its default */
    const char *profile_name;    /* default file in proto/profiles */
    bool (*profile_check)(const void *profile, char *why,
                          size_t cap);                                /* false: a sentence that begins with the field */
    void (*about)(const void *profile, char *out, size_t cap);        /* a line for lists of profiles */
    void (*cfg_default)(struct board_cfg *cfg);                       /* its usual analog chain; may be NULL */
    void (*cfg_profiled)(struct board_cfg *cfg, const void *profile); /* after it, what the profile says; may be NULL */
    const char *const *capabilities; /* keys of a scenario's unit that not every board has, up to NULL; may be NULL */
    uint8_t node;                    /* default node id on CAN */
    uint8_t frame_forms;             /* values of object 2020h; 0: it has no such object */
    int64_t (*period_ns)(const void *profile); /* of its frames (cycles, readings) */
    /* what is on it */
    const struct board_line *lines;
    unsigned line_count, pair_count, event_count, part_count; /* rows of lines, pairs, events, parts */
    const char *const *port_lines;  /* bits 0.. of the line port's byte, up to 7 names, then NULL */
    const struct board_pair *pairs; /* signals behind its lines: A and B of the first, of the next ...; NULL: none */
    const char *const *pair_port_lines;        /* of the line port with wires; NULL: as without */
    unsigned frame_line;                       /* whose falls begin a frame */
    unsigned pulse_line;                       /* whose pulses have their number in a frame */
    unsigned (*pulses)(const struct board *b); /* how many of them; NULL: no line has such pulses */
    /* what a fault of a sensor must come to, to be seen */
    double (*code_v)(const struct board *b);  /* a code at the load, V (integrator: a count a second); NULL: 2 uV */
    double (*range_v)(const struct board *b); /* full scale at the load; NULL: 10 V */
    const char *const *events;
    const struct board_part *parts; /* [0] is the controller */
    const char *const *temps;       /* its temperature sensors whose leads may open, up to NULL; NULL: none */
    unsigned (*temp_count)(const struct board *b);          /* how many of them it reads, by its profile */
    void (*open_temps)(struct board *b, uint32_t open);     /* bit n: the lead of the n-th, from now on */
    const struct board_controller_fault *controller_faults; /* up to a NULL kind */
    const struct board_can *can;
    const struct board_bus *bus;           /* NULL: no parallel bus */
    const struct board_platform *platform; /* NULL: it controls none */
    const struct board_receiver *receiver; /* NULL: it is none */
    const struct board_gyros *gyros;       /* that count; NULL: it has none */
    const struct board_serial *serial;     /* NULL: it has no serial port */
    /* life */
    void (*init)(struct board *b, const void *profile, const struct board_cfg *cfg, const struct board_io *io,
                 struct sched *s);
    void (*power_up)(struct board *b, int64_t t_ns);
    void (*power_down)(struct board *b, int64_t t_ns);
    void (*reset)(struct board *b, int64_t t_ns);
    bool (*ready)(const struct board *b);
    void (*sample_until)(struct board *b, int64_t t_ns); /* takes its inputs; then the physics may change abruptly */
    /* Why it computes what no one looks at from t_ns on; a sentence without its end. NULL: it does not. No function: always. */
    const char *(*why_eager)(struct board *b, int64_t t_ns);
    void (*set_faults)(struct board *b, uint32_t faults); /* where more than board.faults changes; may be NULL */
    void (*observe)(struct board *b, bool on);            /* board.observed is about to change; may be NULL */
    unsigned (*noises)(struct board *b, struct draws *at[BOARD_NOISES_MAX]); /* converters, gyros; NULL: none */
    /* Its own accelerometer of a channel, where the bench puts no other sensor there; g: the site's. NULL: it has none. */
    void (*accelerometer)(const struct board *b, unsigned axis, double g_mps2, struct mems_g *m);
    bool analog; /* it has analog inputs; for faults: sample_until() first */
    void (*digest)(const struct board *b, struct sha256 *s); /* of all that its future depends on */
    void (*truth)(const struct board *b, board_truth_fn *put,
                  void *ctx); /* hidden parameters of the specimen; may be NULL */
};

/* All zero, first of all in NAME_init(): no state of an earlier run. The room for pending steps, of which there are none, is
 * left as it is: nine tenths of a board, which takes no memory until its lines are watched. size: of the whole board. */
void board_clear(struct board *b, size_t size);

/* The base of a board: its trace with these lines, its specimen's analog inputs, no faults. */
void board_init(struct board *b, const struct board_line *lines, unsigned count, const struct board_cfg *cfg,
                const struct board_io *io, struct sched *s);

/* What the specimen is off by. */
static inline struct rng board_noise(const struct board *b, const char *source)
{
    return rng_stream(b->cfg.seed, b->cfg.serial, source);
}

/* The white noise of one of them. */
static inline struct draws board_draws(const struct board *b, const char *source)
{
    return draws_of(b->cfg.seed, b->cfg.serial, source);
}

/* An event, a number in board_type.events. */
static inline void board_notify(const struct board *b, unsigned event, int64_t t_ns)
{
    if (b->observed) b->io.event(b->io.ctx, event, t_ns);
}

/* A hidden parameter whose name has parts: "axis_x_gyro_bias_radps". */
__attribute__((format(printf, 4, 5))) void board_put_truth(board_truth_fn *put, void *ctx, double value,
                                                           const char *name, ...);

/* Noise of its analog inputs, converters and gyros comes from another seed from here on; the specimen stays what it is. */
void board_reseed(struct board *b, uint64_t seed);

bool board_has(const struct board_type *t, const char *capability);
uint32_t board_fault_bit(const struct board_type *t,
                         const char *kind);              /* of a kind controller.*; 0: it cannot have it */
void board_set_faults(struct board *b, uint32_t faults); /* of the controller, from now on */
void board_observe(struct board *b, bool on);            /* events are reported, or no more */

#endif

/* What every board gives the bench: one const table a type. The bench, links, control, faults, snapshots and scenarios know
 * boards only through it; board/boards.c lists the types.
 *
 * A board is a plain struct that its unit owns, one thread, no allocation. `board` is a pointer to that struct, `can` one to
 * its CAN side, `profile` one to its profile struct. Times are simulated ns since power-on of the bench. */
#ifndef PSABENCH_BOARD_BOARD_H
#define PSABENCH_BOARD_BOARD_H

#include "base/can.h"
#include "base/sched.h"
#include "base/sha256.h"
#include "board/afe.h"
#include "board/board_field.h"
#include "chip/ads1282.h"
#include "trace/line_fault.h"
#include "trace/trace.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define BOARD_AXES 3u

/* What a board can reach of the world. */
struct board_io {
    void *ctx;
    /* Sensor output, A or V by the channel's afe_cfg.input; t_ns never earlier than the axis's last call. Whoever changes the
     * physics abruptly calls sample_until() first. */
    double (*accel)(void *ctx, unsigned axis, int64_t t_ns);
    double (*temp_degc)(void *ctx, unsigned channel, int64_t t_ns); /* at X, Y, Z sensor and the board itself (3) */
    void (*rate_radps)(void *ctx, int64_t t_ns, double w_ib_b[3]);  /* inertial rate, axes of the unit's case */
    void (*event)(void *ctx, unsigned event, int64_t t_ns);         /* number in board_type.events; may be NULL */
};

/* One specimen: what differs between two boards of a profile. */
struct board_cfg {
    struct afe_cfg afe[BOARD_AXES];
    double adc_noise_scale, temp_noise_scale;      /* 1 published, 0 none */
    enum ads1282_chain adc_chain;                  /* PSA-2 */
    double temp_adc_offset_v, temp_adc_gain_error; /* PSA-2 */
    uint64_t seed;
    uint32_t serial;
};

struct board_line {
    const char *name; /* article's, "Int" */
    bool level;       /* before the first power-up and at rest */
};

struct board_counter {
    const char *name;
    size_t offset; /* of a uint32_t in the part */
};

/* What can be wrong with a chip: the sum of the faults that are active on it. */
struct board_chip_fault {
    bool drdy_stuck, drdy_level, dout_stuck, dout_level, lost_sync;
    int32_t clock_ppm;
};
enum board_chip_fault_bit { /* which of them a part has; why not the others stands in board_part.unless */
                            BOARD_FAULT_DRDY = 1,
                            BOARD_FAULT_DOUT = 2,
                            BOARD_FAULT_SYNC = 4,
                            BOARD_FAULT_CLOCK = 8
};

/* A chip, or the controller (part 0, label "board"): its counters, and where faults of kinds chip.* go. */
struct board_part {
    const char *name;  /* of its fault point: "adc.x"; NULL: no faults */
    const char *label; /* of its counters: "adc_x" */
    size_t offset;     /* in the board's struct */
    const struct board_counter *counters;
    unsigned counter_count;
    uint32_t faults;    /* enum board_chip_fault_bit */
    const char *unless; /* why it has not the others, one sentence; or NULL */
    unsigned registers; /* that can be flipped, from 0 */
    void (*fault)(void *board, unsigned part, const struct board_chip_fault *f, int64_t t_ns);
    bool (*flip)(void *board, unsigned part, unsigned reg, uint8_t mask, int64_t t_ns); /* false: without power */
};

/* One cycle on the parallel bus by which the navigation computer reads a board (PSD-1, PMKA, PIK). Owned by the caller
 * until done() has been called. */
enum board_cycle_result {
    BOARD_CYCLE_OK,
    BOARD_CYCLE_NO_ADDRESS, /* nothing answers at this address */
    BOARD_CYCLE_READ_ONLY,
    BOARD_CYCLE_WRITE_ONLY,
    BOARD_CYCLE_NOT_READY, /* too early: no word waits */
    BOARD_CYCLE_TOO_SHORT, /* the strobe is shorter than the board needs */
    BOARD_CYCLE_BUSY,      /* a cycle is under way */
    BOARD_CYCLE_BAD_VALUE,
    BOARD_CYCLE_OFF /* no power, or cut by a reset */
};
struct board_cycle {
    bool write;
    uint8_t address;   /* A3..A0 */
    uint16_t data;     /* written, or what was read */
    int64_t strobe_ns; /* length; 0: the profile's */
    void (*done)(void *ctx, struct board_cycle *c, enum board_cycle_result r, int64_t t_ns);
    void *ctx;
};
struct board_bus {
    /* BOARD_CYCLE_OK: done() will be called later, never from inside; else it will not. */
    enum board_cycle_result (*submit)(void *board, struct board_cycle *c, int64_t t_ns);
    unsigned addresses;
    const char *(*name)(unsigned address); /* of what is there: "X"; NULL: nothing */
};

struct co_node;
struct board_can_cfg {
    const char *name;                                              /* kept by pointer */
    uint8_t node_id;                                               /* 1..127 */
    void (*refused)(void *ctx, const char *name, const char *why); /* a setting was refused, in words; may be NULL */
    void *ctx;
};
struct board_can {
    size_t size;
    /* Wires itself to the board's callbacks; the board has been initialised. */
    void (*init)(void *can, const struct board_can_cfg *cfg, void *board, struct can_bus *bus, struct sched *s);
    void (*power_up)(void *can, int64_t t_ns); /* after the board's */
    void (*power_down)(void *can);
    struct co_node *(*node)(void *can);
};

/* Faults of a controller, kinds controller.*: bits of board_type.wrongs. */
enum board_wrong {
    BOARD_WRONG_SKIP_SYNC_T = 1, /* PSA-2: never a pulse on SYNC_T */
    BOARD_WRONG_SETUP_ORDER = 2, /* PSA-2: the set-up's steps in reverse order, from the next Res on */
    BOARD_WRONG_FROZEN_WORDS = 4 /* the words of the frame (cycle, period) before, over and over */
};

typedef void board_truth_fn(void *ctx, const char *name, double value);

struct board_type {
    const char *name, *title; /* "psa2", "PSA-2" */
    size_t size;              /* of its struct */
    /* profile */
    size_t profile_size;
    const struct board_field *fields;
    unsigned field_count;
    const char *profile_name; /* default file in proto/profiles */
    void (*profile_default)(void *profile);
    bool (*profile_check)(const void *profile, char *why,
                          size_t cap);          /* false: a sentence that begins with the field */
    void (*cfg_default)(struct board_cfg *cfg); /* its usual analog chain; may be NULL */
    int64_t (*period_ns)(const void *profile);  /* of its frames (cycles, readings) */
    /* what is on it */
    const struct board_line *lines;
    unsigned line_count;
    const char *const *port_lines; /* bits 0.. of the line port's byte, up to 7 names, then NULL */
    unsigned frame_line;           /* whose falls begin a frame */
    const char *const *events;
    unsigned event_count;
    const struct board_part *parts; /* [0] is the controller */
    unsigned part_count;
    uint32_t wrongs; /* enum board_wrong */
    const struct board_can *can;
    const struct board_bus *bus; /* NULL: no parallel bus */
    /* life */
    void (*init)(void *board, const void *profile, const struct board_cfg *cfg, const struct board_io *io,
                 struct sched *s);
    void (*power_up)(void *board, int64_t t_ns);
    void (*power_down)(void *board, int64_t t_ns);
    void (*reset)(void *board, int64_t t_ns);
    bool (*ready)(const void *board);
    void (*sample_until)(void *board,
                         int64_t t_ns);          /* takes its inputs up to now; the physics may change abruptly after */
    void (*wrong)(void *board, uint32_t wrongs); /* from now on; outlives resets and power */
    void (*listen)(void *board, bool on);        /* somebody wants board_io.event, or nobody does */
    struct trace *(*trace)(void *board);
    struct line_faults *(*line)(void *board);
    void (*digest)(const void *board, struct sha256 *s); /* of all that its future depends on */
    void (*truth)(const void *board, board_truth_fn *put,
                  void *ctx); /* hidden parameters of the specimen; may be NULL */
};

#endif

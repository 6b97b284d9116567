/* What every board gives the bench: one const table a type. The bench, links, control, faults, snapshots and scenarios know
 * boards only through it; unit/boards.c lists the types.
 *
 * A board is a plain struct that its unit owns, one thread, no allocation. `board` is a pointer to that struct, `can` one to
 * its CAN side, `profile` one to its profile struct. Times are simulated ns since power-on of the bench. */
#ifndef PSABENCH_BOARD_BOARD_H
#define PSABENCH_BOARD_BOARD_H

#include "base/sched.h"
#include "base/sha256.h"
#include "board/bus.h"
#include "board/can.h"
#include "board/cfg.h"
#include "board/field.h"
#include "board/part.h"
#include "trace/line_fault.h"
#include "trace/trace.h"

/* Faults of a controller, kinds controller.*: bits of board_type.wrongs. */
enum board_wrong {
    BOARD_WRONG_SKIP_SYNC_T = 1,  /* PSA-2: never a pulse on SYNC_T */
    BOARD_WRONG_SETUP_ORDER = 2,  /* PSA-2: the set-up's steps in reverse order, from the next Res on */
    BOARD_WRONG_FROZEN_WORDS = 4, /* the words of the frame (cycle, period) before, over and over */
    BOARD_WRONG_CAPACITOR = 8,    /* PMKA: the capacitor of integrator X has lost 30 % */
    BOARD_WRONG_STUCK_RESET = 16, /* PMKA: the positive reset of integrator X never ends */
    BOARD_WRONG_STUCK_KEY = 32    /* PMKA: the key of K never closes */
};

/* Parts of board_cfg that not every board has: bits of board_type.knobs. */
enum board_knob {
    BOARD_KNOB_CHAIN = 1,      /* adc_chain */
    BOARD_KNOB_TEMP_ADC = 2,   /* temp_adc_offset_v, temp_adc_gain_error */
    BOARD_KNOB_TEMP_NOISE = 4, /* temp_noise_scale */
    BOARD_KNOB_LEVEL = 8       /* level_node */
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
                          size_t cap);                                /* false: a sentence that begins with the field */
    void (*about)(const void *profile, char *out, size_t cap);        /* a line for lists of profiles */
    void (*cfg_default)(struct board_cfg *cfg);                       /* its usual analog chain; may be NULL */
    void (*cfg_profiled)(struct board_cfg *cfg, const void *profile); /* after it, what the profile says; may be NULL */
    uint32_t knobs;                            /* enum board_knob: what else of board_cfg it heeds */
    uint8_t node;                              /* default node id on CAN */
    uint8_t frame_forms;                       /* values of object 2020h; 0: it has no such object */
    int64_t (*period_ns)(const void *profile); /* of its frames (cycles, readings) */
    /* what is on it */
    const struct board_line *lines;
    unsigned line_count;
    const char *const *port_lines;         /* bits 0.. of the line port's byte, up to 7 names, then NULL */
    unsigned frame_line;                   /* whose falls begin a frame */
    unsigned pulse_line;                   /* whose pulses have their number in a frame */
    unsigned (*pulses)(const void *board); /* how many of them; NULL: no line has such pulses */
    /* what a fault of a sensor must come to, to be seen */
    double (*code_v)(const void *board); /* a code at the load, V (of an integrator: a count in a second); NULL: 2 uV */
    double (*range_v)(const void *board); /* full scale at the load; NULL: 10 V */
    const char *const *events;
    unsigned event_count;
    const struct board_part *parts; /* [0] is the controller */
    unsigned part_count;
    uint32_t wrongs; /* enum board_wrong */
    const struct board_can *can;
    const struct board_bus *bus; /* NULL: no parallel bus */
    /* Of a gyro unit, enum gyro_mode: NULL, or why it is refused. NULL itself: a board without modes. */
    const char *(*set_mode)(void *board, unsigned mode, int64_t t_ns);
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
    void (*listen)(void *board, bool on);        /* somebody wants board_io.event, or no one does */
    struct trace *(*trace)(void *board);
    struct line_faults *(*line)(void *board);
    struct afe *(*afe)(void *board, unsigned axis);      /* for faults: sample_until() first; NULL: no analog inputs */
    void (*digest)(const void *board, struct sha256 *s); /* of all that its future depends on */
    void (*truth)(const void *board, board_truth_fn *put,
                  void *ctx); /* hidden parameters of the specimen; may be NULL */
};

#endif

/* PIK, PIK-5, PIK-6: three charge-balance converters, their counters, and the registers by which a computer reads them
 * (article, sections 1 and 2).
 *
 * The model is behind the time by less than a look: at each it integrates its inputs since the last, and decides which pulses
 * there were. Looks come at a fixed pace, shorter than the trace's lag, with or without observers, so that this changes
 * nothing; what needs the counters at an instant between two looks takes the inputs up to it. Counters are latched by the
 * board's own period, or by a strobe on the bus.
 * Plain struct owned by the caller, one thread, no allocation; read-only outside the board's files. */
#ifndef PSABENCH_BOARD_PIK_PIK_H
#define PSABENCH_BOARD_PIK_PIK_H

#include "base/clk.h"
#include "base/sched.h"
#include "board/afe.h"
#include "board/board.h"
#include "board/pik/converter.h"
#include "board/pik/profile.h"

#include <stdbool.h>
#include <stdint.h>

#define PIK_AXES BOARD_AXES

/* Number in the board's trace. */
enum pik_line {
    PIK_LINE_CLK,   /* TCLK, rises where its periods begin */
    PIK_LINE_LATCH, /* low: the counters are latched at its fall */
    PIK_LINE_CS,    /* low: strobe of a bus cycle */
    PIK_LINE_RW,    /* low: of a write */
    PIK_LINE_FXP,   /* high while a reset balances a positive input; the counter counts its rise */
    PIK_LINE_FXN,
    PIK_LINE_FYP,
    PIK_LINE_FYN,
    PIK_LINE_FZP,
    PIK_LINE_FZN,
    PIK_LINE_AB0, /* of the bus cycle: A3..A0 */
    PIK_LINE_D0 = PIK_LINE_AB0 + 4,
    PIK_LINES = PIK_LINE_D0 + 16
};
extern const struct board_line pik_lines[PIK_LINES];

#define PIK_EVENT_LIST(X)                                                                                              \
    X(PIK, RES)   /* the controller is reset */                                                                        \
    X(PIK, LATCH) /* the counters are latched */                                                                       \
    X(PIK, FX)    /* a pulse of channel X has begun, either sign: since the last look */                               \
    X(PIK, FY)                                                                                                         \
    X(PIK, FZ)                                                                                                         \
    X(PIK, SATURATED) /* a channel can no longer keep up */                                                            \
    X(PIK, POWER_DOWN)                                                                                                 \
    X(PIK, POWER_UP)
enum pik_event { PIK_EVENT_LIST(BOARD_EVENT) PIK_EVENTS };
extern const char *const pik_events[PIK_EVENTS];

/* Addresses on the bus. */
enum pik_register {
    PIK_REG_X, /* up minus down, low 16 bits, as latched */
    PIK_REG_Y,
    PIK_REG_Z,
    PIK_REG_XP, /* up alone, then down alone */
    PIK_REG_XN,
    PIK_REG_YP,
    PIK_REG_YN,
    PIK_REG_ZP,
    PIK_REG_ZN,
    PIK_REG_SEQ,
    PIK_REG_STATUS, /* enum pik_status; reading it clears NEW */
    PIK_REG_LATCH,  /* any write latches at the end of its strobe */
    PIK_REG_PERIOD, /* of latching, 100 us; 0: by strobe alone */
    PIK_REG_CLEAR,  /* bits 0..2: the counters of X, Y, Z begin at 0 */
    PIK_REGISTERS
};

enum pik_status {
    PIK_ST_SATURATED_X = 1, /* since the reading before */
    PIK_ST_SATURATED_Y = 2,
    PIK_ST_SATURATED_Z = 4,
    PIK_ST_NEW = 8 /* latched since STATUS was read; always set in a reading */
};

/* What was latched. */
struct pik_reading {
    uint32_t seq; /* from 1 on since power-up or reset */
    int64_t t_ns;
    uint64_t plus[PIK_AXES], minus[PIK_AXES];
    int32_t total[PIK_AXES];     /* up minus down, low 32 bits */
    int16_t increment[PIK_AXES]; /* of total since the reading before */
    uint8_t status;
};

/* The board's CAN side. */
struct pik_host {
    void *ctx;
    void (*reading)(void *ctx, const struct pik_reading *r, int64_t t_ns);
    void (*saturated)(void *ctx, bool on, int64_t t_ns);
};

struct pik_counters {
    uint32_t readings, resets, strobes, cycles, cycles_refused;
};

#include "board/pik/state.h"

/* Faults of the controller: bits of board.faults. */
enum pik_controller_fault {
    PIK_FAULT_FROZEN_WORDS = 4 /* the words of the reading before, over and over */
};

void pik_init(struct pik *b, const struct pik_profile *p, const struct board_cfg *cfg, const struct board_io *io,
              struct sched *s);
void pik_power_up(struct pik *b, int64_t t_ns);
void pik_power_down(struct pik *b, int64_t t_ns);
void pik_reset(struct pik *b, int64_t t_ns);              /* counters and registers; the integrators run on */
void pik_sample_until(struct pik *b, int64_t t_ns);       /* takes its inputs, and counts what they give */
void pik_observe(struct pik *b, bool on);                 /* subscribes to io.event */
void pik_clock(struct pik *b, int32_t ppm, int64_t t_ns); /* the generator is off by so much, beside its own error */
void pik_stick(struct pik *b, unsigned axis, const struct chip_fault *f, int64_t t_ns);
bool pik_flip(struct pik *b, unsigned axis, unsigned reg, uint8_t mask, int64_t t_ns);

extern const struct board_bus pik_bus;
int64_t pik_period_ns(const void *pik); /* of the readings, as the register has it */

/* The coefficient that a channel has, Hz/V: truth. sign: of the input. */
double pik_true_k_hz_per_v(const struct pik *b, unsigned axis, int sign, double degc);

#endif

/* PMKA: converter board with four integrators, X, Y, Z and the spare K, and one sampling converter (article section 3, figures
 * 3 to 5).
 *
 * Every Ts the multiplexer takes X, Y, Z, K one after the other into the sample-and-hold; at the same instant the comparators
 * of that integrator are looked at, and a precision reset of Ts/2 begins if its voltage is beyond Uc. The integrator that is
 * out of work has its input at ground and is calibrated: zero, then resets of both signs. Keys move around the instant at which
 * K is sampled: first the one that comes back takes its axis, then K is sampled, then K takes the next axis; so that each
 * increment of each integrator belongs to one axis or to none. An axis has an integrator at every instant.
 *
 * Plain struct owned by the caller, one thread, no allocation. */
#ifndef PSABENCH_BOARD_PMKA_PMKA_H
#define PSABENCH_BOARD_PMKA_PMKA_H

#include "base/rng.h"
#include "base/sched.h"
#include "board/afe.h"
#include "board/board.h"
#include "board/pmka/integrator.h"
#include "board/pmka/profile.h"
#include "board/pmka/rom.h"
#include "trace/real.h"

#include <stdbool.h>
#include <stdint.h>

#define PMKA_INTS 4u
#define PMKA_K    3u
#define PMKA_TAUS 5u

enum pmka_line {
    PMKA_LINE_KL1, /* high: its integrator is on a sensor */
    PMKA_LINE_KL2,
    PMKA_LINE_KL3,
    PMKA_LINE_KL4,
    PMKA_LINE_TAU0, /* number of the beat, 1..5; 0 before the first */
    PMKA_LINE_TAU1,
    PMKA_LINE_TAU2,
    PMKA_LINE_RP1, /* positive and negative reset of integrator 1 = X at work */
    PMKA_LINE_RN1,
    PMKA_LINE_RP2,
    PMKA_LINE_RN2,
    PMKA_LINE_RP3,
    PMKA_LINE_RN3,
    PMKA_LINE_RP4,
    PMKA_LINE_RN4,
    PMKA_LINE_SH,   /* the sample is held */
    PMKA_LINE_CONV, /* it is being converted */
    PMKA_LINE_MUX0, /* which integrator is next */
    PMKA_LINE_MUX1,
    PMKA_LINE_CS,  /* low: strobe of a bus cycle */
    PMKA_LINE_RW,  /* low: of a write */
    PMKA_LINE_AB0, /* A3..A0 */
    PMKA_LINE_D0 = PMKA_LINE_AB0 + 4,
    PMKA_LINES = PMKA_LINE_D0 + 16
};

#define PMKA_EVENT_LIST(X)                                                                                             \
    X(PMKA, RES)                                                                                                       \
    X(PMKA, START)   /* the first sampling instant is now */                                                           \
    X(PMKA, READING) /* the code of K is there: the reading is complete */                                             \
    X(PMKA, RESET)   /* a precision reset begins */                                                                    \
    X(PMKA, TAU)     /* a beat begins */                                                                               \
    X(PMKA, POWER_DOWN)                                                                                                \
    X(PMKA, POWER_UP)
enum pmka_event { PMKA_EVENT_LIST(BOARD_EVENT) PMKA_EVENTS };

enum pmka_cal { PMKA_CAL_NONE, PMKA_CAL_ZERO, PMKA_CAL_RESET };

/* What a Ts brought, by integrator: X, Y, Z, K. */
struct pmka_reading {
    uint32_t seq; /* since the start */
    int64_t t_ns; /* X was sampled; the others mux_step_ns after one another */
    int16_t code[PMKA_INTS];
    int8_t reset[PMKA_INTS];   /* during the period that ended with this code: 1 positive, -1 negative, 0 none */
    uint8_t serves[PMKA_INTS]; /* axis + 1 that it had in that period; 0: none */
    bool saturated[PMKA_INTS], clipped[PMKA_INTS]; /* amplifier, converter at its end */
    enum pmka_cal cal;                             /* of the integrator that was out of work in that period */
    uint8_t tau;                                   /* beat, 1..5 */
    bool autonomous;
    int16_t temp_code; /* 1/128 degC */
};

struct pmka_counters {
    uint32_t readings, res, resets_plus, resets_minus, calibration_resets, handovers, beats, saturations, clips;
    uint32_t cycles, cycles_refused;
};

/* Receiver of the readings. */
struct pmka_host {
    void *ctx;
    void (*reading)(void *ctx, const struct pmka_reading *r, int64_t t_ns); /* its last code is there; may be NULL */
};

#include "board/pmka/state.h" /* struct pmka, read-only outside the board's own files */

/* Faults of the controller: bits of board.faults. */
enum pmka_controller_fault {
    PMKA_FAULT_FROZEN_WORDS = 4, /* the words of the period before, over and over */
    PMKA_FAULT_CAPACITOR = 8,    /* the capacitor of integrator X has lost 30 % */
    PMKA_FAULT_STUCK_RESET = 16, /* the positive reset of integrator X never ends */
    PMKA_FAULT_STUCK_KEY = 32    /* the key of K never closes */
};

extern const char *const pmka_events[PMKA_EVENTS];
extern const struct board_line pmka_lines[PMKA_LINES];

void pmka_init(struct pmka *b, const struct pmka_profile *p, const struct board_cfg *cfg, const struct board_io *io,
               struct sched *s);
void pmka_power_up(struct pmka *b, int64_t t_ns); /* integrators empty, controller starts */
void pmka_power_down(struct pmka *b, int64_t t_ns);
void pmka_reset(struct pmka *b, int64_t t_ns); /* of the controller; the integrators go on */
void pmka_sample_until(struct pmka *b, int64_t t_ns);
void pmka_set_faults(struct pmka *b, uint32_t faults); /* enum pmka_controller_fault; outlive resets and power */
bool pmka_ready(const struct pmka *b);                 /* sampling */

/* The program of the computer: the next hand-over leads to beat tau (1..5), the one out of work is calibrated so from then on
 * (of the present beat: from the next period on). False in autonomous mode. */
bool pmka_command(struct pmka *b, unsigned tau, enum pmka_cal cal);
void pmka_set_mode(struct pmka *b, enum pmka_mode mode);

/* Parallel bus: pmka/bus.c. */
extern const struct board_bus pmka_bus;
#define PMKA_ADDRESSES 16u

#endif

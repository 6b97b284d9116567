/* TOY: the smallest board. At a fixed pace it converts its three inputs to codes, shifts them out on three lines and sends them
 * on CAN. docs/new_board.md builds it step by step.
 *
 * Plain struct owned by the caller, one thread, no allocation; read-only outside the board's files. */
#ifndef PSABENCH_BOARD_TOY_TOY_H
#define PSABENCH_BOARD_TOY_TOY_H

#include "board/board.h"

/* What differs between two designs of the board: proto/profiles/toy.yaml. */
struct toy_profile {
    char name[32];
    double lsb_v;       /* a code, at the input */
    unsigned period_us; /* of the samples */
    unsigned bit_ns;    /* on CLK */
};

/* Number in the board's trace. */
enum toy_line {
    TOY_LINE_FRAME, /* low while a sample is shifted out */
    TOY_LINE_CLK,   /* a bit is valid at its rise */
    TOY_LINE_DATA,  /* X, Y, Z, 16 bits each, most significant bit first */
    TOY_LINES
};
enum { TOY_CODE_BITS = 16, TOY_BITS = TOY_CODE_BITS * (int)BOARD_AXES }; /* of a sample */
extern const struct board_line toy_lines[TOY_LINES];

enum toy_event { TOY_EV_RES, TOY_EV_SAMPLE, TOY_EV_POWER_DOWN, TOY_EV_POWER_UP, TOY_EVENTS };
extern const char *const toy_events[TOY_EVENTS];

/* Faults of the controller: bits of board.faults. */
enum toy_controller_fault { TOY_FAULT_FROZEN_WORDS = 1 }; /* the codes of the sample before, over and over */

struct toy_sample {
    int16_t code[BOARD_AXES];
    uint32_t seq;    /* since power-up or reset, from 1 */
    uint8_t clipped; /* bits 0..2: X, Y, Z at the end of the range */
};

struct toy_counters {
    uint32_t samples, resets;
};

struct toy {
    struct board base; /* first */
    struct toy_profile profile;
    struct sched_ev sample_ev;
    void (*on_sample)(void *can, const struct toy_sample *s, int64_t t_ns); /* NULL: not on a bus */
    void *can;
    enum chip_stuck dout; /* of the converter */
    struct toy_counters counters;
    struct toy_sample latest;
    int64_t sample_ns; /* its instant */
    bool on;
};

void toy_init(struct toy *b, const struct toy_profile *p, const struct board_cfg *cfg, const struct board_io *io,
              struct sched *s);
void toy_power_up(struct toy *b, int64_t t_ns);
void toy_power_down(struct toy *b, int64_t t_ns);
void toy_reset(struct toy *b, int64_t t_ns);
void toy_sample_until(struct toy *b, int64_t t_ns); /* takes the inputs up to now, without a sample */
int64_t toy_period_ns(const struct toy_profile *p);

#endif

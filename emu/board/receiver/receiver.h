/* A satellite receiver: position and velocity solutions at 1 to 10 Hz, out of a serial port as NMEA 0183 and UBX, and on CAN.
 *
 * At each instant of the solutions' grid, whole multiples of the period from power-on of the bench on, it looks at the truth
 * (board_io.place) through phys/receiver/errors.h. compute_ms later the report goes to the CAN side and, as messages, into the
 * transmit buffer, from which bytes leave at the bit rate. A message that does not fit into the buffer is lost whole and
 * counted. Plain struct owned by the caller, one thread, no allocation; read-only outside the board's files. */
#ifndef PSABENCH_BOARD_RECEIVER_RECEIVER_H
#define PSABENCH_BOARD_RECEIVER_RECEIVER_H

#include "base/clk.h"
#include "board/board.h"
#include "board/receiver/profile.h"
#include "board/receiver/report.h"

#define RECEIVER_TX_BYTES 1024u     /* E0: several solutions' messages at a bit rate that carries them */
#define RECEIVER_PPS_NS   100000000 /* high after each whole second of UTC */

enum receiver_line { RECEIVER_LINE_PPS, RECEIVER_LINE_SOL, RECEIVER_LINE_TXD, RECEIVER_LINES };
extern const struct board_line receiver_lines[RECEIVER_LINES];

enum receiver_event {
    RECEIVER_EV_RES,
    RECEIVER_EV_SOLUTION, /* put out */
    RECEIVER_EV_FIX,      /* the first valid one */
    RECEIVER_EV_FIX_LOST,
    RECEIVER_EV_POWER_DOWN,
    RECEIVER_EV_POWER_UP,
    RECEIVER_EVENTS
};
extern const char *const receiver_events[RECEIVER_EVENTS];

/* Faults of the controller: bits of board.faults. */
enum receiver_controller_fault { RECEIVER_FAULT_FROZEN_WORDS = 1 }; /* position and velocity of the solution before */

struct receiver_counters {
    uint32_t solutions, fixes; /* put out; valid ones of them */
    uint32_t resets;
    uint32_t messages, lost_messages; /* into the transmit buffer; that found no room there */
};

struct receiver_reading {
    struct report report;
    uint32_t seq; /* since power-up or reset, from 1 */
};

/* The transmit side of the serial port. */
struct receiver_tx {
    struct clk clock; /* of the bits; its edge 0 is the first start bit of a burst */
    int64_t bytes;    /* of the burst that have left */
    uint8_t ring[RECEIVER_TX_BYTES];
    unsigned first, count;
    struct sched_ev ev; /* end of the stop bit under way */
    unsigned bit;       /* on TXD, of the byte under way: 0 start, 1 ... 8 data, 9 stop; while TXD is watched */
    struct sched_ev bit_ev;
    void (*sent)(void *ctx, uint8_t byte, int64_t t_ns); /* NULL: nothing is connected */
    void *ctx;
};

struct receiver {
    struct board base; /* first */
    struct receiver_profile profile;
    struct receiver_errors errors;
    struct board_receiver_faults wrong;
    struct draws checksum; /* which messages are spoilt, by number */
    int64_t start_utc_ms;
    struct sched_ev solve_ev, output_ev, pps_ev, sol_ev;
    int64_t from_ns;                                                               /* no fix before */
    struct receiver_reading solved;                                                /* for output_ev */
    struct receiver_reading latest;                                                /* put out */
    void (*on_reading)(void *can, const struct receiver_reading *r, int64_t t_ns); /* NULL: not on a bus */
    void *can;
    struct receiver_counters counters;
    struct receiver_tx tx;
    bool on;
};

void receiver_init(struct receiver *b, const struct receiver_profile *p, const struct board_cfg *cfg,
                   const struct board_io *io, struct sched *s);
void receiver_power_up(struct receiver *b, int64_t t_ns);
void receiver_power_down(struct receiver *b, int64_t t_ns);
void receiver_reset(struct receiver *b, int64_t t_ns);
void receiver_sample_until(struct receiver *b, int64_t t_ns);
void receiver_set_faults(struct receiver *b, const struct board_receiver_faults *f, int64_t t_ns);

/* ---- receiver/serial.c */
void receiver_tx_init(struct receiver_tx *tx, const struct receiver_profile *p, struct receiver *b);
void receiver_tx_wake(void *ctx, uint64_t mask); /* trace_source.wake */
void receiver_tx_clear(struct receiver *b);
void receiver_tx_report(struct receiver *b, const struct report *r, int64_t t_ns); /* the profile's messages */

#endif

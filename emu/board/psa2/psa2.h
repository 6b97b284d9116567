/* PSA-2: converter board with controller KPSA, three accelerometer converters and one temperature converter.
 *
 * After Res the controller sets the converters up as its profile says, then reads the three codes at each DRD_A, scans
 * the temperature channels, and sends four words on Int/Data/CLK (article section 5). The host of the bench reaches the
 * registers only through the controller: psa2_submit(). Plain struct owned by the caller, one thread, no allocation.
 * Edges are reported to the trace only while watched, unwatched lines only where they come to rest: a late observer is given
 * true levels. Words, times and counters are the same either way. */
#ifndef PSABENCH_BOARD_PSA2_PSA2_H
#define PSABENCH_BOARD_PSA2_PSA2_H

#include "base/clk.h"
#include "base/sched.h"
#include "board/afe.h"
#include "board/board.h"
#include "board/psa2/event.h"
#include "board/psa2/profile.h"
#include "board/psa2/sleep.h"
#include "chip/ads1256/ads1256.h"
#include "chip/ads1282/ads1282.h"

#include <stdbool.h>
#include <stdint.h>

/* Number in the board's trace = order of the article's table. */
enum psa2_line {
    PSA2_LINE_SYNC_A,
    PSA2_LINE_SCLK,
    PSA2_LINE_DRD_A,
    PSA2_LINE_DIN,
    PSA2_LINE_DOUTX,
    PSA2_LINE_DOUTY,
    PSA2_LINE_DOUTZ,
    PSA2_LINE_SYNC_T,
    PSA2_LINE_CST,
    PSA2_LINE_DRD_T,
    PSA2_LINE_DINT,
    PSA2_LINE_DOUTT,
    PSA2_LINE_RES,
    PSA2_LINE_DATA,
    PSA2_LINE_CLK,
    PSA2_LINE_INT,
    PSA2_LINES
};

extern const struct board_line psa2_lines[PSA2_LINES];

enum { PSA2_PAIRS = 3 }; /* to the navigation computer: Int, Data, CLK, in the order of the profile's delays */
extern const struct board_pair psa2_pairs[PSA2_PAIRS];

/* Bits of psa2_frame.status, and of the T word above channel and code. */
enum psa2_status {
    PSA2_ST_SETTLED = 1, /* the converters had settled */
    PSA2_ST_CLIP = 2,    /* a code is at its limit */
    PSA2_ST_OVERRUN = 4, /* a conversion was lost before this one */
    PSA2_ST_TEMP_NEW = 8 /* the temperature code is new since the previous frame */
};

/* What one frame carried; handed out when INT rises. */
struct psa2_frame {
    uint32_t seq;        /* number of its DRD_A since the set-up: a gap is a lost conversion or frame */
    int64_t t_sample_ns; /* DRD_A fall */
    int64_t t_int_fall_ns, t_int_rise_ns;
    int32_t code[3];    /* 24-bit codes X, Y, Z, sign-extended */
    uint32_t raw[3];    /* conversion words as read, left-justified to 32 bits */
    uint16_t temp_code; /* upper 16 of the 24 bits read */
    uint8_t temp_channel;
    uint8_t status;            /* enum psa2_status */
    uint32_t word[PSA2_WORDS]; /* as sent, in order */
};

/* EMCY codes of psa2_host.fault: notified once, again only after data-ready has come. */
enum psa2_fault {
    PSA2_FAULT_ACCEL_PORT = 0xFF01, /* no DRD_A for 100 ms beyond the settling time */
    PSA2_FAULT_TEMP_PORT = 0xFF02   /* no DRD_T for the same time */
};

enum psa2_group { PSA2_ACCEL, PSA2_TEMP };
enum psa2_op { PSA2_READ_REG, PSA2_WRITE_REG, PSA2_OPCODE, PSA2_PULSE_SYNC };
enum psa2_result {
    PSA2_OK,
    PSA2_NO_SUCH_REG, /* address the part does not have */
    PSA2_READ_ONLY,   /* no writable bit there */
    PSA2_BAD_VALUE,   /* the chip rejects the value (reserved code), or models it not */
    PSA2_BUSY,        /* a request is under way, or the set-up has not finished */
    PSA2_TIMEOUT      /* no data-ready within the controller's timeout */
};

/* One access through the controller's serial port. Owned by the caller until done() has been called. */
struct psa2_request {
    enum psa2_group group;
    enum psa2_op op;
    uint8_t addr, value; /* opcode in value */
    uint8_t answer[3];   /* read: X, Y, Z (accelerometers) or [0] (temperature) */
    void (*done)(void *ctx, struct psa2_request *r, enum psa2_result result, int64_t t_ns);
    void *ctx;
};

/* Who takes what the board gives: its CAN side, a test. */
struct psa2_host {
    void *ctx;
    void (*frame)(void *ctx, const struct psa2_frame *f, int64_t t_ns); /* INT has risen; may be NULL */
    void (*fault)(void *ctx, uint16_t code, int64_t t_ns);              /* enum psa2_fault; may be NULL */
    bool (*ignores)(void *ctx); /* frames change nothing there, but for the latest; NULL: they do */
};

struct psa2_counters {
    uint32_t frames, resets, requests, timeouts;
    uint32_t overruns; /* DRD_A fell while a read or a frame was still under way */
    uint32_t int_late; /* a frame was dropped because INT was still low */
};

#include "board/psa2/state.h" /* struct psa2, read-only outside the board's own files */

/* io->accel and io->temp_degc have to be there. io->event, if it is: called when the line has moved and the board has not yet
 * acted on it, a number of enum psa2_event. Take note, or arm an event for t_ns, which comes before the board's next step:
 * nothing of the board's may be called from inside. */
void psa2_init(struct psa2 *b, const struct psa2_profile *p, const struct board_cfg *cfg, const struct board_io *io,
               struct sched *s);
void psa2_power_up(struct psa2 *b, int64_t t_ns); /* supplies good: chips power up, Res released, set-up begins */
void psa2_reset(struct psa2 *b, int64_t t_ns);    /* a pulse on Res */

/* The supply fails, in the middle of whatever goes on: all lines fall, a frame under way ends there, converters and
 * controller forget everything but the counters. psa2_power_up() begins again. Without power it does nothing. */
void psa2_power_down(struct psa2 *b, int64_t t_ns);

bool psa2_ready(const struct psa2 *b);                /* the set-up has been carried out */
void psa2_sample_until(struct psa2 *b, int64_t t_ns); /* the converters take their inputs up to now */

/* Queues one request; PSA2_OK means done() will be called later (never from inside), anything else that it will not.
 * Registers of the accelerometer converters are reached after a read, in time for the next DRD_A to lose no conversion;
 * those of the temperature converter between two conversions of the scan. Opcodes and pulses also go to a converter that
 * has fallen silent. A reset of the board ends a request with PSA2_TIMEOUT. */
enum psa2_result psa2_submit(struct psa2 *b, struct psa2_request *r, int64_t t_ns);

#endif

/* PSD-1: converter board with controller KPSD-1 and three AD7712 on one serial port, read over a 16-bit bus (article,
 * section 4; sources 4.5).
 *
 * After power-up the controller calibrates the converters by control word UC1, reads their coefficients, and sets them to work
 * by UC2. Then a cycle runs for each DR while INT0 and FL1 are active: A0, then for X, Y, Z in turn RFx, 16 SCLK into the
 * shift register РК, FL2, the host's strobe on the bus. The host is late, or never comes: the cycle waits, conversions are
 * lost in the converters. Laser gyros, rate sensors, thermometers and service signals have registers on the same bus.
 *
 * Plain struct owned by the caller, one thread, no allocation. Edges are reported only while watched; words, times and
 * counters are the same either way. */
#ifndef PSABENCH_BOARD_PSD1_PSD1_H
#define PSABENCH_BOARD_PSD1_PSD1_H

#include "base/rng.h"
#include "base/sched.h"
#include "board/afe.h"
#include "board/board.h"
#include "board/psd1/names.h"
#include "board/psd1/profile.h"
#include "board/psd1/shift.h"
#include "chip/ad7712/ad7712.h"

#include <stdbool.h>
#include <stdint.h>

/* psd1_cycle.status. */
enum psd1_cycle_status {
    PSD1_CY_READ = 7,    /* bit per axis: its FL2 has been answered */
    PSD1_CY_OVERRUN = 8, /* a conversion was lost since the cycle before */
    PSD1_CY_LATE = 16,   /* a strobe began later than late_ns after FL2 */
    PSD1_CY_MIXED = 32,  /* a conversion ended inside the cycle: the words may not be of one instant */
    PSD1_CY_CLIP = 64    /* a word is at its limit */
};

/* What one cycle carried; handed out when the last FL2 has been cleared. */
struct psd1_cycle {
    uint32_t seq;                       /* since the set-up */
    int64_t t_dr_ns, t_a0_ns, t_end_ns; /* DR fall, A0 rise, last FL2 clear */
    uint16_t word[3];
    int32_t gyro[3]; /* counts since power-up, latched at A0 */
    int16_t rate[3]; /* codes of the rate sensors, at the same time */
    uint8_t status;  /* enum psd1_cycle_status */
};

/* EMCY code of psd1_host.fault: notified once, again only after DR has come. */
#define PSD1_FAULT_DR 0xFF01 /* no DR for 100 ms beyond the settling time */

/* Commands of register COMMAND, and what the CAN side asks for. Those with an axis have it in the low bits. */
enum psd1_command {
    PSD1_CMD_NONE,
    PSD1_CMD_UC1,      /* calibrate: the word becomes UC1, is sent, coefficients are read, UC2 is sent */
    PSD1_CMD_UC2,      /* the word becomes UC2 and is sent */
    PSD1_CMD_SHOW_UC1, /* UC1 to registers UC_HIGH, UC_LOW; the others do the same */
    PSD1_CMD_SHOW_UC2,
    PSD1_CMD_ZERO = 0x10,    /* + axis: stored zero-scale coefficient */
    PSD1_CMD_FULL = 0x20,    /* + axis: stored full-scale coefficient */
    PSD1_CMD_CONTROL = 0x30, /* + axis: the control word as the converter has it */
    PSD1_CMD_AXIS = 0x03
};

/* One command. Owned by the caller until done() has been called. */
struct psd1_request {
    uint8_t command; /* UC1, UC2 or CONTROL */
    uint32_t word;   /* sent, or read */
    void (*done)(void *ctx, struct psd1_request *r, enum board_cycle_result result, int64_t t_ns);
    void *ctx;
};

/* Receiver of notifications; any may be NULL. */
struct psd1_host {
    void *ctx;
    void (*cycle)(void *ctx, const struct psd1_cycle *c, int64_t t_ns);
    void (*fault)(void *ctx, uint16_t code, int64_t t_ns); /* PSD1_FAULT_DR; 0: DR is back */
};

struct psd1_counters {
    uint32_t cycles, resets, commands, timeouts;
    uint32_t late;                   /* strobes that began later than late_ns after FL2 */
    uint32_t stretched;              /* cycles inside which a conversion ended */
    uint32_t lost_x, lost_y, lost_z; /* conversions that no one has read, as of the latest cycle or DR */
    uint32_t bus_cycles;             /* on the bus carried out, the built-in host's too */
    uint32_t refused;                /* strobes without their word, and other cycles that were rejected */
    uint32_t too_short;              /* of these: strobes shorter than strobe_min_ns */
    uint32_t cut;                    /* cycles that a reset, a command or the supply ended */
};

#include "board/psd1/state.h" /* struct psd1, read-only outside the board's own files */

/* Faults of the controller: bits of board.faults. */
enum psd1_controller_fault {
    PSD1_FAULT_FROZEN_WORDS = 4 /* the words of the cycle before, over and over */
};

void psd1_init(struct psd1 *b, const struct psd1_profile *p, const struct board_cfg *cfg, const struct board_io *io,
               struct sched *s);
void psd1_power_up(struct psd1 *b, int64_t t_ns);
void psd1_power_down(struct psd1 *b, int64_t t_ns);
void psd1_reset(struct psd1 *b, int64_t t_ns);
void psd1_sample_until(struct psd1 *b, int64_t t_ns);

/* BOARD_CYCLE_OK: done() comes later, never from inside. BUSY, BAD_VALUE (with a sentence in *why), OFF. */
enum board_cycle_result psd1_request(struct psd1 *b, struct psd1_request *r, const char **why, int64_t t_ns);

/* Levels of INT0 and FL1, active or not, as register FLAGS sets them. */
void psd1_flags(struct psd1 *b, bool int0, bool fl1, int64_t t_ns);

extern const struct board_bus psd1_bus;

#endif

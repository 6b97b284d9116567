/* The parallel bus of a board that has one, cycle by cycle. */
#ifndef PSABENCH_BOARD_BOARD_BUS_H
#define PSABENCH_BOARD_BOARD_BUS_H

#include <stdbool.h>
#include <stdint.h>

enum board_cycle_result {
    BOARD_CYCLE_OK,
    BOARD_CYCLE_NO_ADDRESS, /* nothing answers at this address */
    BOARD_CYCLE_READ_ONLY,
    BOARD_CYCLE_WRITE_ONLY,
    BOARD_CYCLE_NOT_READY, /* too early: no word waits */
    BOARD_CYCLE_TOO_SHORT, /* the strobe is shorter than the board needs */
    BOARD_CYCLE_BUSY,      /* somebody else's cycle is under way: refused at once, to be asked again */
    BOARD_CYCLE_BAD_VALUE,
    BOARD_CYCLE_TAKEN, /* too early: no word waits, and the board's built-in host takes each that comes */
    BOARD_CYCLE_OFF    /* no power, or cut by a reset */
};

/* Why a cycle is BOARD_CYCLE_TAKEN, and the way out. */
#define BOARD_CYCLE_TAKEN_WHY                                                                                          \
    "too early: no word waits there; the board's built-in host takes each that comes, profile psd1_host has none"

/* One word for programs, "not-ready"; "ok" for BOARD_CYCLE_OK. */
const char *board_cycle_word(enum board_cycle_result r);

/* One cycle on the parallel bus by which the navigation computer reads a board (PSD-1, PMKA, PIK). Owned by the caller
 * until done() has been called. */
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

#endif

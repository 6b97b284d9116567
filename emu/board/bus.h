/* The parallel bus of a board that has one, cycle by cycle. */
#ifndef PSABENCH_BOARD_BUS_H
#define PSABENCH_BOARD_BUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum board_cycle_result {
    BOARD_CYCLE_OK,
    BOARD_CYCLE_NO_ADDRESS, /* nothing answers at this address */
    BOARD_CYCLE_READ_ONLY,
    BOARD_CYCLE_WRITE_ONLY,
    BOARD_CYCLE_NOT_READY, /* too early: no word waits */
    BOARD_CYCLE_TOO_SHORT, /* the strobe is shorter than the board needs */
    BOARD_CYCLE_BUSY,      /* another client's cycle is in progress: rejected at once, to be repeated */
    BOARD_CYCLE_BAD_VALUE,
    BOARD_CYCLE_TAKEN, /* too early: no word waits, and the board's built-in host takes each that comes */
    BOARD_CYCLE_OFF    /* no power, or cut by a reset */
};

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

/* Lengths of strobes, ns. */
struct board_strobe {
    int64_t own_ns, least_ns; /* where the host gives none; the shortest that the board takes */
};

struct board;

enum { BOARD_READABLE = 1, BOARD_WRITABLE = 2, BOARD_LATCHED = 4 /* there is nothing before the first reading */ };

struct board_register {
    const char *name; /* "X"; NULL: nothing is there */
    uint8_t rights;
    uint16_t most; /* that can be written, where no more is to be said */
};

struct board_bus {
    /* BOARD_CYCLE_OK: done() will be called later, never from inside; else it will not. */
    enum board_cycle_result (*submit)(struct board *board, struct board_cycle *c, int64_t t_ns);
    unsigned addresses;
    const struct board_register *registers; /* by address */
    struct board_strobe (*strobe)(const struct board *board);
    /* Of a cycle rejected as BAD_VALUE or NOT_READY, what would be right, a clause: "it takes 0 to 3". May write nothing. */
    void (*expected)(const struct board *board, const struct board_cycle *c, enum board_cycle_result r, char *out,
                     size_t cap);
};

/* Name of what is at an address; NULL: nothing. */
const char *board_bus_name(const struct board_bus *bus, unsigned address);

#define BOARD_CYCLE_WHY_MAX 190u

/* Why a cycle was rejected, and what would be right, for a human: "read of address 0Ah (TEMP), strobe 50 ns: ...". An address is
 * written so wherever one is: two hexadecimal digits and h. */
void board_cycle_why(const struct board_bus *bus, const struct board *board, const struct board_cycle *c,
                     enum board_cycle_result r, char out[BOARD_CYCLE_WHY_MAX]);

#endif

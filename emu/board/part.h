/* What is on a board, as lines, counters and faults see it. */
#ifndef PSABENCH_BOARD_PART_H
#define PSABENCH_BOARD_PART_H

#include "base/chip_fault.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct board;

struct board_line {
    const char *name; /* article's, "Int" */
    bool level;       /* before the first power-up and at rest */
};

/* A line that leaves the board as a differential pair: its wires at the driver. */
struct board_pair {
    unsigned line;
    const char *a, *b; /* "Int_A", "Int_B" */
};

/* A board's list of events names each once: as constants PREFIX_EV_NAME in the order of the list, and as names. */
#define BOARD_EVENT(prefix, name)      prefix##_EV_##name,
#define BOARD_EVENT_NAME(prefix, name) #name,

struct board_counter {
    const char *name;
    size_t offset; /* of a uint32_t in the part */
};
#define BOARD_COUNTER(type, name, field)                                                                               \
    {                                                                                                                  \
#name, offsetof(struct type, field)                                                                            \
    }
#define BOARD_COUNTERS(table) .counters = (table), .counter_count = sizeof(table) / sizeof *(table)

/* Which members of struct chip_fault a part has; board_part.unless says why not the others. */
enum board_chip_fault_bit { BOARD_FAULT_DRDY = 1, BOARD_FAULT_DOUT = 2, BOARD_FAULT_SYNC = 4, BOARD_FAULT_CLOCK = 8 };

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
    /* f: the sum of the faults that are active on it */
    void (*fault)(struct board *board, unsigned part, const struct chip_fault *f, int64_t t_ns);
    bool (*flip)(struct board *board, unsigned part, unsigned reg, uint8_t mask,
                 int64_t t_ns); /* false: without power */
};

#endif

/* Faults that every converter can have, at its pins and in its clock. All zero: none. */
#ifndef PSABENCH_BASE_CHIP_FAULT_H
#define PSABENCH_BASE_CHIP_FAULT_H

#include "base/clk.h"

#include <assert.h>
#include <stdbool.h>
#include <stdint.h>

enum chip_stuck { CHIP_FREE, CHIP_STUCK_HIGH, CHIP_STUCK_LOW };

struct chip_fault {
    enum chip_stuck drdy; /* the data-ready pin; inside, conversions go on */
    enum chip_stuck dout; /* the data output: reads return ones or zeros, writes arrive */
    bool lost_sync;       /* the SYNC pin rests inside, a SYNC command does nothing */
    int32_t clock_ppm;    /* of the chip's clock against the board's, -500000 .. 500000; rounded to a hertz */
};

/* Level of a pin that would have this level without the fault. */
static inline bool chip_fault_level(enum chip_stuck stuck, bool level)
{
    return stuck ? stuck == CHIP_STUCK_HIGH : level;
}

/* Value of all bits of a word read through a pin. */
static inline uint32_t chip_fault_word(enum chip_stuck stuck, uint32_t word, uint32_t all)
{
    return stuck == CHIP_FREE ? word : stuck == CHIP_STUCK_HIGH ? all : 0;
}

static inline int64_t chip_fault_hz(const struct chip_fault *f, int64_t nominal_hz)
{
    assert(f->clock_ppm >= -500000 && f->clock_ppm <= 500000);
    return nominal_hz + nominal_hz * f->clock_ppm / 1000000;
}

/* The clock at another frequency from its next edge on, which keeps its instant and its number. */
static inline struct clk chip_fault_clk(const struct clk *c, int64_t hz, int64_t t_ns)
{
    const int64_t edge = clk_count_at(c, t_ns);
    return (struct clk){.t0_ns = clk_edge_ns(c, edge) - clk_span_ns(hz, edge), .hz = hz, .div = 1};
}

#endif

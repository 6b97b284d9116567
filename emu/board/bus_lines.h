/* Lines of a board's parallel bus while a cycle is under way: CS and R/W low as its strobe and its direction say, A3..A0, and
 * D15..D0, driven by the host or by the board from the beginning of the strobe to its end; 0 in between (PSD-1's convention,
 * E0). A cycle that is rejected at once is none: nothing moves. */
#ifndef PSABENCH_BOARD_BUS_LINES_H
#define PSABENCH_BOARD_BUS_LINES_H

#include "board/bus.h"
#include "trace/trace.h"

/* Numbers in the board's trace; AB0 and D0 are the first of 4 and of 16. */
struct bus_lines {
    unsigned cs, rw, ab0, d0;
};

/* Rows of a board's table of lines. */
#define BUS_LINES_AB(ab0)                                                                                              \
    [ab0] = {"AB0", false}, {"AB1", false}, {"AB2", false},                                                            \
    {                                                                                                                  \
        "AB3", false                                                                                                   \
    }
#define BUS_LINES_D(d0)                                                                                                \
    [d0] = {"D0", false}, {"D1", false}, {"D2", false}, {"D3", false}, {"D4", false}, {"D5", false}, {"D6", false},    \
    {"D7", false}, {"D8", false}, {"D9", false}, {"D10", false}, {"D11", false}, {"D12", false}, {"D13", false},       \
    {"D14", false},                                                                                                    \
    {                                                                                                                  \
        "D15", false                                                                                                   \
    }

static inline uint64_t bus_lines_mask(const struct bus_lines *l)
{
    return TRACE_BIT(l->cs) | TRACE_BIT(l->rw) | UINT64_C(0xF) << l->ab0 | UINT64_C(0xFFFF) << l->d0;
}

static inline void bus_lines_begin(struct trace *t, const struct bus_lines *l, const struct board_cycle *c,
                                   uint16_t data, int64_t t_ns)
{
    const uint64_t address = (uint64_t)(c->address & 0xFu) << l->ab0, word = (uint64_t)data << l->d0;
    trace_put(t, bus_lines_mask(l), (c->write ? 0 : TRACE_BIT(l->rw)) | address | word, t_ns);
}

static inline void bus_lines_end(struct trace *t, const struct bus_lines *l, int64_t t_ns)
{
    trace_put(t, bus_lines_mask(l), TRACE_BIT(l->cs) | TRACE_BIT(l->rw), t_ns);
}

#endif

/* The functions of a board_type that only give a pointer its type, written once.
 *
 * BOARD_STROBE(NAME) defines strobe, of board_bus, by the profile's strobe_ns and strobe_min_ns.
 *
 * BOARD_LIFE(NAME) at the file's top level defines init, power_up, power_down, reset, sample_until, trace and line for a board
 * whose struct is struct NAME, with members trace and line, and whose functions are NAME_init() and so on. */
#ifndef PSABENCH_BOARD_LIFE_H
#define PSABENCH_BOARD_LIFE_H

#include "board/board.h"

// clang-format off
#define BOARD_LIFE(NAME)                                                                                               \
    static void init(void *board, const void *profile, const struct board_cfg *cfg, const struct board_io *io,         \
                     struct sched *s) { NAME##_init(board, profile, cfg, io, s); }                                     \
    static void power_up(void *board, int64_t t_ns) { NAME##_power_up(board, t_ns); }                                  \
    static void power_down(void *board, int64_t t_ns) { NAME##_power_down(board, t_ns); }                              \
    static void reset(void *board, int64_t t_ns) { NAME##_reset(board, t_ns); }                                        \
    static void sample_until(void *board, int64_t t_ns) { NAME##_sample_until(board, t_ns); }                          \
    static struct trace *trace(void *board) { return &((struct NAME *)board)->trace; }                                 \
    static struct line_faults *line(void *board) { return &((struct NAME *)board)->line; }                             \
    struct NAME /* so that a semicolon has to follow */

#define BOARD_STROBE(NAME)                                                                                             \
    static struct board_strobe strobe(const void *board)                                                               \
    {                                                                                                                  \
        const struct NAME *b = board;                                                                                  \
        return (struct board_strobe){b->profile.strobe_ns, b->profile.strobe_min_ns};                                  \
    }                                                                                                                  \
    struct NAME /* so that a semicolon has to follow */
// clang-format on

#endif

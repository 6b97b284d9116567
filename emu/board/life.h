/* The functions of a board_type that only give a pointer its type, written once for a board whose struct is struct NAME, with a
 * struct board as its first member, and whose functions are NAME_init() and so on.
 *
 * BOARD_LIFE(NAME) at the file's top level defines init, power_up, power_down, reset and sample_until, which
 * BOARD_LIFE_FUNCTIONS puts into the board_type. BOARD_COMMON(NAME, PREFIX) does so with all else that each board names alike:
 * NAME_fields, PREFIX_LINES, the file's parts. BOARD_BUS(NAME, COUNT) defines NAME_bus with COUNT addresses: the file's submit,
 * registers and describe_expected, and the strobe by the profile's strobe_ns and strobe_min_ns. */
#ifndef PSABENCH_BOARD_LIFE_H
#define PSABENCH_BOARD_LIFE_H

#include "board/board.h"

// clang-format off
#define BOARD_LIFE(NAME)                                                                                               \
    static void init(struct board *board, const void *profile, const struct board_cfg *cfg, const struct board_io *io, \
                     struct sched *s) { NAME##_init((struct NAME *)board, profile, cfg, io, s); }                      \
    static void power_up(struct board *board, int64_t t_ns) { NAME##_power_up((struct NAME *)board, t_ns); }           \
    static void power_down(struct board *board, int64_t t_ns) { NAME##_power_down((struct NAME *)board, t_ns); }       \
    static void reset(struct board *board, int64_t t_ns) { NAME##_reset((struct NAME *)board, t_ns); }                 \
    static void sample_until(struct board *board, int64_t t_ns) { NAME##_sample_until((struct NAME *)board, t_ns); }   \
    struct NAME /* so that a semicolon has to follow */
#define BOARD_LIFE_FUNCTIONS .init = init, .power_up = power_up, .power_down = power_down, .reset = reset, .sample_until = sample_until
#define BOARD_COMMON(NAME, PREFIX)                                                                                     \
    .name = #NAME, .size = sizeof(struct NAME),                                                                        \
    .fields = &NAME##_fields, .profile_check = NAME##_profile_check, .about = about,                                   \
    .lines = NAME##_lines, .line_count = PREFIX##_LINES, .port_lines = port_lines,                                     \
    .events = NAME##_events, .event_count = PREFIX##_EVENTS,                                                           \
    .parts = parts, .part_count = sizeof parts / sizeof *parts, .controller_faults = controller_faults,                \
    .can = &NAME##_can, BOARD_LIFE_FUNCTIONS, .ready = ready, .digest = digest

#define BOARD_BUS(NAME, COUNT)                                                                                         \
    static struct board_strobe strobe(const struct board *board)                                                       \
    {                                                                                                                  \
        const struct NAME *b = (const struct NAME *)board;                                                             \
        return (struct board_strobe){b->profile.strobe_ns, b->profile.strobe_min_ns};                                  \
    }                                                                                                                  \
    const struct board_bus NAME##_bus = {                                                                              \
        .submit = submit, .addresses = (COUNT), .registers = registers, .strobe = strobe, .expected = describe_expected}
// clang-format on

#endif

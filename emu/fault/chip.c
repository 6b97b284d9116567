/* Faults of the chips and of the controller of a board, as its table says (board_type.parts, board_type.controller_faults). Those of a
 * chip add up: its hook is given the sum of what is active. */
#include "fault/internal.h"

#include "base/why.h"

#include <math.h>

static const struct board_part *part_of(const struct control_bench *b, const struct fault *f)
{
    return &b->unit[f->point.unit]->type->parts[f->point.index];
}

/* ---- chips; the variant of a kind is its bit of enum board_chip_fault_bit */

static void add_to_sum(const struct fault *f, struct chip_fault *s, double *ppm)
{
    const enum chip_stuck stuck = f->value[FAULT_LEVEL] != 0.0 ? CHIP_STUCK_HIGH : CHIP_STUCK_LOW;
    if (f->kind->variant == BOARD_FAULT_DRDY) s->drdy = stuck;
    if (f->kind->variant == BOARD_FAULT_DOUT) s->dout = stuck;
    if (f->kind->variant == BOARD_FAULT_SYNC) s->lost_sync = true;
    if (f->kind->variant == BOARD_FAULT_CLOCK) *ppm += f->value[FAULT_CLOCK_PPM];
}

static void refresh_chip(struct fault *f, int64_t t_ns)
{
    struct chip_fault s = {.clock_ppm = 0};
    double ppm = 0.0;
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        if (fault_lasts_at(f, &f->engine->fault[i])) add_to_sum(&f->engine->fault[i], &s, &ppm);
    }
    s.clock_ppm = (int32_t)nearbyint(fmin(fmax(ppm, -FAULT_PPM_MAX), FAULT_PPM_MAX));
    part_of(f->engine->bench, f)->fault(fault_unit(f)->board, f->point.index, &s, t_ns);
}

static bool flip_register_bits(struct fault *f, int64_t t_ns)
{
    const unsigned reg = (unsigned)f->value[FAULT_REGISTER];
    const uint8_t mask = (uint8_t)f->value[FAULT_MASK];
    return part_of(f->engine->bench, f)->flip(fault_unit(f)->board, f->point.index, reg, mask, t_ns);
}

static bool reject_lacking(const struct fault *f, const char *reason, char *why)
{
    return why_fail(why, CONTROL_WHY_MAX, "%s: %s", f->name, reason ? reason : f->kind->lacks);
}

static bool has_fault(const struct control_bench *b, const struct fault *f, char *why)
{
    const struct board_part *p = part_of(b, f);
    return p->faults & f->kind->variant || reject_lacking(f, p->unless, why);
}

/* A clock is off by whole ppm. */
static bool has_clock(const struct control_bench *b, const struct fault *f, char *why)
{
    const double ppm = f->value[FAULT_CLOCK_PPM];
    if (!has_fault(b, f, why)) return false;
    if (ppm == nearbyint(ppm)) return true;
    return why_fail(why, CONTROL_WHY_MAX, "clock_ppm: expected whole ppm, got %.10g", ppm);
}

static bool has_register(const struct control_bench *b, const struct fault *f, char *why)
{
    const struct board_part *p = part_of(b, f);
    if (p->registers == 0) return reject_lacking(f, NULL, why);
    if (f->value[FAULT_REGISTER] < p->registers) return true;
    return why_fail(why, CONTROL_WHY_MAX, "register: expected 0 to %u for %s, got %.0f", p->registers - 1, f->name,
                    f->value[FAULT_REGISTER]);
}

// clang-format off
#define CHIP(v) .variant = (v), .places = FAULT_BIT(FAULT_AT_CHIP), .lift = refresh_chip
static const struct fault_kind chip[] = {
    {"chip.drdy_stuck", "The data-ready pin is stuck at level; conversions continue.", "no frames, or no new values of that chip, and an EMCY that says so",
     CHIP(BOARD_FAULT_DRDY), .need = FAULT_BIT(FAULT_LEVEL), .unless = "the controller does not use the pin of that chip", .fits = has_fault,
     .lacks = "this chip has no data-ready pin that anybody hears"},
    {"chip.dout_dead", "The data pin is stuck at level.", "all ones or all zeros in the words of that chip",
     CHIP(BOARD_FAULT_DOUT), .need = FAULT_BIT(FAULT_LEVEL), .unless = "no data pin", .fits = has_fault,
     .lacks = "this chip has no data pin"},
    {"chip.lost_sync", "The chip ignores SYNC, pin and command.", "after a pulse on SYNC the chip keeps its phase: if the frames follow this chip, they have no gap; otherwise the step response of its axis differs from the others",
     CHIP(BOARD_FAULT_SYNC), .unless = "nothing synchronises that chip", .fits = has_fault,
     .lacks = "nothing synchronises this chip"},
    {"chip.clock", "The chip's clock is off by clock_ppm.", "the data rate is off by clock_ppm if the frames follow this chip; otherwise the step response of its axis is faster or slower than the others",
     CHIP(BOARD_FAULT_CLOCK), .need = FAULT_BIT(FAULT_CLOCK_PPM), .nonzero = FAULT_BIT(FAULT_CLOCK_PPM), .unless = "no clock of its own; clock_ppm is no whole number", .fits = has_clock,
     .lacks = "this chip has no clock of its own"},
    {"chip.flip", "Inverts bits of a register once.", "the register reads differently, and the chip behaves accordingly",
     .places = FAULT_BIT(FAULT_AT_CHIP), .need = FAULT_BIT(FAULT_REGISTER) | FAULT_BIT(FAULT_MASK),
     .once = true, .unless = "no such register", .fits = has_register, .apply = flip_register_bits, .lacks = "this chip has no registers"},
};
// clang-format on
const struct fault_table fault_chip = {chip, sizeof chip / sizeof *chip};

/* ---- controller */

static void refresh_controller(struct fault *f, int64_t t_ns)
{
    struct unit *u = fault_unit(f);
    uint32_t all = 0;
    (void)t_ns;
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        const struct fault *other = &f->engine->fault[i];
        if (fault_lasts_at(f, other)) all |= board_fault_bit(u->type, other->kind->name);
    }
    board_set_faults(u->board, all);
}

static bool can_have_fault(const struct control_bench *b, const struct fault *f, char *why)
{
    return board_fault_bit(b->unit[f->point.unit]->type, f->kind->name) || reject_lacking(f, NULL, why);
}

// clang-format off
#define CONTROLLER .places = FAULT_BIT(FAULT_AT_CONTROLLER), .lift = refresh_controller, .fits = can_have_fault
static const struct fault_kind controller[] = {
    {"controller.skip_sync_t", "The controller omits the pulse on SYNC_T.", "no pulses on SYNC_T; temperature codes come every 10.00 ms at 100 SPS instead of every 10.25 ms",
     CONTROLLER, .unless = "no SYNC_T on the board", .lacks = "the controller of this board has no SYNC_T to give a pulse on"},
    {"controller.setup_order", "The controller carries out the steps of the set-up in reverse order, from the next Res on.", "after Res the registers of the converters differ from those of the article",
     CONTROLLER, .unless = "no set-up of several steps", .lacks = "the controller of this board has no set-up whose order matters"},
    {"controller.frozen_words", "The controller repeats the codes of the previous frame.", "frame numbers and times advance, the codes stay equal to the bit",
     CONTROLLER, .unless = "the controller keeps no words", .lacks = "the controller of this board keeps no words that could freeze"},
    {"controller.capacitor", "The capacitor of integrator X has lost 30 %.", "codes and reset steps of integrator X grow by 1/0.7; their sum stays the same but for the resolution of the converter",
     CONTROLLER, .unless = "no integrators that are sampled", .lacks = "this board has no integrator whose capacitor a host could observe"},
    {"controller.stuck_reset", "The positive reset of integrator X never ends.", "the code of integrator X runs to its limit; the reading has the flag for saturation",
     CONTROLLER, .unless = "no precision resets", .lacks = "this board has no precision reset that could stay on"},
    {"controller.stuck_key", "The switch of the spare integrator never closes.", "the axis on the spare integrator does not change",
     CONTROLLER, .unless = "no spare integrator", .lacks = "this board has no spare integrator with a key"},
};
// clang-format on
const struct fault_table fault_controller = {controller, sizeof controller / sizeof *controller};

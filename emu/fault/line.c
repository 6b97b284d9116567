/* Faults of the lines of a board, as a probe, the VCD file and the line port see them (trace/line_fault.h). */
#include "fault/internal.h"

#include "base/why.h"

_Static_assert(LINE_FAULTS_MAX >= FAULTS_MAX, "each fault of a line that was accepted has room on its board");

static struct line_faults *line_faults_of(const struct fault *f)
{
    const struct unit *u = fault_unit(f);
    return &u->board->line;
}

static bool apply_line(struct fault *f, int64_t t_ns)
{
    const enum line_fault_kind high = f->value[FAULT_LEVEL] != 0.0 ? LINE_STUCK_HIGH : LINE_STUCK_LOW;
    const bool stuck = f->kind->variant == LINE_STUCK_LOW;
    const bool lasts = !f->kind->once;
    const struct line_fault what = {.kind = stuck ? high : (enum line_fault_kind)f->kind->variant,
                                    .line = f->point.index,
                                    .from_ns = t_ns,
                                    .until_ns = lasts && f->for_ns > 0 ? t_ns + f->for_ns : INT64_MAX,
                                    .width_ns = (int64_t)f->value[FAULT_WIDTH_NS],
                                    .pulse = (unsigned)f->value[FAULT_PULSE],
                                    .frame_line = fault_unit(f)->type->frame_line,
                                    .rate_hz = f->value[FAULT_RATE_HZ],
                                    .rng = f->random};
    f->as.line = line_fault_add(line_faults_of(f), &what);
    return f->as.line != 0;
}

static void lift_line(struct fault *f, int64_t t_ns)
{
    line_fault_end(line_faults_of(f), f->as.line, t_ns);
}

static void reseed_line(struct fault *f, uint64_t seed, int64_t t_ns)
{
    line_fault_reseed(line_faults_of(f), f->as.line, seed, t_ns);
}

/* The receiver's inputs are at one potential then, by its terminator: AM26LV32, open, shorted or terminated inputs: output high. */
static bool has_pair(const struct control_bench *b, const struct fault *f, char *why)
{
    const struct unit *u = b->unit[f->point.unit];
    return line_has_pair(&u->board->line, f->point.index) ||
           why_fail(why, CONTROL_WHY_MAX, "%s: expected %s, got %s", f->kind->name,
                    u->type->pairs ? "a line with wires A and B" : "a board with differential pairs", f->name);
}

/* Only one line has pulses with a place in the frame. */
static bool has_pulse(const struct control_bench *b, const struct fault *f, char *why)
{
    const struct unit *u = b->unit[f->point.unit];
    const struct board_type *t = u->type;
    const unsigned pulses = t->pulses ? t->pulses(u->board) : 0;
    if (pulses == 0 || f->point.index != t->pulse_line)
        return why_fail(why, CONTROL_WHY_MAX, "%s: %s carries no pulses that are counted in a frame; %s%s does",
                        f->kind->name, f->name, pulses ? "the line " : "no line of a ",
                        pulses ? t->lines[t->pulse_line].name : t->title);
    if (f->value[FAULT_PULSE] <= pulses) return true;
    return why_fail(why, CONTROL_WHY_MAX, "pulse: expected 1 to %u (pulses in a frame of this board), got %.0f", pulses,
                    f->value[FAULT_PULSE]);
}

// clang-format off
#define LINE(v) .variant = (v), .places = FAULT_BIT(FAULT_AT_LINE), .apply = apply_line, .lift = lift_line, .reseed = reseed_line
static const struct fault_kind line[] = {
    {"line.stuck", "The line is stuck at level.", "no edge on it",
     LINE(LINE_STUCK_LOW), .need = FAULT_BIT(FAULT_LEVEL)},
    {"line.swapped", "The wires A and B of the pair are swapped.", "the line is inverted",
     LINE(LINE_INVERTED)},
    {"line.open", "A wire of the pair, A or B or both, is open at the terminated receiver.", "the line is high",
     LINE(LINE_OPEN), .unless = "any line that is no differential pair (PSA-2: Int, Data, CLK)", .fits = has_pair},
    {"line.glitch", "One inverted pulse of width_ns.", "a spurious pulse of that width",
     LINE(LINE_GLITCH), .need = FAULT_BIT(FAULT_WIDTH_NS), .once = true},
    {"line.missing_pulse", "Each frame lacks the pulse of that number.", "one clock less in a frame; its bits are shifted from there on",
     LINE(LINE_MISSING_PULSE), .need = FAULT_BIT(FAULT_PULSE), .unless = "any line but the one whose pulses a frame counts (CLK, SCLK); more pulses than a frame has", .fits = has_pulse},
    {"line.extra_pulse", "A pulse of width_ns follows the pulse of that number in each frame.", "one clock more in a frame; its bits are shifted from there on",
     LINE(LINE_EXTRA_PULSE), .need = FAULT_BIT(FAULT_PULSE) | FAULT_BIT(FAULT_WIDTH_NS), .unless = "any line but the one whose pulses a frame counts (CLK, SCLK); more pulses than a frame has", .fits = has_pulse},
    {"line.noise", "Random pulses of width_ns, rate_hz per second on average.", "spurious pulses of that width",
     LINE(LINE_NOISE), .need = FAULT_BIT(FAULT_RATE_HZ) | FAULT_BIT(FAULT_WIDTH_NS)},
};
// clang-format on
const struct fault_table fault_line = {line, sizeof line / sizeof *line};

/* Faults of an instrument's SCPI link. Nothing hangs in the bench: the port asks at each message. */
#include "fault/scpi.h"

#include "fault/internal.h"

#include <math.h>
#include <string.h>

enum { SILENT, LATE, GARBLED };

static void add_fault(struct fault_scpi *out, struct fault *f)
{
    if (f->kind->variant == SILENT) out->silent = true;
    if (f->kind->variant == LATE) out->late_ns += (int64_t)nearbyint(f->value[FAULT_LATE_S] * (double)NS_PER_S);
    if (f->kind->variant == GARBLED) out->garbles = f;
}

struct fault_scpi fault_scpi_of(struct fault_engine *e, const char *instrument)
{
    struct fault_scpi out = {.silent = false};
    for (unsigned i = 0; e && i < FAULTS_MAX; i++) {
        struct fault *f = &e->fault[i];
        if (f->id == 0 || f->state != FAULT_ACTIVE || f->point.place != FAULT_AT_SCPI) continue;
        if (strcmp(fault_scpi_instruments[f->point.index], instrument) == 0) add_fault(&out, f);
    }
    return out;
}

void fault_scpi_garble(const struct fault_scpi *f, char *text, size_t n)
{
    struct fault *g = f->garbles;
    if (!g || n == 0) return;
    const bool hit = !fault_given(g, FAULT_PROBABILITY) || rng_uniform(&g->random) < g->value[FAULT_PROBABILITY];
    if (hit) text[rng_u64(&g->random) % n] ^= (char)0x80;
}

static void lift_nothing(struct fault *f, int64_t t_ns)
{
    (void)f;
    (void)t_ns;
}

// clang-format off
static const struct fault_kind scpi[] = {
    {"scpi.silent", "The SCPI link of the instrument is dead: no command arrives, no answer comes.", "a time-out of the program; the instrument does nothing that is asked of it by SCPI",
     .variant = SILENT, .places = FAULT_BIT(FAULT_AT_SCPI), .lift = lift_nothing},
    {"scpi.late", "Answers come late_s of simulated time later; commands are carried out in time.", "a time-out of the program, or an answer to the question before",
     .variant = LATE, .places = FAULT_BIT(FAULT_AT_SCPI), .need = FAULT_BIT(FAULT_LATE_S), .lift = lift_nothing},
    {"scpi.garbled", "In each answer (with probability) the top bit of one byte is set, as on a line of the wrong parity.", "an answer that is no ASCII text",
     .variant = GARBLED, .places = FAULT_BIT(FAULT_AT_SCPI), .may = FAULT_BIT(FAULT_PROBABILITY), .lift = lift_nothing},
};
// clang-format on
const struct fault_table fault_scpi = {scpi, sizeof scpi / sizeof *scpi};

/* Faults of the supply. */
#include "fault/internal.h"

#include <stdio.h>

_Static_assert(SUPPLY_DIPS_MAX >= FAULTS_MAX, "each brown-out that was accepted has room in the supply");

static bool reaches_brownout(const struct control_bench *b, const struct fault *f, char *why)
{
    const struct supply *s = b->lab ? &b->lab->supply : NULL;
    if (!s || !s->cfg.present) {
        snprintf(why, CONTROL_WHY_MAX, "%s: this scenario has none (section supply): the boards are always fed",
                 f->name);
        return false;
    }
    if (s->set_v - f->value[FAULT_DROP_V] < s->cfg.brownout_v) return true;
    snprintf(why, CONTROL_WHY_MAX, "drop_v: %.10g: %.10g V less that is not below the threshold of the boards, %.10g V",
             f->value[FAULT_DROP_V], s->set_v, s->cfg.brownout_v);
    return false;
}

static bool dip_supply(struct fault *f, int64_t t_ns)
{
    const struct control_bench *b = f->engine->bench;
    char why[CONTROL_WHY_MAX];
    if (!reaches_brownout(b, f, why)) return false; /* it has been set higher meanwhile */
    if (supply_dip(&b->lab->supply, f->value[FAULT_DROP_V], t_ns, f->for_ns, t_ns) != SUPPLY_OK) return false;
    if (b->sim.supply_changed) b->sim.supply_changed(b->ctx, t_ns);
    return true;
}

/* It ends by itself; one that is cleared ends now. */
static void lift_supply(struct fault *f, int64_t t_ns)
{
    const struct control_bench *b = f->engine->bench;
    supply_dip_end(&b->lab->supply, f->value[FAULT_DROP_V], f->began_ns, f->for_ns, t_ns);
    if (b->sim.supply_changed) b->sim.supply_changed(b->ctx, t_ns);
}

// clang-format off
static const struct fault_kind supply[] = {
    {"supply.brownout", "The supply voltage drops by drop_v for for_s, below the boards' threshold.", "frames break off; after the supply returns: boot-up message, set-up, frame numbers from 0",
     .places = FAULT_BIT(FAULT_AT_SUPPLY), .need = FAULT_BIT(FAULT_DROP_V) | FAULT_BIT(FAULT_FOR_S), .nonzero = FAULT_BIT(FAULT_FOR_S),
     .unless = "the scenario has no supply; the voltage stays above the threshold of the boards", .fits = reaches_brownout, .apply = dip_supply, .lift = lift_supply},
};
// clang-format on
const struct fault_table fault_supply = {supply, sizeof supply / sizeof *supply};

/* UREF, which the secondary supply IVN makes of the unit's (article section 5). Its law is ours (E0): the article gives no figure. */
#include "board/psa2/internal.h"

#include <math.h>

bool psa2_uref_moves(const struct psa2 *b)
{
    const struct psa2_profile *p = &b->profile;
    return b->base.io.supply_ratio && (p->uref_ppm_per_pct != 0.0 || p->uref_dropout_ratio > 0.0);
}

double psa2_uref_ratio(const struct psa2_profile *p, double supply_ratio)
{
    const double regulated = 1.0 + 1e-6 * p->uref_ppm_per_pct * 100.0 * (supply_ratio - 1.0);
    const bool drops = supply_ratio < p->uref_dropout_ratio;
    const double left = drops ? supply_ratio / p->uref_dropout_ratio : 1.0;
    return fmax(regulated * left, PSA2_UREF_LEAST);
}

/* A code is volts over the reference: one too low is an input too high. */
void psa2_uref_row(const struct psa2 *b, double *vin_v, const struct looks *at)
{
    for (unsigned i = 0; i < at->n; i++)
        vin_v[i] /= psa2_uref_ratio(&b->profile, b->base.io.supply_ratio(b->base.io.ctx, at->t_ns[i]));
}

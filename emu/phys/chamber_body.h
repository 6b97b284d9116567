/* What chamber.c and chamber_body.c have in common. */
#ifndef PSABENCH_PHYS_CHAMBER_BODY_H
#define PSABENCH_PHYS_CHAMBER_BODY_H

#include "phys/chamber.h"

/* Number of the leg that the air is on. */
static inline unsigned chamber_leg_at(const struct chamber *c, double t_s)
{
    unsigned i = c->legs - 1;
    while (i > 0 && t_s < c->leg[i].from_s) i--;
    return i;
}

/* A command is about to come: the body as it is then. And has come: what it will do. */
void chamber_body_arrive(const struct chamber *c, struct chamber_body *b, int64_t t_ns);
void chamber_body_plan(const struct chamber *c, struct chamber_body *b);

/* At the instant of the latest command: what the body has been through is over. */
void chamber_body_forget(struct chamber_body *b);

#endif

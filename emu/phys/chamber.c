#include "phys/chamber.h"

#include "base/detmath.h"
#include "base/sched.h"
#include "phys/chamber_body.h"

#include <assert.h>
#include <math.h>

#define S_PER_MIN    60.0
#define NEVER_S      1e9      /* a chamber that sticks is there no sooner */
#define AIR_MIN_DEGC (-100.0) /* nothing is colder or warmer, as scenario/lab.c has it */
#define AIR_MAX_DEGC 200.0

struct chamber_cfg chamber_default(void)
{
    return (struct chamber_cfg){
        .start_degc = 25.0,
        .min_degc = -60.0,
        .max_degc = 85.0,
        .heating_max_k_per_min = 5.0,
        .cooling_max_k_per_min = 3.0,
        .ramp_k_per_min = 1.0,
        .tau_case_s = 180.0,
        .tau_element_s = 360.0,
    };
}

/* ---- the air */

double chamber_air_degc(const struct chamber *c, int64_t t_ns)
{
    const double t_s = sched_since_s(c->from_ns, t_ns);
    const struct chamber_leg *leg = &c->leg[chamber_leg_at(c, t_s)];
    return leg->air_degc + leg->slope_kps * (t_s - leg->from_s);
}

double chamber_shown_degc(const struct chamber *c, int64_t t_ns)
{
    return det_quantise(chamber_air_degc(c, t_ns) + (c->cfg.readout_offset_k + c->misreading_k),
                        c->cfg.readout_resolution_k);
}

int64_t chamber_stable_ns(const struct chamber *c)
{
    return c->from_ns + (int64_t)ceil(fmin(c->leg[c->legs - 1].from_s, NEVER_S) * (double)NS_PER_S);
}

bool chamber_stable(const struct chamber *c, int64_t t_ns)
{
    return t_ns >= chamber_stable_ns(c);
}

double chamber_ramp_max_k_per_min(const struct chamber *c)
{
    return fmax(c->cfg.heating_max_k_per_min, c->cfg.cooling_max_k_per_min);
}

/* ---- commands */

static double speed_kps(const struct chamber *c, bool up)
{
    const double limit = up ? c->cfg.heating_max_k_per_min : c->cfg.cooling_max_k_per_min;
    return fmin(c->ramp_k_per_min, limit) / S_PER_MIN * c->rate_part;
}

/* From the end of the last leg straight to a temperature, and there from then on. */
static void add_ramp(struct chamber *c, double to_degc)
{
    struct chamber_leg *leg = &c->leg[c->legs - 1];
    const bool up = to_degc > leg->air_degc;
    const double kps = speed_kps(c, up);
    leg->slope_kps = up ? kps : -kps;
    c->leg[c->legs++] = (struct chamber_leg){leg->from_s + fabs(to_degc - leg->air_degc) / kps, to_degc, 0.0};
}

static double overshot_degc(const struct chamber *c, double air_degc, double set_degc)
{
    const double step_k = set_degc - air_degc;
    const double past_k = fmin(c->overshoot_k, fabs(step_k));
    return fmin(fmax(set_degc + (step_k < 0.0 ? -past_k : past_k), AIR_MIN_DEGC), AIR_MAX_DEGC);
}

/* Everything starts again from where it is. */
static void plan_ramp(struct chamber *c, double set_degc, int64_t t_ns)
{
    const double air_degc = chamber_air_degc(c, t_ns);
    const double past_degc = overshot_degc(c, air_degc, set_degc);
    for (struct chamber_body *b = c->bodies; b; b = b->next) chamber_body_arrive(c, b, t_ns);
    c->set_degc = set_degc;
    c->from_ns = t_ns;
    c->leg[0] = (struct chamber_leg){0.0, air_degc, 0.0};
    c->legs = 1;
    if (past_degc != set_degc) add_ramp(c, past_degc);
    add_ramp(c, set_degc);
    for (struct chamber_body *b = c->bodies; b; b = b->next) chamber_body_plan(c, b);
}

void chamber_init(struct chamber *c, const struct chamber_cfg *cfg)
{
    assert(!cfg->present ||
           (cfg->ramp_k_per_min > 0.0 && cfg->heating_max_k_per_min > 0.0 && cfg->cooling_max_k_per_min > 0.0));
    *c = (struct chamber){.cfg = *cfg,
                          .rate_part = 1.0,
                          .ramp_k_per_min = cfg->ramp_k_per_min,
                          .set_degc = cfg->start_degc,
                          .leg = {{0.0, cfg->start_degc, 0.0}},
                          .legs = 1};
}

enum chamber_result chamber_set(struct chamber *c, double degc, int64_t t_ns)
{
    if (!(degc >= c->cfg.min_degc && degc <= c->cfg.max_degc)) return CHAMBER_OUT_OF_RANGE;
    plan_ramp(c, degc, t_ns);
    return CHAMBER_OK;
}

enum chamber_result chamber_ramp(struct chamber *c, double k_per_min, int64_t t_ns)
{
    if (!(k_per_min >= CHAMBER_RAMP_MIN_K_PER_MIN && k_per_min <= chamber_ramp_max_k_per_min(c)))
        return CHAMBER_OUT_OF_RANGE;
    c->ramp_k_per_min = k_per_min;
    plan_ramp(c, c->set_degc, t_ns);
    return CHAMBER_OK;
}

/* No step, no overshoot: the air stays at its set point. */
void chamber_renew(struct chamber *c, struct chamber_body *b, int64_t t_ns)
{
    assert(chamber_stable(c, t_ns));
    plan_ramp(c, c->set_degc, t_ns);
    chamber_body_forget(b);
}

void chamber_hinder(struct chamber *c, double rate_part, int64_t t_ns)
{
    assert(rate_part > 0.0);
    if (rate_part == c->rate_part) return;
    c->rate_part = rate_part;
    plan_ramp(c, c->set_degc, t_ns);
}

void chamber_overshoot(struct chamber *c, double overshoot_k, int64_t t_ns)
{
    assert(overshoot_k >= 0.0);
    if (overshoot_k == c->overshoot_k) return;
    c->overshoot_k = overshoot_k;
    plan_ramp(c, c->set_degc, t_ns);
}

void chamber_mislead(struct chamber *c, double misreading_k)
{
    c->misreading_k = misreading_k;
}

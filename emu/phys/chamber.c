#include "phys/chamber.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <assert.h>
#include <math.h>

#define S_PER_MIN 60.0
#define NEVER_S   1e9   /* a chamber that sticks is there no sooner */
#define GONE      700.0 /* time constants after which nothing is left in double precision */

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

/* ---- lags */

static double decay_factor(double t_s, double tau_s)
{
    if (tau_s <= 0.0 || t_s > GONE * tau_s) return t_s > 0.0 ? 0.0 : 1.0;
    return det_exp(-t_s / tau_s);
}

/* (1 - exp(-d)) / d for d >= 0 */
static double mean_decay(double d)
{
    if (d < 1e-4) return 1.0 - d * (0.5 - d / 6.0);
    return (1.0 - decay_factor(d, 1.0)) / d;
}

/* What a lag of 1 at the case leaves in the element: tau_c (exp(-t/tau_c) - exp(-t/tau_e)) / (tau_c - tau_e), written so that
 * equal lags are no special case. */
static double passed_on(double t_s, double tau_c_s, double tau_e_s)
{
    if (tau_c_s <= 0.0) return 0.0;
    if (tau_e_s <= 0.0) return decay_factor(t_s, tau_c_s);
    const double slow_s = fmax(tau_c_s, tau_e_s);
    const double fast_s = fmin(tau_c_s, tau_e_s);
    return decay_factor(t_s, slow_s) * (t_s / tau_e_s) * mean_decay(t_s * (slow_s - fast_s) / (slow_s * fast_s));
}

/* A straight piece of the air's course: air_degc at its start and slope; the body as it was there. */
struct piece {
    double air_degc, slope_kps;
    double case_degc, element_degc;
};

static double case_after(const struct chamber_body *b, const struct piece *p, double t_s)
{
    const double behind_k = p->slope_kps * b->tau_case_s;
    return p->air_degc + p->slope_kps * t_s - behind_k +
           (p->case_degc - p->air_degc + behind_k) * decay_factor(t_s, b->tau_case_s);
}

static double element_after(const struct chamber_body *b, const struct piece *p, double t_s)
{
    const double case_behind_k = p->slope_kps * b->tau_case_s;
    const double behind_k = case_behind_k + p->slope_kps * b->tau_element_s;
    return p->air_degc + p->slope_kps * t_s - behind_k +
           (p->case_degc - p->air_degc + case_behind_k) * passed_on(t_s, b->tau_case_s, b->tau_element_s) +
           (p->element_degc - p->air_degc + behind_k) * decay_factor(t_s, b->tau_element_s);
}

/* ---- the air */

double chamber_air_degc(const struct chamber *c, int64_t t_ns)
{
    const double t_s = sched_since_s(c->from_ns, t_ns);
    return t_s >= c->duration_s ? c->set_degc : c->from_degc + c->slope_kps * t_s;
}

double chamber_shown_degc(const struct chamber *c, int64_t t_ns)
{
    return det_quantise(chamber_air_degc(c, t_ns) + (c->cfg.readout_offset_k + c->misreading_k),
                        c->cfg.readout_resolution_k);
}

int64_t chamber_stable_ns(const struct chamber *c)
{
    return c->from_ns + (int64_t)ceil(fmin(c->duration_s, NEVER_S) * (double)NS_PER_S);
}

bool chamber_stable(const struct chamber *c, int64_t t_ns)
{
    return t_ns >= chamber_stable_ns(c);
}

double chamber_ramp_max_k_per_min(const struct chamber *c)
{
    return fmax(c->cfg.heating_max_k_per_min, c->cfg.cooling_max_k_per_min);
}

/* ---- bodies */

static struct piece ramp_of(const struct chamber *c, const struct chamber_body *b)
{
    return (struct piece){c->from_degc, c->slope_kps, b->case_degc, b->element_degc};
}

static struct piece hold_of(const struct chamber *c, const struct chamber_body *b)
{
    return (struct piece){c->set_degc, 0.0, b->case_end_degc, b->element_end_degc};
}

double chamber_case_degc(const struct chamber *c, const struct chamber_body *b, int64_t t_ns)
{
    const double t_s = sched_since_s(c->from_ns, t_ns);
    const bool ramp = t_s < c->duration_s;
    const struct piece p = ramp ? ramp_of(c, b) : hold_of(c, b);
    return case_after(b, &p, ramp ? t_s : t_s - c->duration_s);
}

double chamber_element_degc(const struct chamber *c, const struct chamber_body *b, int64_t t_ns)
{
    const double t_s = sched_since_s(c->from_ns, t_ns);
    const bool ramp = t_s < c->duration_s;
    const struct piece p = ramp ? ramp_of(c, b) : hold_of(c, b);
    return element_after(b, &p, ramp ? t_s : t_s - c->duration_s);
}

/* Its element is as warm as this. */
static void count_cycles(struct chamber_cycles *n, double element_degc)
{
    const double up_k = element_degc - CHAMBER_CYCLE_COLD_DEGC;
    if (up_k <= 0.0) n->cold = true;
    if (!n->cold) return;
    n->part = fmax(n->part, up_k / (CHAMBER_CYCLE_HOT_DEGC - CHAMBER_CYCLE_COLD_DEGC));
    if (n->part < 1.0) return;
    *n = (struct chamber_cycles){.whole = n->whole + 1};
}

double chamber_body_cycles(const struct chamber *c, const struct chamber_body *b, int64_t t_ns)
{
    struct chamber_cycles n = b->cycles;
    count_cycles(&n, chamber_element_degc(c, b, t_ns));
    return n.whole + n.part;
}

static void look_ahead(const struct chamber *c, struct chamber_body *b)
{
    const struct piece p = ramp_of(c, b);
    b->case_end_degc = case_after(b, &p, c->duration_s);
    b->element_end_degc = element_after(b, &p, c->duration_s);
}

void chamber_put_in(struct chamber *c, struct chamber_body *b, double tau_case_s, double tau_element_s)
{
    *b = (struct chamber_body){
        .tau_case_s = tau_case_s > 0.0 ? tau_case_s : c->cfg.tau_case_s,
        .tau_element_s = tau_element_s > 0.0 ? tau_element_s : c->cfg.tau_element_s,
        .case_degc = c->cfg.start_degc,
        .element_degc = c->cfg.start_degc,
        .next = c->bodies,
    };
    c->bodies = b;
    count_cycles(&b->cycles, b->element_degc);
    look_ahead(c, b);
}

/* ---- commands */

/* Everything starts again from where it is. */
static void plan_ramp(struct chamber *c, double set_degc, int64_t t_ns)
{
    const double air_degc = chamber_air_degc(c, t_ns);
    for (struct chamber_body *b = c->bodies; b; b = b->next) {
        const double case_degc = chamber_case_degc(c, b, t_ns);
        b->element_degc = chamber_element_degc(c, b, t_ns);
        b->case_degc = case_degc;
        count_cycles(&b->cycles, b->element_degc);
    }
    const bool up = set_degc > air_degc;
    const double limit = up ? c->cfg.heating_max_k_per_min : c->cfg.cooling_max_k_per_min;
    const double speed_kps = fmin(c->ramp_k_per_min, limit) / S_PER_MIN * c->rate_part;
    c->set_degc = set_degc;
    c->from_ns = t_ns;
    c->from_degc = air_degc;
    c->slope_kps = up ? speed_kps : -speed_kps;
    c->duration_s = fabs(set_degc - air_degc) / speed_kps;
    for (struct chamber_body *b = c->bodies; b; b = b->next) look_ahead(c, b);
}

void chamber_init(struct chamber *c, const struct chamber_cfg *cfg)
{
    assert(!cfg->present ||
           (cfg->ramp_k_per_min > 0.0 && cfg->heating_max_k_per_min > 0.0 && cfg->cooling_max_k_per_min > 0.0));
    *c = (struct chamber){.cfg = *cfg,
                          .rate_part = 1.0,
                          .ramp_k_per_min = cfg->ramp_k_per_min,
                          .set_degc = cfg->start_degc,
                          .from_degc = cfg->start_degc};
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

void chamber_hinder(struct chamber *c, double rate_part, int64_t t_ns)
{
    assert(rate_part > 0.0);
    if (rate_part == c->rate_part) return;
    c->rate_part = rate_part;
    plan_ramp(c, c->set_degc, t_ns);
}

void chamber_mislead(struct chamber *c, double misreading_k)
{
    c->misreading_k = misreading_k;
}

/* Bodies in the chamber: two lags, thermal cycles, and play, in closed form over the air's straight pieces. */
#include "phys/chamber_body.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <math.h>

#define GONE 700.0 /* time constants after which nothing is left in double precision */

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
    if (tau_c_s <= 0.0 || t_s <= 0.0) return 0.0;
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

static struct piece piece_of(const struct chamber *c, const struct chamber_body *b, unsigned leg)
{
    return (struct piece){c->leg[leg].air_degc, c->leg[leg].slope_kps, b->case_degc[leg], b->element_degc[leg]};
}

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

/* The piece under way, and since when it is. */
static struct piece piece_at(const struct chamber *c, const struct chamber_body *b, double t_s, double *since_s)
{
    const unsigned i = chamber_leg_at(c, t_s);
    *since_s = t_s - c->leg[i].from_s;
    return piece_of(c, b, i);
}

double chamber_case_degc(const struct chamber *c, const struct chamber_body *b, int64_t t_ns)
{
    double since_s;
    const struct piece p = piece_at(c, b, sched_since_s(c->from_ns, t_ns), &since_s);
    return case_after(b, &p, since_s);
}

double chamber_element_degc(const struct chamber *c, const struct chamber_body *b, int64_t t_ns)
{
    double since_s;
    const struct piece p = piece_at(c, b, sched_since_s(c->from_ns, t_ns), &since_s);
    return element_after(b, &p, since_s);
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

/* Between two turns the element goes one way: then the ends decide. What it has passed since stays counted. */
static struct chamber_cycles cycles_at(const struct chamber *c, const struct chamber_body *b, int64_t t_ns)
{
    const double t_s = sched_since_s(c->from_ns, t_ns);
    struct chamber_cycles n = b->cycles;
    for (unsigned i = 0; i < b->turns && b->turn_s[i] <= t_s; i++) count_cycles(&n, b->turn_degc[i]);
    count_cycles(&n, chamber_element_degc(c, b, t_ns));
    return n;
}

double chamber_body_cycles(const struct chamber *c, const struct chamber_body *b, int64_t t_ns)
{
    const struct chamber_cycles n = cycles_at(c, b, t_ns);
    return n.whole + n.part;
}

/* ---- where the element turns */

#define SETTLED  40.0 /* time constants after which what is left of a lag is nothing beside a temperature */
#define ALIKE    1e-6 /* lags that differ by less, relatively, are taken as equal where only a search is split */
#define HALVINGS 64

/* Has the sign of the element's slope: the case's lead over it; that of the air, where the element has no lag of its own. */
static double lead_k(const struct chamber_body *b, const struct piece *p, double t_s)
{
    if (b->tau_element_s > 0.0) return case_after(b, p, t_s) - element_after(b, p, t_s);
    if (b->tau_case_s > 0.0) return p->air_degc + p->slope_kps * t_s - case_after(b, p, t_s);
    return p->slope_kps;
}

/* Where the lead has its extreme; it has one at most. With K the case's distance from where it would follow the ramp, and L the
 * lead's from its own: lead' = 0 at exp(t (1/e - 1/c)) = c/e (1 - L/K (e - c)/e). Below 0: nowhere. */
static double lead_extreme_s(const struct chamber_body *b, const struct piece *p)
{
    const double c = b->tau_case_s, e = b->tau_element_s;
    if (c <= 0.0 || e <= 0.0) return -1.0;
    const double case_k = p->case_degc - p->air_degc + p->slope_kps * c;
    if (case_k == 0.0) return -1.0;
    const double part = (p->case_degc - p->element_degc - p->slope_kps * e) / case_k;
    if (fabs(e - c) < ALIKE * e) return e * (1.0 + part);
    const double left = c / e * (1.0 - part * (e - c) / e);
    return left > 0.0 && isnormal(left) ? det_log(left) / (1.0 / e - 1.0 / c) : -1.0;
}

/* The element turns between two instants if the lead's sign differs there. */
static void find_turn(struct chamber_body *b, const struct piece *p, double leg_s, double low_s, double high_s)
{
    const bool up = lead_k(b, p, low_s) > 0.0;
    if ((lead_k(b, p, high_s) > 0.0) == up) return;
    for (unsigned i = 0; i < HALVINGS; i++) {
        const double mid_s = 0.5 * (low_s + high_s);
        *((lead_k(b, p, mid_s) > 0.0) == up ? &low_s : &high_s) = mid_s;
    }
    b->turn_s[b->turns] = leg_s + low_s;
    b->turn_degc[b->turns++] = element_after(b, p, low_s);
}

/* The lead is monotone on either side of its extreme: two turns at most, and the leg's end. */
static void find_turns(const struct chamber *c, struct chamber_body *b, unsigned leg)
{
    const struct piece p = piece_of(c, b, leg);
    const bool last = leg + 1 == c->legs;
    const double leg_s = c->leg[leg].from_s;
    const double end_s = last ? SETTLED * (b->tau_case_s + b->tau_element_s) : c->leg[leg + 1].from_s - leg_s;
    const double mid_s = fmin(fmax(lead_extreme_s(b, &p), 0.0), end_s);
    find_turn(b, &p, leg_s, 0.0, mid_s);
    find_turn(b, &p, leg_s, mid_s, end_s);
    if (last) return;
    b->turn_s[b->turns] = c->leg[leg + 1].from_s;
    b->turn_degc[b->turns++] = b->element_degc[leg + 1];
}

/* ---- play */

static double follow_degc(const struct chamber_play *p, double felt_degc, double element_degc)
{
    return fmin(fmax(felt_degc, element_degc - p->half_k), element_degc + p->half_k);
}

/* Between two turns the element goes one way: then the ends decide. */
double chamber_felt_degc(const struct chamber *c, const struct chamber_body *b, const struct chamber_play *p,
                         int64_t t_ns)
{
    const double t_s = sched_since_s(c->from_ns, t_ns);
    double felt_degc = p->felt_degc;
    for (unsigned i = 0; i < b->turns && b->turn_s[i] <= t_s; i++)
        felt_degc = follow_degc(p, felt_degc, b->turn_degc[i]);
    return follow_degc(p, felt_degc, chamber_element_degc(c, b, t_ns));
}

void chamber_play_add(struct chamber_body *b, struct chamber_play *p, double half_k)
{
    *p = (struct chamber_play){.half_k = half_k, .felt_degc = b->element_degc[0], .next = b->plays};
    b->plays = p;
}

/* ---- for the chamber */

void chamber_body_arrive(const struct chamber *c, struct chamber_body *b, int64_t t_ns)
{
    for (struct chamber_play *p = b->plays; p; p = p->next) p->felt_degc = chamber_felt_degc(c, b, p, t_ns);
    b->cycles = cycles_at(c, b, t_ns);
    const double case_degc = chamber_case_degc(c, b, t_ns);
    b->element_degc[0] = chamber_element_degc(c, b, t_ns);
    b->case_degc[0] = case_degc;
}

void chamber_body_forget(struct chamber_body *b)
{
    b->cycles = (struct chamber_cycles){0};
    count_cycles(&b->cycles, b->element_degc[0]);
    for (struct chamber_play *p = b->plays; p; p = p->next) p->felt_degc = b->element_degc[0];
}

void chamber_body_plan(const struct chamber *c, struct chamber_body *b)
{
    for (unsigned i = 0; i + 1 < c->legs; i++) {
        const struct piece p = piece_of(c, b, i);
        const double for_s = c->leg[i + 1].from_s - c->leg[i].from_s;
        b->case_degc[i + 1] = case_after(b, &p, for_s);
        b->element_degc[i + 1] = element_after(b, &p, for_s);
    }
    b->turns = 0;
    for (unsigned i = 0; i < c->legs; i++) find_turns(c, b, i);
}

void chamber_put_in(struct chamber *c, struct chamber_body *b, double tau_case_s, double tau_element_s)
{
    *b = (struct chamber_body){
        .tau_case_s = tau_case_s > 0.0 ? tau_case_s : c->cfg.tau_case_s,
        .tau_element_s = tau_element_s > 0.0 ? tau_element_s : c->cfg.tau_element_s,
        .case_degc = {c->cfg.start_degc},
        .element_degc = {c->cfg.start_degc},
        .next = c->bodies,
    };
    c->bodies = b;
    count_cycles(&b->cycles, b->element_degc[0]);
}

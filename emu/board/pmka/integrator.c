#include "board/pmka/integrator.h"

#define S_PER_NS 1e-9

static double at_temperature(double nominal, double tc_per_k, double degc)
{
    return nominal * (1.0 + tc_per_k * (degc - PMKA_NOMINAL_DEGC));
}

void pmka_int_init(struct pmka_int *i, const struct pmka_int_cfg *cfg)
{
    *i = (struct pmka_int){.cfg = *cfg, .cap_left = 1.0};
    pmka_int_warm(i, PMKA_NOMINAL_DEGC);
}

double pmka_int_zero_v(const struct pmka_int_cfg *cfg, double degc)
{
    return cfg->zero_v + cfg->zero_tc_v_per_k * (degc - PMKA_NOMINAL_DEGC);
}

void pmka_int_warm(struct pmka_int *i, double degc)
{
    const struct pmka_int_cfg *c = &i->cfg;
    i->cap_f = at_temperature(c->cap_f, c->cap_tc_per_k, degc);
    i->r_in_ohm = at_temperature(c->r_in_ohm, c->r_in_tc_per_k, degc);
    for (unsigned s = 0; s < 2; s++) i->rr_ohm[s] = at_temperature(c->rr_ohm[s], c->rr_tc_per_k[s], degc);
    i->zero_v = pmka_int_zero_v(c, degc);
}

void pmka_int_feed(struct pmka_int *i, double input_vs, int64_t span_ns)
{
    i->charge_c += (input_vs + i->zero_v * ((double)span_ns * S_PER_NS)) / i->r_in_ohm;
}

void pmka_int_reset(struct pmka_int *i, enum pmka_sign sign, double uref_v, int64_t span_ns)
{
    const double drawn_c = uref_v / i->rr_ohm[sign] * ((double)span_ns * S_PER_NS);
    i->charge_c += sign == PMKA_PLUS ? -drawn_c : drawn_c;
}

double pmka_int_out_v(struct pmka_int *i, int64_t t_ns)
{
    const double cap_f = i->cap_f * i->cap_left * (1.0 + i->cfg.cap_ageing_per_s * ((double)t_ns * S_PER_NS));
    const double out_v = i->charge_c / cap_f, limit_v = i->cfg.limit_v;
    if (out_v <= limit_v && out_v >= -limit_v) return out_v;
    const double at_limit_v = out_v > 0.0 ? limit_v : -limit_v;
    i->charge_c = at_limit_v * cap_f;
    i->saturated = true;
    return at_limit_v;
}

double pmka_int_ct(const struct pmka_int_cfg *cfg, enum pmka_sign sign, double uref_v, double uref_nominal_v,
                   double degc)
{
    const double r_in_ohm = at_temperature(cfg->r_in_ohm, cfg->r_in_tc_per_k, degc);
    const double rr_ohm = at_temperature(cfg->rr_ohm[sign], cfg->rr_tc_per_k[sign], degc);
    return uref_v / uref_nominal_v * r_in_ohm / (2.0 * rr_ohm);
}

void pmka_nodes(int64_t from_ns, int64_t to_ns, int64_t t_ns[PMKA_NODES])
{
    const double half = 0.5 * (double)(to_ns - from_ns);
    const int64_t off_ns = (int64_t)(half * (1.0 - 0.7745966692414834) + 0.5); /* sqrt(3/5) */
    t_ns[0] = from_ns + off_ns;
    t_ns[1] = from_ns + (to_ns - from_ns) / 2;
    t_ns[2] = to_ns - off_ns;
}

/* The sum of the squared weights: white noise then has the integral that it has in time. */
int64_t pmka_node_ns(int64_t span_ns)
{
    return (span_ns * (5 * 5 + 8 * 8 + 5 * 5) + 18 * 18 - 1) / (18 * 18);
}

double pmka_integral_vs(const double v[PMKA_NODES], int64_t span_ns)
{
    return (5.0 * (v[0] + v[2]) + 8.0 * v[1]) / 18.0 * ((double)span_ns * S_PER_NS);
}

/* One analog integrator of a PMKA with its precision reset (article section 3, figure 4), and the quadrature of its input.
 *
 * The state is the charge of the capacitor, q = C U: what flows in is (Ua + zero) / RIN, a reset draws UREF / Rr(sign). So C
 * is only between the charge and the voltage, as in the article's (1)..(4), and may age while charged. The voltage
 * follows (1): a positive input raises it; a positive reset lowers it (docs/boards/pmka.md). Pure, one thread. */
#ifndef PSABENCH_BOARD_PMKA_INTEGRATOR_H
#define PSABENCH_BOARD_PMKA_INTEGRATOR_H

#include <stdbool.h>
#include <stdint.h>

#define PMKA_NOMINAL_DEGC 25.0 /* values are those at this temperature */
#define PMKA_NODES        3u

enum pmka_sign { PMKA_PLUS, PMKA_MINUS }; /* of the voltage that a reset works against */

/* A specimen at 25 degC, and what temperature and time do to it. */
struct pmka_int_cfg {
    double cap_f, cap_tc_per_k, cap_ageing_per_s;
    double r_in_ohm, r_in_tc_per_k;
    double rr_ohm[2], rr_tc_per_k[2]; /* by enum pmka_sign */
    double zero_v, zero_tc_v_per_k;   /* as if at the input */
    double limit_v;                   /* the amplifier's swing */
};

struct pmka_int {
    struct pmka_int_cfg cfg;
    double cap_f, r_in_ohm, rr_ohm[2], zero_v; /* at the present temperature; capacitor as new */
    double cap_left;                           /* 1, or what a fault has left of the capacitor */
    double charge_c;
    bool saturated; /* the limit was reached since this was cleared by its owner */
};

void pmka_int_init(struct pmka_int *i, const struct pmka_int_cfg *cfg);
void pmka_int_warm(struct pmka_int *i, double degc);

/* Takes the integral of the input over span_ns, and its own zero for as long. */
void pmka_int_feed(struct pmka_int *i, double input_vs, int64_t span_ns);

/* The reset works for span_ns. */
void pmka_int_reset(struct pmka_int *i, enum pmka_sign sign, double uref_v, int64_t span_ns);

/* Volts at t_ns since power-on of the bench. Beyond the limit charge is lost. */
double pmka_int_out_v(struct pmka_int *i, int64_t t_ns);

/* CT of (5): what a reset of that sign of half a period is worth at a temperature, over Sr = uref_nominal_v Ts. */
double pmka_int_ct(const struct pmka_int_cfg *cfg, enum pmka_sign sign, double uref_v, double uref_nominal_v,
                   double degc);
double pmka_int_zero_v(const struct pmka_int_cfg *cfg, double degc);

/* Gauss's rule of three nodes over [from_ns, to_ns]: exact for polynomials up to the fifth degree. Nodes ascend. */
void pmka_nodes(int64_t from_ns, int64_t to_ns, int64_t t_ns[PMKA_NODES]);
int64_t pmka_node_ns(int64_t span_ns); /* interval of a node, for white noise */
double pmka_integral_vs(const double v[PMKA_NODES], int64_t span_ns);

#endif

/* What is soldered, programmed or assumed on a PIK, PIK-5 or PIK-6: one plain struct per profile.
 *
 * Filled from proto/profiles/NAME.yaml through the field table. The article gives the transfer coefficients, their errors and the
 * weights of a pulse; the parts of the circuit that would give them are our choice (E0), and the arithmetic is below. Pure. */
#ifndef PSABENCH_BOARD_PIK_PROFILE_H
#define PSABENCH_BOARD_PIK_PROFILE_H

#include "board/field.h"

#include <stdint.h>

#define PIK_SPAN_K       35.0 /* either side of 25 degC: where a specimen keeps k_error_pct, E0 */
#define PIK_LOOKS_HZ_MAX 50000
#define PIK_LATE_NS_MAX  190000.0 /* by which a pulse may be known late: within the lag of the trace */

struct pik_profile {
    char name[32];
    /* transfer: F = K Ua, K = Rr / (RIN UREF TCLK) */
    double uref_v, rr_ohm, rin_ohm;
    unsigned clock_hz;                                /* TCLK = 1 / clock_hz */
    unsigned grid;                                    /* instants in TCLK at which a reset may begin */
    unsigned recovery_ticks;                          /* of the reference after a reset, in TCLK / grid */
    double switch_on_ns, switch_off_ns, input_off_ns; /* dead times of a reset */
    /* integrator */
    double c_int_nf, uc_v, rail_v;
    double ra_ohm;       /* load of a current sensor: its scale in V/g */
    unsigned look_ticks; /* between looks at the input, in TCLK / grid */
    /* reading */
    unsigned latch_us; /* 0: by strobe alone */
    unsigned strobe_ns, strobe_min_ns, latch_ns;
    /* specimen: standard deviations */
    double k_error_pct; /* what the sum of all below keeps within PIK_SPAN_K; 0: no limit */
    double uref_tol_ppm, uref_tc_ppm_per_k;
    double ratio_tol_ppm, ratio_tc_ppm_per_k;
    double asymmetry_ppm; /* between the two signs of the reference */
    double clock_tol_ppm;
    double c_tol_pct, c_tc_ppm_per_k;
    double zero_v, zero_tc_v_per_k;
    double noise_v_rthz; /* of the integrator at the input, white */
    double saturated_ms; /* the flag and EMCY stay at least so long */
};

extern const struct fields pik_fields;

/* Of the nominal parts: Hz/V; V s of a pulse at the input, 1/K; pulses/s at most, either sign; V by which a reset moves the
 * integrator. */
double pik_profile_k_hz_per_v(const struct pik_profile *p);
double pik_profile_quantum_vs(const struct pik_profile *p);
double pik_profile_limit_hz(const struct pik_profile *p);
double pik_profile_step_v(const struct pik_profile *p);

/* Between two readings by the clock; 0: none come by themselves. */
int64_t pik_profile_period_ns(const void *profile);

/* True if a board can run it; else a sentence in why that begins with the field. */
bool pik_profile_check(const void *profile, char *why, size_t cap);

#endif

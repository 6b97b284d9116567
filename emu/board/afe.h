/* Analog chain of one accelerometer channel: current -> load resistor -> +-10 V -> buffer -> divider -> +-1.25 V -> filter
 * -> buffer -> converter input (article section 5, figure 7). Each part with tolerance, temperature coefficient and
 * noise, each a parameter; the tolerances are the unit's truth and never cross a link. */
#ifndef PSABENCH_BOARD_AFE_H
#define PSABENCH_BOARD_AFE_H

#include "base/draws.h"
#include "base/looks.h"

#include <stdbool.h>
#include <stdint.h>

enum afe_input {
    AFE_CURRENT,
    AFE_VOLTAGE
}; /* quartz sensor through the load / voltage-output MEMS straight to the buffer */

struct afe_cfg {
    enum afe_input input;
    double load_ohm, load_tol_ppm, load_tc_ppm_per_k;
    double divider_ratio, divider_tol_ppm, divider_tc_ppm_per_k; /* nominal 8: +-10 V to +-1.25 V */
    double buffer_offset_v, buffer_offset_tc_v_per_k;            /* referred to the load */
    double clip_v;       /* supply-limited swing at the load, nominally 10 V plus margin */
    double filter_hz;    /* corner of the one-pole anti-alias filter; 0: none */
    double noise_v_rthz; /* white, at the load, one-sided density */
};

/* What goes wrong in the chain. The reference is that of the channel's converter: a code is volts over it, so that a
 * reference too high is an input too low. An open load drives the buffer to the limit the current points at, a zero
 * current to the positive one (the buffer's bias current, E0). */
enum afe_fault_kind {
    AFE_LOAD_OPEN,
    AFE_LOAD_SHORT,
    AFE_REFERENCE, /* value: relative error; rate_per_s: its growth from from_ns on */
    AFE_RIPPLE,    /* value: amplitude at the load, V; frequency_hz; phase 0 at from_ns. See AFE_SLOW_HZ */
    AFE_FAULTS
};

/* A faster ripple passes the pole as it does in the part, V / (1 + j f / filter_hz), not as steps held from look to look: what
 * comes near the rate of the looks, a multiple of it included, is a slow signal to them. */
#define AFE_SLOW_HZ 100.0

/* One fault, owned by its injector, linked in while it lasts. */
struct afe_fault {
    enum afe_fault_kind kind;
    double value, rate_per_s, frequency_hz;
    int64_t from_ns;
    struct afe_fault *next;
};

/* What the temperature does to the chain. */
struct afe_scale {
    double degc;    /* at which it is so */
    double load;    /* V per unit of the signal: ohm, or 1 */
    double drift_v; /* of the buffer's offset */
    double divider;
};

struct afe {
    struct afe_cfg cfg;
    struct afe_scale scale;
    struct draws noise;
    double state_v; /* filter */
    int64_t t_ns;   /* of the state; -1 before the first call */
    int64_t dt_ns;  /* step for which `keep` holds; negative before the first call */
    double keep;    /* what remains of the filter's state after a step */
    struct afe_fault *faults;
};

void afe_init(struct afe *a, const struct afe_cfg *cfg, struct draws noise);

/* Links in as the last; the fault is filled in by the caller. Removing what is not there is harmless. */
void afe_fault_add(struct afe *a, struct afe_fault *f);
void afe_fault_remove(struct afe *a, struct afe_fault *f);

/* Ideal chain, all tolerances and errors zero: 1 kohm (10 V at 10 mA), 1 : 8, 10 kHz, clipping at 10.5 V. */
struct afe_cfg afe_nominal(enum afe_input input);

/* The widest that a scenario may ask for (scenario/lab.c). */
enum { BOARD_COLDEST_DEGC = -100, BOARD_WARMEST_DEGC = 200 };

/* Volts at the converter for signals within a range, noise of looks every_ns apart included, at -100 to 200 degC. */
struct looks_range afe_range_v(const struct afe *a, struct looks_range signal, int64_t every_ns);

/* Whether its state is, to the bit, that of any other past after some hundred looks every_ns apart. */
bool afe_forgets(const struct afe *a, int64_t every_ns);

/* As if the last look had been at t_ns. */
void afe_skip(struct afe *a, int64_t t_ns);

/* A row of looks in place: signals in (A or V by cfg.input), volts at the converter out, at a board temperature, filter and noise
 * included. No look is earlier than the last call's, the same instant gives the same volts. The filter takes the signal as held
 * since the look before. */
void afe_out_row_v(struct afe *a, double *signal_to_v, double temp_degc, const struct looks *at);

#endif

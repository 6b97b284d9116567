/* Thermal chamber, and the bodies in it.
 *
 * The air goes to its set point at a constant ramp and stays there. A body follows it through two lags: its case follows the
 * air, its sensing element follows the case,
 *
 *   tau_case case' = air - case,   tau_element element' = case - element,
 *
 * both in closed form over the straight pieces of the air's course: temperatures are functions of time, independent of
 * how often they are read. So is how many thermal cycles a body has had: an element that has been cold and then is hot, powered
 * or not; on its way up, the part of a cycle. And so is what follows an element with play. Both are folds over the element's
 * extremes, which a command finds beforehand.
 *
 * A command updates every body in the chamber. Plain structs, one thread; commands in order of time; an instant before the
 * latest command gets what held at the command. */
#ifndef PSABENCH_PHYS_CHAMBER_H
#define PSABENCH_PHYS_CHAMBER_H

#include <stdbool.h>
#include <stdint.h>

struct chamber_cfg {
    bool present;
    double start_degc; /* of air and bodies: set point at power-on */
    double min_degc, max_degc;
    double heating_max_k_per_min, cooling_max_k_per_min;
    double ramp_k_per_min;                         /* at power-on; the air takes the lesser of ramp and limit */
    double tau_case_s, tau_element_s;              /* of bodies that do not give their own; 0: no lag */
    double readout_offset_k, readout_resolution_k; /* of the chamber's thermometer in the air; 0: none */
};

#define CHAMBER_RAMP_MIN_K_PER_MIN 0.001

enum chamber_result { CHAMBER_OK, CHAMBER_OUT_OF_RANGE };

/* Ten kelvin inside the run-in of the article, -60 to +85 degC (E0): an element need not be soaked to the last kelvin. */
#define CHAMBER_CYCLE_COLD_DEGC (-50.0)
#define CHAMBER_CYCLE_HOT_DEGC  75.0

/* Thermal cycles of an element. */
struct chamber_cycles {
    bool cold; /* it has been, since the last whole cycle */
    unsigned whole;
    double part; /* of the next one: how far up it has been */
};

/* What follows an element with play: it stays where it is until the element is half_k away. Embedded in its owner. */
struct chamber_play {
    double half_k;
    double felt_degc; /* at the chamber's latest command */
    struct chamber_play *next;
};

/* Straight pieces of the air's course after a command, the last without an end; and where an element turns on them. */
#define CHAMBER_LEGS  3u
#define CHAMBER_TURNS (3u * CHAMBER_LEGS)

/* Something in the chamber; embedded in its owner, not to be moved after chamber_put_in(). */
struct chamber_body {
    double tau_case_s, tau_element_s;
    double case_degc[CHAMBER_LEGS], element_degc[CHAMBER_LEGS]; /* where each leg begins */
    double turn_s[CHAMBER_TURNS], turn_degc[CHAMBER_TURNS];     /* the element's extremes, since the command */
    unsigned turns;
    struct chamber_cycles cycles; /* up to the latest command */
    struct chamber_play *plays;
    struct chamber_body *next;
};

struct chamber_leg {
    double from_s; /* since the command */
    double air_degc, slope_kps;
};

struct chamber {
    struct chamber_cfg cfg;
    double ramp_k_per_min;
    double rate_part;    /* of a faulty one: part of its ramp that the air makes; 1: all of it */
    double misreading_k; /* of a faulty thermometer */
    double overshoot_k;  /* of a faulty controller: how far past the set point the air goes; 0: not at all */
    double set_degc;
    int64_t from_ns; /* of the latest command */
    struct chamber_leg leg[CHAMBER_LEGS];
    unsigned legs; /* the last is at the set point */
    struct chamber_body *bodies;
};

/* The chamber of the quartz article: -60..+85 degC (docs/instruments.md); not present. */
struct chamber_cfg chamber_default(void);

void chamber_init(struct chamber *c, const struct chamber_cfg *cfg);

/* In equilibrium with the air at power-on; before the first command. Lags not above 0: the chamber's own. */
void chamber_put_in(struct chamber *c, struct chamber_body *b, double tau_case_s, double tau_element_s);

/* New set point, reached with the present ramp. */
enum chamber_result chamber_set(struct chamber *c, double degc, int64_t t_ns);

/* New ramp, from CHAMBER_RAMP_MIN_K_PER_MIN up to the greater of the two limits; one that is under way goes on with it. */
enum chamber_result chamber_ramp(struct chamber *c, double k_per_min, int64_t t_ns);

/* It follows the element of a body from power-on, where it is as warm; half_k at least 0. */
void chamber_play_add(struct chamber_body *b, struct chamber_play *p, double half_k);

/* What is in the body is exchanged: no thermal cycle, no play taken, as warm as what was there. The chamber is stable. */
void chamber_renew(struct chamber *c, struct chamber_body *b, int64_t t_ns);

/* Faults: the air makes this part of its ramp from now on (above 0; 1: none); it goes so far past its set point, but no farther
 * than the step and -100 to 200 degC, and comes back with its ramp (0: none); the thermometer reads so much more (0: none). */
void chamber_hinder(struct chamber *c, double rate_part, int64_t t_ns);
void chamber_overshoot(struct chamber *c, double overshoot_k, int64_t t_ns);
void chamber_mislead(struct chamber *c, double misreading_k);

double chamber_ramp_max_k_per_min(const struct chamber *c);

double chamber_air_degc(const struct chamber *c, int64_t t_ns);   /* truth */
double chamber_shown_degc(const struct chamber *c, int64_t t_ns); /* by its thermometer */
bool chamber_stable(const struct chamber *c, int64_t t_ns);       /* the air is at the set point */
int64_t chamber_stable_ns(const struct chamber *c);               /* since or from when */

double chamber_case_degc(const struct chamber *c, const struct chamber_body *b, int64_t t_ns);
double chamber_element_degc(const struct chamber *c, const struct chamber_body *b, int64_t t_ns);
double chamber_felt_degc(const struct chamber *c, const struct chamber_body *b, const struct chamber_play *p,
                         int64_t t_ns);

/* Thermal cycles since it was put in, with the part of the present one. */
double chamber_body_cycles(const struct chamber *c, const struct chamber_body *b, int64_t t_ns);

#endif

/* Laboratory supply: voltage, output on and off, slewing, ripple, dips; and the brown-out threshold of its loads.
 *
 * The voltage is a function of time. Loads go off when it falls below brownout_v, and on when it is back at brownout_v +
 * hysteresis_v: supply_next_ns() gives the exact nanosecond, so that the bench can schedule an event instead of polling. After
 * any command or dip call it again. Plain struct, one thread;
 * commands in order of time; an instant before the latest command gets what held at the command. */
#ifndef PSABENCH_PHYS_SUPPLY_H
#define PSABENCH_PHYS_SUPPLY_H

#include <stdbool.h>
#include <stdint.h>

#define SUPPLY_DIPS_MAX      64u
#define SUPPLY_RIPPLE_MIN_HZ 0.001 /* less: no ripple */
#define SUPPLY_SLEW_MIN_VPS  1e-6

struct supply_cfg {
    bool present;  /* false: loads are always on */
    double volt_v; /* at power-on, output on */
    double volt_max_v;
    double slew_v_per_s;        /* of the output after a command; 0: at once */
    double ripple_v, ripple_hz; /* at power-on: amplitude of a sine; 0: none */
    double ripple_max_v, ripple_max_hz;
    double brownout_v, hysteresis_v;
    double readout_resolution_v; /* of its voltmeter; 0: none */
};

enum supply_result {
    SUPPLY_OK,
    SUPPLY_OUT_OF_RANGE,
    SUPPLY_TOO_MANY_DIPS /* SUPPLY_DIPS_MAX are due or under way */
};

/* The output is lower by drop_v (not below 0) from from_ns until to_ns. */
struct supply_dip {
    int64_t from_ns, to_ns;
    double drop_v;
};

struct supply {
    struct supply_cfg cfg;
    bool on;
    double set_v;
    double ripple_v, ripple_hz;
    int64_t ripple_ns; /* phase 0 */
    int64_t from_ns;   /* of the latest change of the output */
    double from_v;     /* without ripple and dips, then */
    unsigned dips;     /* places of dip that have been in use */
    struct supply_dip dip[SUPPLY_DIPS_MAX];
};

/* 12 V, 15 V at most, brown-out at 9 V with 0.5 V of hysteresis (E0); not present. */
struct supply_cfg supply_default(void);

void supply_init(struct supply *s, const struct supply_cfg *cfg);

enum supply_result supply_set(struct supply *s, double volt_v, int64_t t_ns);
void supply_output(struct supply *s, bool on, int64_t t_ns);
enum supply_result supply_ripple(struct supply *s, double amplitude_v, double frequency_hz, int64_t t_ns);

/* A dip from from_ns (not before t_ns, which is now) for for_ns; it may be deeper than the supply is high. */
enum supply_result supply_dip(struct supply *s, double drop_v, int64_t from_ns, int64_t for_ns, int64_t t_ns);

/* Ends the dip with these arguments; harmless if it is over. */
void supply_dip_end(struct supply *s, double drop_v, int64_t from_ns, int64_t for_ns, int64_t t_ns);

double supply_volts(const struct supply *s, int64_t t_ns);   /* truth */
double supply_shown_v(const struct supply *s, int64_t t_ns); /* by its voltmeter */

/* Whether what was fed (or not) stays so at t_ns. An absent supply feeds always. */
bool supply_feeds(const struct supply *s, bool fed, int64_t t_ns);

/* First instant from from_ns on at which supply_feeds(s, fed, .) is not fed; INT64_MAX if nothing will happen. */
int64_t supply_next_ns(const struct supply *s, bool fed, int64_t from_ns);

#endif

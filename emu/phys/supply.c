#include "phys/supply.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <math.h>

struct supply_cfg supply_default(void)
{
    return (struct supply_cfg){
        .volt_v = 12.0,
        .volt_max_v = 15.0,
        .ripple_max_v = 5.0,
        .ripple_max_hz = 1e6,
        .brownout_v = 9.0,
        .hysteresis_v = 0.5,
    };
}

void supply_init(struct supply *s, const struct supply_cfg *cfg)
{
    *s = (struct supply){.cfg = *cfg,
                         .on = true,
                         .set_v = cfg->volt_v,
                         .from_v = cfg->volt_v,
                         .ripple_v = cfg->ripple_hz >= SUPPLY_RIPPLE_MIN_HZ ? cfg->ripple_v : 0.0,
                         .ripple_hz = cfg->ripple_hz};
    if (s->cfg.slew_v_per_s > 0.0) s->cfg.slew_v_per_s = fmax(s->cfg.slew_v_per_s, SUPPLY_SLEW_MIN_VPS);
}

/* ---- the volts */

static double wanted_v(const struct supply *s)
{
    return s->on ? s->set_v : 0.0;
}

static double slope_vps(const struct supply *s)
{
    return copysign(s->cfg.slew_v_per_s, wanted_v(s) - s->from_v);
}

static int64_t slewed_ns(const struct supply *s)
{
    if (s->cfg.slew_v_per_s <= 0.0) return s->from_ns;
    return s->from_ns + (int64_t)(fabs(wanted_v(s) - s->from_v) / s->cfg.slew_v_per_s * (double)NS_PER_S);
}

static double steady_v(const struct supply *s, int64_t t_ns)
{
    if (t_ns < s->from_ns) return s->from_v;
    if (t_ns >= slewed_ns(s)) return wanted_v(s);
    return s->from_v + slope_vps(s) * ((double)(t_ns - s->from_ns) / (double)NS_PER_S);
}

static double ripple_v(const struct supply *s, int64_t t_ns)
{
    if (s->ripple_v == 0.0) return 0.0;
    const double cycles = s->ripple_hz * ((double)(t_ns - s->ripple_ns) / (double)NS_PER_S);
    return s->ripple_v * det_sin(TURN_RAD * (cycles - floor(cycles)));
}

static double drop_v(const struct supply *s, int64_t t_ns)
{
    double sum_v = 0.0;
    for (unsigned i = 0; i < s->dips; i++) {
        if (t_ns >= s->dip[i].from_ns && t_ns < s->dip[i].to_ns) sum_v += s->dip[i].drop_v;
    }
    return sum_v;
}

/* The ripple is the supply's own: with the output off and run down there is none. */
double supply_volts(const struct supply *s, int64_t t_ns)
{
    const double v = steady_v(s, t_ns);
    return v > 0.0 ? fmax(0.0, v + ripple_v(s, t_ns) - drop_v(s, t_ns)) : 0.0;
}

double supply_shown_v(const struct supply *s, int64_t t_ns)
{
    return det_quantise(supply_volts(s, t_ns), s->cfg.readout_resolution_v);
}

/* ---- commands */

static void change_output(struct supply *s, double set_v, bool on, int64_t t_ns)
{
    s->from_v = steady_v(s, t_ns);
    s->from_ns = t_ns;
    s->set_v = set_v;
    s->on = on;
}

enum supply_result supply_set(struct supply *s, double volt_v, int64_t t_ns)
{
    if (!(volt_v >= 0.0 && volt_v <= s->cfg.volt_max_v)) return SUPPLY_OUT_OF_RANGE;
    change_output(s, volt_v, s->on, t_ns);
    return SUPPLY_OK;
}

void supply_output(struct supply *s, bool on, int64_t t_ns)
{
    change_output(s, s->set_v, on, t_ns);
}

enum supply_result supply_ripple(struct supply *s, double amplitude_v, double frequency_hz, int64_t t_ns)
{
    if (!(amplitude_v >= 0.0 && amplitude_v <= s->cfg.ripple_max_v)) return SUPPLY_OUT_OF_RANGE;
    if (!(frequency_hz >= SUPPLY_RIPPLE_MIN_HZ && frequency_hz <= s->cfg.ripple_max_hz)) return SUPPLY_OUT_OF_RANGE;
    s->ripple_v = amplitude_v;
    s->ripple_hz = frequency_hz;
    s->ripple_ns = t_ns;
    return SUPPLY_OK;
}

static int64_t dip_end_ns(int64_t from_ns, int64_t for_ns)
{
    return for_ns < INT64_MAX - from_ns ? from_ns + for_ns : INT64_MAX;
}

enum supply_result supply_dip(struct supply *s, double deep_v, int64_t from_ns, int64_t for_ns, int64_t t_ns)
{
    if (!(deep_v > 0.0) || from_ns < t_ns || for_ns <= 0) return SUPPLY_OUT_OF_RANGE;
    for (unsigned i = 0; i < SUPPLY_DIPS_MAX; i++) {
        if (s->dip[i].to_ns > t_ns) continue;
        s->dip[i] = (struct supply_dip){from_ns, dip_end_ns(from_ns, for_ns), deep_v};
        if (i == s->dips) s->dips++;
        return SUPPLY_OK;
    }
    return SUPPLY_TOO_MANY_DIPS;
}

/* Of two that are alike one ends, whichever. */
void supply_dip_end(struct supply *s, double deep_v, int64_t from_ns, int64_t for_ns, int64_t t_ns)
{
    const int64_t to_ns = dip_end_ns(from_ns, for_ns);
    for (unsigned i = 0; i < s->dips && to_ns > t_ns; i++) {
        struct supply_dip *d = &s->dip[i];
        if (d->from_ns != from_ns || d->to_ns != to_ns || d->drop_v < deep_v || d->drop_v > deep_v) continue;
        d->to_ns = t_ns;
        return;
    }
}

/* ---- crossings: between changes of the output and edges of dips the volts are a line and a sine. Between the instants at
 * which such a sum may turn it is monotone, and there the crossing is found by halving, to the nanosecond. */

bool supply_feeds(const struct supply *s, bool fed, int64_t t_ns)
{
    if (!s->cfg.present) return true;
    const double v = supply_volts(s, t_ns);
    return v >= s->cfg.brownout_v + (fed ? 0.0 : s->cfg.hysteresis_v);
}

/* The next instant after t_ns at which the course may break. */
static int64_t next_break_ns(const struct supply *s, int64_t t_ns)
{
    int64_t next_ns = INT64_MAX;
    const int64_t slewed = slewed_ns(s);
    if (s->from_ns > t_ns) next_ns = s->from_ns;
    if (slewed > t_ns && slewed < next_ns) next_ns = slewed;
    for (unsigned i = 0; i < s->dips; i++) {
        if (s->dip[i].from_ns > t_ns && s->dip[i].from_ns < next_ns) next_ns = s->dip[i].from_ns;
        if (s->dip[i].to_ns > t_ns && s->dip[i].to_ns < next_ns) next_ns = s->dip[i].to_ns;
    }
    return next_ns;
}

/* The volts are monotone from lo to hi and at hi the state is another: the first instant at which it is. */
static int64_t first_change_ns(const struct supply *s, bool fed, int64_t lo_ns, int64_t hi_ns)
{
    if (supply_feeds(s, fed, lo_ns) != fed) return lo_ns;
    while (hi_ns - lo_ns > 1) {
        const int64_t mid_ns = lo_ns + (hi_ns - lo_ns) / 2;
        if (supply_feeds(s, fed, mid_ns) != fed) {
            hi_ns = mid_ns;
        } else {
            lo_ns = mid_ns;
        }
    }
    return hi_ns;
}

static int64_t quarter_ns(const struct supply *s, double quarters)
{
    return s->ripple_ns + (int64_t)nearbyint(quarters / (4.0 * s->ripple_hz) * (double)NS_PER_S);
}

/* Start of the quarter of the ripple after t_ns. Quarters hold every turn of the sine alone. A start that was rounded down
 * counts itself as the next once more. */
static int64_t quarter_after_ns(const struct supply *s, int64_t t_ns)
{
    const double quarters = floor(4.0 * s->ripple_hz * ((double)(t_ns - s->ripple_ns) / (double)NS_PER_S)) + 1.0;
    const int64_t next_ns = quarter_ns(s, quarters);
    return next_ns > t_ns ? next_ns : quarter_ns(s, quarters + 1.0);
}

/* Slope of line and sine together, V/s. */
static double climb_vps(const struct supply *s, double slope, int64_t t_ns)
{
    const double cycles = s->ripple_hz * ((double)(t_ns - s->ripple_ns) / (double)NS_PER_S);
    return slope + s->ripple_v * TURN_RAD * s->ripple_hz * det_cos(TURN_RAD * (cycles - floor(cycles)));
}

/* The instant within a quarter at which line and sine together turn, or its end: the slope of the sine is monotone there. */
static int64_t turn_ns(const struct supply *s, double slope, int64_t lo_ns, int64_t hi_ns)
{
    const bool up = climb_vps(s, slope, lo_ns) > 0.0;
    while (hi_ns - lo_ns > 1) {
        const int64_t mid_ns = lo_ns + (hi_ns - lo_ns) / 2;
        if ((climb_vps(s, slope, mid_ns) > 0.0) == up) {
            lo_ns = mid_ns;
        } else {
            hi_ns = mid_ns;
        }
    }
    return hi_ns;
}

/* A slope towards the threshold: nothing happens before the sine's envelope is there, and something within a period after. */
static int64_t envelope_ns(const struct supply *s, bool fed, double slope, int64_t lo_ns, int64_t last_ns)
{
    if ((slope < 0.0) != fed || slope == 0.0) return lo_ns;
    const double limit_v =
        fed ? s->cfg.brownout_v + s->ripple_v : s->cfg.brownout_v + s->cfg.hysteresis_v - s->ripple_v;
    const double t_s = (limit_v - (steady_v(s, lo_ns) - drop_v(s, lo_ns))) / slope;
    const double wait_ns = fmax(0.0, (t_s - 1.0 / s->ripple_hz) * (double)NS_PER_S);
    return wait_ns >= (double)(last_ns - lo_ns) ? last_ns : lo_ns + (int64_t)wait_ns;
}

/* The first change from lo to last, both included; INT64_MAX: none. Nothing breaks in between. */
static int64_t change_within_ns(const struct supply *s, bool fed, int64_t lo_ns, int64_t last_ns)
{
    enum { QUARTERS = 10 }; /* two periods and what rounding may add */
    const double slope = lo_ns >= s->from_ns && lo_ns < slewed_ns(s) ? slope_vps(s) : 0.0;
    if (supply_feeds(s, fed, lo_ns) != fed) return lo_ns;
    if (s->ripple_v == 0.0)
        return supply_feeds(s, fed, last_ns) != fed ? first_change_ns(s, fed, lo_ns, last_ns) : INT64_MAX;
    lo_ns = envelope_ns(s, fed, slope, lo_ns, last_ns);
    for (unsigned i = 0; i < QUARTERS && lo_ns < last_ns; i++) {
        int64_t end_ns = quarter_after_ns(s, lo_ns);
        if (end_ns > last_ns) end_ns = last_ns;
        const int64_t mid_ns = slope != 0.0 ? turn_ns(s, slope, lo_ns, end_ns) : end_ns;
        if (supply_feeds(s, fed, mid_ns) != fed) return first_change_ns(s, fed, lo_ns, mid_ns);
        if (supply_feeds(s, fed, end_ns) != fed) return first_change_ns(s, fed, mid_ns, end_ns);
        lo_ns = end_ns;
    }
    return INT64_MAX;
}

int64_t supply_next_ns(const struct supply *s, bool fed, int64_t from_ns)
{
    while (s->cfg.present) {
        const int64_t break_ns = next_break_ns(s, from_ns);
        const int64_t change_ns = change_within_ns(s, fed, from_ns, break_ns == INT64_MAX ? INT64_MAX : break_ns - 1);
        if (change_ns != INT64_MAX || break_ns == INT64_MAX) return change_ns;
        from_ns = break_ns;
    }
    return supply_feeds(s, fed, from_ns) == fed ? INT64_MAX : from_ns;
}

#include "phys/flight/swing.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <math.h>

/* The septic and its derivatives by s. */
static struct jet septic_at(double s)
{
    const double r = 1.0 - s;
    return (struct jet){
        .at = s * s * s * s * (35.0 + s * (-84.0 + s * (70.0 - 20.0 * s))),
        .d1 = 140.0 * s * s * s * r * r * r,
        .d2 = 420.0 * s * s * r * r * (1.0 - 2.0 * s),
        .d3 = 840.0 * s * r * (1.0 - 5.0 * s * r),
    };
}

/* sign: -1 where the envelope falls. */
static struct jet edge_at(double s, double edge_s, double sign)
{
    const struct jet e = septic_at(s);
    const double rate = sign / edge_s;
    return (struct jet){e.at, e.d1 * rate, e.d2 * rate * rate, e.d3 * rate * rate * rate};
}

static struct jet envelope_at(const struct swing *s, int64_t t_ns)
{
    const double edge_s = sched_since_s(0, s->edge_ns);
    if (t_ns < s->from_ns + s->edge_ns) return edge_at(sched_since_s(s->from_ns, t_ns) / edge_s, edge_s, 1.0);
    if (t_ns > s->to_ns - s->edge_ns) return edge_at(sched_since_s(t_ns, s->to_ns) / edge_s, edge_s, -1.0);
    return (struct jet){.at = 1.0};
}

struct jet swing_at(const struct swing *s, int64_t t_ns)
{
    if (t_ns <= s->from_ns || t_ns >= s->to_ns) return (struct jet){0};
    const double turns = sched_since_s(s->from_ns, t_ns) / s->period_s;
    const struct det_pair at = det_sin_cos(TURN_RAD * (turns - floor(turns)));
    const double a = s->amplitude_rad, w = TURN_RAD / s->period_s;
    const struct jet e = envelope_at(s, t_ns);
    const struct jet u = {a * at.sin, a * w * at.cos, -a * w * w * at.sin, -a * w * w * w * at.cos};
    return (struct jet){
        .at = e.at * u.at,
        .d1 = e.d1 * u.at + e.at * u.d1,
        .d2 = e.d2 * u.at + 2.0 * e.d1 * u.d1 + e.at * u.d2,
        .d3 = e.d3 * u.at + 3.0 * e.d2 * u.d1 + 3.0 * e.d1 * u.d2 + e.at * u.d3,
    };
}

int64_t swing_next_ns(const struct swing *s, int64_t t_ns)
{
    const int64_t cuts[] = {s->from_ns, s->from_ns + s->edge_ns, s->to_ns - s->edge_ns, s->to_ns};
    for (unsigned i = 0; i < sizeof cuts / sizeof *cuts; i++)
        if (cuts[i] > t_ns) return cuts[i];
    return INT64_MAX;
}

#include "phys/flight/channel.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <assert.h>
#include <math.h>

#define GRAIN_NS   INT64_C(1000000)
#define GRAIN_S    1e-3
#define STEEPEST   1.875             /* of the quintic: its first derivative, at s = 1/2 */
#define SHARPEST   5.773502691896258 /* its second, 10/sqrt 3, at s = 1/2 -+ 1/sqrt 12 */
#define SHORTEST_S 0.05              /* of a rise */

/* ---- ramps */

static double rise_s(double rate, const struct ramp_limits *limits)
{
    return fmax(SHORTEST_S, fmax(STEEPEST * rate / limits->first, sqrt(SHARPEST * rate / limits->second)));
}

/* The rate at which rise and fall alone make a way: rate * rise_s(rate) = way. */
static double peak_rate(double way, const struct ramp_limits *limits)
{
    const double by_first = sqrt(way * limits->first / STEEPEST);
    const double by_second = det_exp(det_log(way * sqrt(limits->second / SHARPEST)) * 2.0 / 3.0);
    return fmin(fmin(limits->rate, way / SHORTEST_S), fmin(by_first, by_second));
}

static int64_t grains_up_ns(double t_s)
{
    return (int64_t)ceil(t_s / GRAIN_S - 1e-6) * GRAIN_NS;
}

static double ns_to_s(int64_t dt_ns)
{
    return sched_since_s(0, dt_ns);
}

struct ramp ramp_plan(double by, const struct ramp_limits *limits)
{
    const double way = fabs(by);
    if (way < 1e-12) return (struct ramp){.by = by};
    const double rate = peak_rate(way, limits);
    const int64_t rise_ns = grains_up_ns(rise_s(rate, limits));
    const int64_t hold_ns = grains_up_ns(fmax(0.0, way / rate - ns_to_s(rise_ns)));
    return (struct ramp){rise_ns, hold_ns, by / ns_to_s(rise_ns + hold_ns), by};
}

int64_t ramp_ns(const struct ramp *r)
{
    return 2 * r->rise_ns + r->hold_ns;
}

/* ---- pieces */

void channel_init(struct channel *c, double value)
{
    c->count = 1;
    c->piece[0] = (struct channel_piece){.from_ns = INT64_MIN, .length_s = 1.0, .c = {value}};
}

static struct channel_piece *add_piece(struct channel *c, int64_t from_ns, int64_t length_ns)
{
    assert(c->count < CHANNEL_PIECES);
    struct channel_piece *p = &c->piece[c->count++];
    *p = (struct channel_piece){.from_ns = from_ns, .length_s = ns_to_s(length_ns)};
    return p;
}

/* Integrals of the quintic and of what it lacks to 1. */
void channel_ramp(struct channel *c, const struct ramp *r, int64_t from_ns)
{
    const double from = channel_at(c, from_ns).at;
    const double half = 0.5 * r->rate * ns_to_s(r->rise_ns);
    const int64_t fall_ns = from_ns + r->rise_ns + r->hold_ns;
    if (ramp_ns(r) == 0) return;
    assert(c->piece[c->count - 1].from_ns <= from_ns);
    *add_piece(c, from_ns, r->rise_ns) = (struct channel_piece){
        from_ns, ns_to_s(r->rise_ns), {from, 0.0, 0.0, 0.0, 5.0 * half, -6.0 * half, 2.0 * half}};
    if (r->hold_ns > 0) {
        struct channel_piece *hold = add_piece(c, from_ns + r->rise_ns, r->hold_ns);
        hold->c[0] = from + half;
        hold->c[1] = r->rate * ns_to_s(r->hold_ns);
    }
    *add_piece(c, fall_ns, r->rise_ns) =
        (struct channel_piece){fall_ns,
                               ns_to_s(r->rise_ns),
                               {from + r->by - half, 2.0 * half, 0.0, 0.0, -5.0 * half, 6.0 * half, -2.0 * half}};
    add_piece(c, fall_ns + r->rise_ns, NS_PER_S)->c[0] = from + r->by;
}

static unsigned piece_at(const struct channel *c, int64_t t_ns)
{
    unsigned low = 0, high = c->count;
    while (high - low > 1) {
        const unsigned middle = (low + high) / 2;
        if (c->piece[middle].from_ns <= t_ns) low = middle;
        else high = middle;
    }
    return low;
}

/* The n lowest derivatives; of a constant without arithmetic on the time. */
static unsigned derive_piece(const struct channel *c, int64_t t_ns, double *d, unsigned n)
{
    const unsigned i = piece_at(c, t_ns);
    const struct channel_piece *p = &c->piece[i];
    const double s = p->from_ns == INT64_MIN ? 0.0 : sched_since_s(p->from_ns, t_ns) / p->length_s;
    double scale = 1.0;
    for (unsigned k = 0; k < n; k++) {
        double sum = 0.0;
        for (unsigned j = CHANNEL_ORDER + 1; j-- > k;) {
            double falling = 1.0;
            for (unsigned m = 0; m < k; m++) falling *= (double)(j - m);
            sum = sum * s + falling * p->c[j];
        }
        d[k] = sum * scale;
        scale /= p->length_s;
    }
    return i;
}

struct jet channel_at(const struct channel *c, int64_t t_ns)
{
    double d[4];
    (void)derive_piece(c, t_ns, d, 4);
    return (struct jet){d[0], d[1], d[2], d[3]};
}

unsigned channel_derivatives(const struct channel *c, int64_t t_ns, double d[CHANNEL_ORDER + 1])
{
    return derive_piece(c, t_ns, d, CHANNEL_ORDER + 1);
}

int64_t channel_next_ns(const struct channel *c, int64_t t_ns)
{
    const unsigned next = piece_at(c, t_ns) + 1;
    return next < c->count ? c->piece[next].from_ns : INT64_MAX;
}

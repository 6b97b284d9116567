/* A quantity of a flight as a function of time: pieces of polynomials, and ramps that make them.
 *
 * A ramp leads from one value to another: the rate rises by the quintic 6 s^5 - 15 s^4 + 10 s^3, stays, and falls the same way,
 * so the rate has two continuous derivatives. Times of pieces are whole milliseconds. Plain struct, pure but for what builds it;
 * ramps in order of time. */
#ifndef PSABENCH_PHYS_FLIGHT_CHANNEL_H
#define PSABENCH_PHYS_FLIGHT_CHANNEL_H

#include <stdint.h>

#define CHANNEL_ORDER  6u
#define CHANNEL_PIECES 400u

/* Value and time derivatives; what is beyond d[3] is of channel_derivatives() alone. */
struct jet {
    double at, d1, d2, d3;
};

struct channel_piece {
    int64_t from_ns;
    double length_s;             /* unit of s; the last piece goes on for good */
    double c[CHANNEL_ORDER + 1]; /* sum of c[k] s^k, s = (t - from) / length */
};

struct channel {
    unsigned count;
    struct channel_piece piece[CHANNEL_PIECES];
};

/* Limits of a ramp: of its rate and of the rate's two derivatives; all above 0. */
struct ramp_limits {
    double rate, first, second;
};

struct ramp {
    int64_t rise_ns, hold_ns; /* rate rises, stays, and falls for rise_ns again */
    double rate;              /* with its sign */
    double by;
};

/* The fastest ramp by so much. By 0: one of no duration. */
struct ramp ramp_plan(double by, const struct ramp_limits *limits);
int64_t ramp_ns(const struct ramp *r);

void channel_init(struct channel *c, double value);

/* Not before the end of the ramp before it. There is room for CHANNEL_PIECES / 4 ramps. */
void channel_ramp(struct channel *c, const struct ramp *r, int64_t from_ns);

struct jet channel_at(const struct channel *c, int64_t t_ns);

/* Value and derivatives up to CHANNEL_ORDER. Returns the number of the piece. */
unsigned channel_derivatives(const struct channel *c, int64_t t_ns, double d[CHANNEL_ORDER + 1]);

/* Where the next piece begins; INT64_MAX: none does. */
int64_t channel_next_ns(const struct channel *c, int64_t t_ns);

#endif

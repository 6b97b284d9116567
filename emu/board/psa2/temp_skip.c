/* Temperature conversions that no one looks at.
 *
 * A conversion is a burst that writes MUX, a pulse on SYNC_T, the wait for DRD_T, a burst that reads; a burst waits for the end
 * of a reading of the accelerometers that it would meet. Here only the instants are followed, by the arithmetic of port, pulse
 * and converter. The last conversion is begun for real, ahead of the board's time: it lies where it would have come to. */
#include "board/psa2/internal.h"

#define AHEAD_NS  NS_PER_S /* at most: a board that is looked at unexpectedly has to get there before it is awake */
#define TURN_MORE 2 /* conversions after the last that is skipped until each channel's code is true, and in a frame */

/* One of the two bursts of a conversion. */
struct burst {
    struct psa2_xfer x;
    int64_t span_ns; /* from where the port is ready for it to its end, at most */
};

struct scan {
    const struct psa2 *b;
    const struct burst *write, *read;
    struct psa2_spi_past past; /* of the serial port */
    struct clk_pos drd_a;      /* data-ready at or before the instant */
    int64_t read_ns;           /* the reading that it began is over */
    int64_t sync_ns;           /* SYNC_T of the conversion under way */
    struct ads1256_run run;
};

static struct burst burst_of(const struct psa2 *b, struct psa2_xfer x)
{
    const struct psa2_spi_past ready = {.ready_ns = {0}};
    return (struct burst){x, psa2_spi_span_ns(b, &ready, &x, 0)};
}

/* To the latest data-ready at t_ns, from one before it. */
static void pass_readings(struct scan *s, int64_t t_ns)
{
    const struct clk_pos latest = clk_on_to(s->drd_a, &s->b->adc[0].period_step, t_ns);
    if (latest.k == s->drd_a.k) return;
    s->drd_a = latest;
    s->read_ns = psa2_spi_pass(s->b, &s->past, &s->b->read, s->drd_a.t_ns);
}

/* From *t_ns, where a burst is due, to its end: it waits until the port is free and there is time for it, after the next
 * reading if there is not enough now. False: not there either. */
static bool pass_burst(struct scan *s, const struct burst *burst, int64_t *t_ns)
{
    for (unsigned readings = 0; readings < 2; readings++) {
        pass_readings(s, *t_ns);
        const int64_t free_ns = ns_later(*t_ns, s->read_ns);
        const int64_t ready_ns = ns_later(free_ns, s->past.ready_ns[PSA2_TEMP]);
        if (psa2_in_time(s->b, s->drd_a.t_ns, ready_ns + burst->span_ns)) {
            *t_ns = psa2_spi_pass(s->b, &s->past, &burst->x, free_ns);
            return true;
        }
        *t_ns = clk_on(s->drd_a, &s->b->adc[0].period_step).t_ns;
    }
    return false;
}

/* The next conversion begins; false: not before the present one is followed by a second word, or later than until_ns. */
static bool next_run(struct scan *s, int64_t until_ns)
{
    int64_t t_ns = s->run.ready_ns;
    if (!pass_burst(s, s->read, &t_ns) || !pass_burst(s, s->write, &t_ns)) return false;
    s->sync_ns = psa2_sync_t_ns(s->b, t_ns);
    if (s->sync_ns >= s->run.again_ns || s->sync_ns > until_ns) return false;
    s->run = ads1256_run_from(&s->b->tadc, s->sync_ns);
    return true;
}

/* What has been on the port is over by the reading before the next word: later conversions follow from where this one began. */
static bool follows_from_start(const struct scan *s)
{
    const int64_t byte_ns = clk_on(s->past.first, &s->b->spi.byte).t_ns;
    const int64_t over_ns = ns_later(byte_ns, ns_later(s->past.ready_ns[PSA2_ACCEL], s->past.ready_ns[PSA2_TEMP]));
    return over_ns + 2 * s->b->period_ns + 2 < s->run.ready_ns;
}

static uint32_t pass_known(struct scan *s, const struct psa2_cycle *c, int64_t last_ns)
{
    const struct ads1256 *a = &s->b->tadc;
    struct psa2_start at = {s->run.start_tau, 0};
    const uint32_t n = follows_from_start(s) ? psa2_cycle_pass(c, &at, last_ns) : 0;
    if (n == 0) return 0;
    s->run = ads1256_run_from(a, clk_edge_ns(&a->clkin, at.tau));
    s->sync_ns = at.sync_ns;
    return n;
}

static void note_run(const struct scan *s, struct psa2_cycle *c)
{
    if (follows_from_start(s)) psa2_cycle_note(c, (struct psa2_start){s->run.start_tau, s->sync_ns});
    else psa2_cycle_break(c);
}

/* To the last conversion that begins by last_ns: how many were passed. */
static uint32_t follow_runs(struct scan *s, struct psa2_cycle *c, int64_t last_ns)
{
    struct scan next = *s;
    uint32_t n = pass_known(s, c, last_ns);
    if (n > 0) return n;
    psa2_cycle_break(c);
    for (; next_run(&next, last_ns); n++, note_run(s, c)) *s = next;
    return n;
}

/* From the begin of a conversion on: each channel once, and to the frame that has the last code. */
static int64_t turn_ns(const struct psa2 *b)
{
    return (b->profile.temp_channels + TURN_MORE) * (ads1256_settle_ns(&b->tadc) + 4 * b->period_ns);
}

static bool may_skip(const struct psa2 *b, const struct scan *s)
{
    return psa2_fits(b, s->read->span_ns) && psa2_fits(b, s->write->span_ns) &&
           ads1256_may_skip(&b->tadc, 0.0, psa2_temp_v(b, BOARD_WARMEST_DEGC)); /* 0: no sensor there */
}

/* n conversions have passed, and another has begun. Before its word comes, more may be skipped. */
static void begin_run(struct psa2 *b, uint32_t n, const struct scan *s)
{
    struct psa2_temp *m = &b->temp;
    m->channel = (uint8_t)((m->channel + n) % b->profile.temp_channels);
    ads1256_skip(&b->tadc, n, psa2_temp_mux(m->channel), &s->run);
    psa2_temp_await(b, s->sync_ns);
    sched_at(b->base.sched, &b->lazy.again, s->sync_ns);
}

void psa2_temp_skip(struct psa2 *b, int64_t until_ns)
{
    const int64_t ahead_ns = b->base.sched->now_ns + AHEAD_NS, turn = turn_ns(b);
    const int64_t last_ns = ns_earlier(until_ns, ahead_ns) - turn;
    if (b->profile.temp_channels == 0 || last_ns <= b->tadc.ready_ev.due_ns) return;
    const struct burst write = burst_of(b, psa2_temp_write_mux(b, 0)), read = burst_of(b, psa2_temp_read_data(b));
    struct scan s = {b, &write, &read, b->spi.past, b->adc[0].ended, .run = ads1256_run_now(&b->tadc)};
    if (!may_skip(b, &s)) return;
    const uint32_t n = follow_runs(&s, &b->lazy.cycle, last_ns);
    if (n == 0) return;
    begin_run(b, n, &s);
    b->lazy.temp_ns = last_ns + turn;
}

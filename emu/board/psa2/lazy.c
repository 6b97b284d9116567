/* Frames that no one looks at.
 *
 * At the end of a frame it is known when someone may look next (sched_look_ns()). If that is far, the board falls asleep: its
 * accelerometer converters take no samples. Asleep, it skips all frames up to what it does next by itself, the temperature
 * scan or a time-out; the frames around that run as always, but for their codes. Before the look it wakes up: the filters are
 * filled with the samples that they would still hold, and two frames later everything is, to the bit, as if each had been
 * computed. What may not be put off is in psa2_why_eager(); time itself is never approximated. */
#include "board/psa2/internal.h"

#define WAKE_FRAMES  4  /* from the frame in which it wakes up to the look, and the one under way */
#define VALID_FRAMES 2  /* from there until the latest frame, registers and lines are true */
#define SLEEP_MIN    14 /* frames more than waking up costs; and from one question whether it may to the next */
#define MEMORY       66 /* frames that waking up costs where no sensor remembers */
#define BEFORE       4  /* and the two in which it reads what is older still, and the one under way */

/* Drifts are bounded for so long; then the board wakes up as if someone looked. */
#define BOUND_NS (INT64_C(86400) * NS_PER_S)

/* Data periods before those of the filters that have to be computed, so that the sensors know what they remember. */
static int64_t more_periods(const struct psa2 *b)
{
    return b->lazy.past_ns > 0 ? b->lazy.past_ns / b->period_ns + 1 : 0;
}

/* ---- whether ---- */

/* Three converters that do the same at the same instants. */
static bool in_step(const struct psa2 *b)
{
    const struct ads1282 *x = &b->adc[0];
    for (unsigned i = 0; i < 3; i++) {
        const struct ads1282 *a = &b->adc[i];
        if (!ads1282_rests(a, more_periods(b)) || a->due.due_ns != x->due.due_ns || a->period != x->period ||
            a->sync_count != x->sync_count)
            return false;
    }
    return true;
}

/* Nothing is under way but the wait for the next data-ready, and the frame that has just ended was one of many. */
static bool is_steady(const struct psa2 *b)
{
    const struct psa2_sample *s = &b->sample;
    const bool port_free = !psa2_spi_busy(b) && !b->pulse.busy && !b->request;
    const bool scan_waits = b->profile.temp_channels == 0 || (b->temp.stage == PSA2_SCAN_WAIT && !b->temp.hold);
    return b->mode == PSA2_RUN && port_free && scan_waits && !s->due && !s->reading && !s->overrun &&
           s->unsettled == 0 && !b->out.busy && b->timeout.queued && in_step(b);
}

/* From data-ready to the end of a frame at most, whatever edges of the serial clocks it meets; that has just ended at t_ns. */
static int64_t span_ns(const struct psa2 *b, int64_t t_ns)
{
    return t_ns - b->drd_a_ns + 2 * NS_PER_S / b->profile.sclk_hz + 4 * b->out.one.ns + 10;
}

static bool is_watched(const struct psa2 *b)
{
    return b->base.observed || b->base.trace.watched || b->base.trace.filter ||
           (b->host.frame && !(b->host.ignores && b->host.ignores(b->host.ctx)));
}

const char *psa2_why_eager(struct psa2 *b, int64_t t_ns)
{
    const int64_t every_ns = b->adc[0].step.ns;
    const char *why = NULL;
    if (b->mode != PSA2_RUN) return "the controller has not set it up yet";
    if (!b->base.io.accel_range) return "nothing is known of its sensors";
    if (!b->profile.gate_sclk) return "bursts for the temperature converter reach the others";
    if (b->base.faults) return "its controller has a fault";
    if (psa2_uref_moves(b)) return "its reference follows the supply";
    for (unsigned i = 0; !why && i < 3; i++) {
        const struct afe *afe = &b->base.afe[i];
        const struct looks_range out = b->base.io.accel_range(b->base.io.ctx, i, every_ns, t_ns + BOUND_NS, &why);
        if (!why) why = ads1282_why_eager(&b->adc[i], afe_range_v(afe, out, every_ns));
        if (!why && !afe_forgets(afe, every_ns)) why = "the filter of an analog channel remembers long, or has a fault";
    }
    return why;
}

/* ---- asleep ---- */

static void fall_asleep(struct psa2 *b, int64_t t_ns)
{
    for (unsigned i = 0; i < 3; i++) ads1282_put_off(&b->adc[i]);
    b->lazy.sleep = PSA2_ASLEEP;
    b->lazy.span_ns = span_ns(b, t_ns);
    b->lazy.temp_ns = 0;
    b->lazy.held_ns = t_ns + (MEMORY + more_periods(b) + BEFORE) * b->period_ns;
    psa2_cycle_begin(b);
    b->base.sched->asleep++;
}

static int64_t earlier_ns(int64_t at_ns, const struct sched_ev *e)
{
    return e->queued && e->due_ns < at_ns ? e->due_ns : at_ns;
}

/* What the board does next but for reading accelerometers. */
static int64_t next_own_ns(const struct psa2 *b)
{
    int64_t at_ns = earlier_ns(SCHED_NEVER, &b->temp.timeout);
    at_ns = earlier_ns(at_ns, &b->tadc.ready_ev);
    return earlier_ns(at_ns, &b->tadc.cal_ev);
}

/* The timeout of data-ready, where frames have been skipped beyond it: each time it would have found that a data-ready came
 * before, and waited on from that. drd_a: of the last frame before those that were skipped. */
static void pass_timeouts(struct psa2 *b, struct clk_pos drd_a)
{
    int64_t due_ns = b->timeout.due_ns;
    while (due_ns <= b->drd_a_ns) {
        drd_a = clk_on_to(drd_a, &b->adc[0].period_step, due_ns - 1);
        due_ns = psa2_timeout_ns(b, drd_a.t_ns);
    }
    if (due_ns != b->timeout.due_ns) sched_at(b->base.sched, &b->timeout, due_ns);
}

/* All frames that are over before an instant. */
static void skip_frames(struct psa2 *b, int64_t before_ns)
{
    const struct ads1282 *x = &b->adc[0];
    const int64_t n = (before_ns - b->lazy.span_ns - b->drd_a_ns) / (b->period_ns + 1);
    const struct clk_pos drd_a = x->ended;
    if (n <= 0) return;
    for (unsigned i = 0; i < 3; i++) ads1282_skip(&b->adc[i], (uint32_t)n);
    b->timeout_ns += x->ended.t_ns - b->drd_a_ns;
    b->drd_a_ns = x->ended.t_ns;
    b->seq += (uint32_t)n;
    b->counters.frames += (uint32_t)n;
    pass_timeouts(b, drd_a);
}

/* ---- awake again ---- */

/* Converter X falls first, and with it the board's temperature is read: its samples know that of the period before. */
static void fill_filters(struct psa2 *b)
{
    void *const ctx = b->base.io.ctx;
    int64_t from = 0, before_ns;
    for (unsigned i = 0; i < 3; i++) {
        from = ads1282_resume(&b->adc[i], more_periods(b), &before_ns);
        if (b->lazy.past_ns > 0) b->base.io.skip_accel(ctx, i, before_ns);
        afe_skip(&b->base.afe[i], before_ns);
    }
    for (int64_t p = from; p < b->adc[0].period; p++) {
        const int64_t end_ns = ads1282_end_ns(&b->adc[0], p);
        b->board_degc = b->base.io.temp_degc(ctx, 3, ads1282_end_ns(&b->adc[0], p - 1));
        ads1282_sample_until(&b->adc[0], end_ns);
        b->board_degc = b->base.io.temp_degc(ctx, 3, end_ns);
        ads1282_sample_until(&b->adc[1], end_ns);
        ads1282_sample_until(&b->adc[2], end_ns);
    }
}

static void wake_up(struct psa2 *b)
{
    fill_filters(b);
    b->lazy.sleep = PSA2_WAKING;
    b->lazy.left = VALID_FRAMES;
}

static void end_waking(struct psa2 *b)
{
    if (--b->lazy.left > 0) return;
    b->lazy.sleep = PSA2_AWAKE;
    b->base.sched->asleep--;
}

/* ---- */

/* Latest instant at which it may begin to wake up, for the next look. */
static int64_t wake_ns(const struct psa2 *b)
{
    const int64_t look_ns = sched_look_ns(b->base.sched);
    return ns_earlier(look_ns, b->lazy.bound_ns) - WAKE_FRAMES * b->period_ns;
}

/* Later, where temperature conversions have been skipped beyond, or where the filters would reach back to before it fell asleep,
 * when the world was not yet what it is: an unexpected look. */
static int64_t not_before_ns(const struct psa2 *b, int64_t t_ns)
{
    return ns_later(ns_later(t_ns, b->lazy.temp_ns), b->lazy.held_ns);
}

static void look_for_sleep(struct psa2 *b, int64_t t_ns)
{
    if (t_ns < b->lazy.ask_ns || is_watched(b) || !is_steady(b) || span_ns(b, t_ns) >= b->period_ns) return;
    const int64_t least_ns = t_ns + (MEMORY + more_periods(b) + SLEEP_MIN) * b->period_ns;
    b->lazy.bound_ns = t_ns + BOUND_NS;
    if (wake_ns(b) < least_ns) return;
    if (psa2_why_eager(b, t_ns)) b->lazy.ask_ns = least_ns;
    else fall_asleep(b, t_ns);
}

void psa2_lazy_sleep(struct psa2 *b)
{
    if (b->lazy.sleep != PSA2_ASLEEP || !is_steady(b)) return;
    const int64_t look_ns = wake_ns(b);
    psa2_temp_skip(b, look_ns);
    const int64_t own_ns = next_own_ns(b), until_ns = not_before_ns(b, look_ns);
    skip_frames(b, ns_earlier(own_ns, until_ns));
}

void psa2_lazy_frame(struct psa2 *b, int64_t t_ns)
{
    if (b->lazy.sleep == PSA2_WAKING) end_waking(b);
    else if (b->lazy.sleep == PSA2_AWAKE) look_for_sleep(b, t_ns);
    else if (t_ns >= not_before_ns(b, wake_ns(b))) wake_up(b);
    psa2_lazy_sleep(b);
}

/* What does not hold now may hold from here on. The filters have to forget what came before: a fault may be in them. */
void psa2_lazy_change(struct psa2 *b, int64_t t_ns)
{
    if (b->mode != PSA2_RUN || b->lazy.sleep == PSA2_ASLEEP || !psa2_why_eager(b, t_ns)) return;
    b->lazy.ask_ns = ns_later(b->lazy.ask_ns, t_ns + (MEMORY + more_periods(b) + BEFORE) * b->period_ns);
}

static void skip_again(void *ctx, int64_t t_ns)
{
    (void)t_ns;
    psa2_lazy_sleep(ctx);
}

void psa2_lazy_init(struct psa2 *b)
{
    const struct board_io *io = &b->base.io;
    for (unsigned i = 0; io->accel_past_ns && i < 3; i++)
        b->lazy.past_ns = ns_later(b->lazy.past_ns, io->accel_past_ns(io->ctx, i));
    sched_ev_inner(&b->lazy.again, skip_again, b);
}

void psa2_lazy_stop(struct psa2 *b)
{
    sched_cancel(b->base.sched, &b->lazy.again);
    b->base.sched->asleep -= b->lazy.sleep != PSA2_AWAKE;
    b->lazy = (struct psa2_lazy){.sleep = PSA2_AWAKE, .again = b->lazy.again, .past_ns = b->lazy.past_ns};
}

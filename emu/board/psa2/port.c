/* What requests, temperature scan and read-outs share of the serial ports: pulses on SYNC, the time left before the next DRD_A,
 * the timeout of data-ready. */
#include "board/psa2/internal.h"

#define SYNC_A_TCLK 4  /* E0: SYNC high; the part needs 2 */
#define SYNC_T_TAU  8  /* E0: SYNC/PDWN low; the part needs 4 */
#define MARGIN_TCLK 32 /* a read ends 4 tCLK, a command 24 tCLK before the next DRD_A */

/* ---- pulses ---- */

static void pulse_edge(struct psa2 *b, bool level, int64_t t_ns)
{
    if (b->pulse.group == PSA2_TEMP) {
        psa2_line(b, PSA2_LINE_SYNC_T, level, t_ns);
        ads1256_sync_pin(&b->tadc, level, t_ns);
        return;
    }
    trace_set(&b->base.trace, PSA2_LINE_SYNC_A, level, t_ns);
    for (unsigned i = 0; i < 3; i++) ads1282_sync_pin(&b->adc[i], level, t_ns);
}

static int64_t width_ns(const struct psa2 *b, bool temp)
{
    return temp ? psa2_tau_ns(b, SYNC_T_TAU) : psa2_tclk_ns(b, SYNC_A_TCLK);
}

/* SYNC_A idles low and works on its rise, SYNC_T idles high and works when it is high again. */
static void pulse_event(void *ctx, int64_t t_ns)
{
    struct psa2 *b = ctx;
    struct psa2_pulse *p = &b->pulse;
    const bool temp = p->group == PSA2_TEMP;
    p->active = !p->active;
    if (!p->skipped) pulse_edge(b, p->active != temp, t_ns);
    if (!p->skipped && p->active != temp) board_notify(&b->base, temp ? PSA2_EV_SYNC_T : PSA2_EV_SYNC_A, t_ns);
    if (p->active) {
        sched_at(b->base.sched, &p->ev, t_ns + width_ns(b, temp));
        return;
    }
    p->busy = false;
    if (!temp) b->sample.unsettled = 0;
    p->done(b, t_ns);
    b->idle(b, t_ns);
}

/* On a falling edge of fCLK: 122 ns from the rising one, whose keep-out is 30 ns (sources 1.4). */
static int64_t pulse_ns(const struct psa2 *b, int64_t t_ns)
{
    const struct clk half = {.hz = 2 * (int64_t)b->profile.fclk_hz, .div = 1};
    return clk_edge_ns(&half, clk_count_at(&half, t_ns + 1) | 1);
}

int64_t psa2_sync_t_ns(const struct psa2 *b, int64_t t_ns)
{
    return pulse_ns(b, t_ns) + width_ns(b, true);
}

void psa2_pulse(struct psa2 *b, enum psa2_group group, void (*done)(struct psa2 *b, int64_t t_ns), int64_t t_ns)
{
    b->pulse.busy = true;
    b->pulse.active = false;
    b->pulse.skipped = group == PSA2_TEMP && b->base.faults & PSA2_FAULT_SKIP_SYNC_T;
    b->pulse.group = group;
    b->pulse.done = done;
    sched_at(b->base.sched, &b->pulse.ev, pulse_ns(b, t_ns));
}

void psa2_pulse_stop(struct psa2 *b, int64_t t_ns)
{
    sched_cancel(b->base.sched, &b->pulse.ev);
    if (b->pulse.active) pulse_edge(b, b->pulse.group == PSA2_TEMP, t_ns);
    b->pulse.busy = b->pulse.active = false;
}

/* ---- time of data-ready ---- */

bool psa2_flowing(const struct psa2 *b, int64_t t_ns)
{
    return b->drd_a_seen && t_ns - b->drd_a_ns < 2 * b->period_ns;
}

bool psa2_in_time(const struct psa2 *b, int64_t drd_a_ns, int64_t end_ns)
{
    return end_ns + psa2_tclk_ns(b, MARGIN_TCLK) <= drd_a_ns + b->period_ns;
}

/* From a data-ready to the end of its read and of what follows at once. */
bool psa2_fits(const struct psa2 *b, int64_t span_ns)
{
    return psa2_in_time(b, 0, clk_span_ns(b->profile.sclk_hz, b->profile.read_bits + 2) + span_ns);
}

bool psa2_window(const struct psa2 *b, int64_t span_ns, int64_t t_ns)
{
    return !psa2_flowing(b, t_ns) || psa2_in_time(b, b->drd_a_ns, t_ns + span_ns) || !psa2_fits(b, span_ns);
}

int64_t psa2_timeout_ns(const struct psa2 *b, int64_t drd_a_ns)
{
    return drd_a_ns + PSA2_TIMEOUT_NS + ads1282_settle_ns(&b->adc[0]);
}

void psa2_arm_timeout(struct psa2 *b, int64_t t_ns)
{
    b->timeout_ns = psa2_timeout_ns(b, t_ns);
    if (!b->timeout.queued || b->timeout.due_ns > b->timeout_ns) sched_at(b->base.sched, &b->timeout, b->timeout_ns);
}

void psa2_port_init(struct psa2 *b)
{
    sched_ev_inner(&b->pulse.ev, pulse_event, b);
}

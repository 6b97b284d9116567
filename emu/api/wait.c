/* What lets time pass, to an instant, a level, an edge; and interrupts, which are served between two instants. */
#include "api/internal.h"

/* ---- interrupts ---- */

int api_edge_pin(const psabench_part *p, int pin, int edge, const char *function)
{
    const struct api_pin *row = api_pin_of(p, pin);
    if (!row) return api_no_pin(p, pin);
    if (p->kind->lag_ns)
        return api_fail(p->bench, PSABENCH_NOT_HERE, "%s: %s: expected a chip, got a board, whose edges come late",
                        p->name, function);
    if (row->dir == API_IN || edge < PSABENCH_FALLING || edge > PSABENCH_EITHER)
        return api_fail(p->bench, PSABENCH_BAD_ARGUMENT,
                        "%s: %s: expected an output and a falling, rising or either edge (0, 1, 2), got %s and %d",
                        p->name, row->name, row->dir == API_IN ? "an input" : "an output", edge);
    return PSABENCH_OK;
}

int psabench_on_interrupt(psabench_part *p, int pin, int edge, psabench_interrupt_fn *fn, void *ctx)
{
    const int bad = api_edge_pin(p, pin, edge, "psabench_on_interrupt()");
    if (bad) return bad;
    const uint32_t bit = UINT32_C(1) << pin;
    api_observe(p, (unsigned)pin);
    p->interrupt[pin] = (struct api_interrupt){fn, ctx, (enum psabench_edge)edge};
    p->armed = fn ? p->armed | bit : p->armed & ~bit;
    p->pending &= ~bit;
    return PSABENCH_OK;
}

int psabench_mask(psabench *b, int masked)
{
    if (!b) return PSABENCH_BAD_ARGUMENT;
    if (masked != 0 && masked != 1)
        return api_fail(b, PSABENCH_BAD_ARGUMENT, "psabench_mask(): expected 0 or 1, got %d", masked);
    const int was = b->masked;
    b->masked = masked;
    return was;
}

bool api_pending(const psabench *b)
{
    for (const struct psabench_part *p = b->parts; p; p = p->next)
        if (p->pending) return true;
    return false;
}

static void serve_pin(psabench_part *p, unsigned pin)
{
    psabench *b = p->bench;
    p->pending &= ~(UINT32_C(1) << pin);
    b->serving = true;
    p->interrupt[pin].fn(p->interrupt[pin].ctx, p, (int)pin);
    b->serving = false;
    b->served++;
}

/* Each pin once: the program goes on between two handlers of a pin, even if a handler takes longer than its period. */
void api_serve(psabench *b)
{
    if (b->serving || b->inside) return;
    for (struct psabench_part *p = b->parts; p; p = p->next)
        for (unsigned i = 0; p->pending && i < p->kind->pin_count; i++)
            if (p->pending >> i & 1 && !b->masked) serve_pin(p, i);
}

/* ---- waiting ---- */

/* What a call waits for. p NULL: only for the end of its time. */
struct wait {
    psabench_part *p;
    unsigned pin;
    bool (*met)(const struct wait *w);
    int level, edge;
    uint32_t from[2]; /* edges before */
};

static bool is_met(const struct wait *w)
{
    return w->met && w->met(w);
}

/* The next instant at which what is waited for may be there. */
static int64_t look_ns(const struct wait *w, int64_t end_ns)
{
    const int64_t own_ns = w->p && w->p->kind->next_ns ? w->p->kind->next_ns(w->p) : INT64_MAX;
    return ns_earlier(own_ns, end_ns);
}

/* Lets time pass until what w waits for, at most to end_ns; interrupts are served between two instants and may take time
 * beyond it. OK, TIMEOUT or DEADLINE. */
static int wait_until(psabench *b, const struct wait *w, int64_t end_ns)
{
    api_serve(b);
    while (!is_met(w)) {
        if (!api_has_time(b, end_ns)) return PSABENCH_TIMEOUT;
        const int late = api_late(b);
        if (late) return late;
        b->inside++;
        api_step(b, ns_earlier(look_ns(w, end_ns), b->deadline.t_ns));
        b->inside--;
        const bool met = is_met(w); /* before a handler changes it */
        api_serve(b);
        if (met) return PSABENCH_OK;
    }
    return PSABENCH_OK;
}

int psabench_run_until(psabench *b, int64_t t_ns)
{
    static const struct wait nothing = {.p = NULL};
    if (!b) return PSABENCH_BAD_ARGUMENT;
    const int may = api_may_move(b, "psabench_run_until()");
    if (may) return may;
    if (t_ns < b->sched.now_ns || t_ns > API_TIME_MAX_NS)
        return api_fail(b, PSABENCH_BAD_ARGUMENT, "time: expected %lld ns (now) to %lld ns, got %lld ns",
                        (long long)b->sched.now_ns, (long long)API_TIME_MAX_NS, (long long)t_ns);
    const int end = wait_until(b, &nothing, t_ns);
    return end == PSABENCH_TIMEOUT ? PSABENCH_OK : end;
}

int psabench_run_for(psabench *b, int64_t dt_ns)
{
    if (!b) return PSABENCH_BAD_ARGUMENT;
    if (dt_ns < 0 || dt_ns > API_TIME_MAX_NS)
        return api_fail(b, PSABENCH_BAD_ARGUMENT, "time span: expected 0 to %lld ns, got %lld ns",
                        (long long)API_TIME_MAX_NS, (long long)dt_ns);
    return psabench_run_until(b, b->sched.now_ns + dt_ns);
}

static bool has_level(const struct wait *w)
{
    return api_level(w->p, w->pin) == w->level;
}

/* Where what a program waits for is bad, or there is no such time. */
static int check_wait(psabench *b, int64_t timeout_ns, const char *function)
{
    const int may = api_may_move(b, function);
    if (may) return may;
    if (timeout_ns >= 0 && timeout_ns <= API_TIME_MAX_NS - b->sched.now_ns) return PSABENCH_OK;
    return api_fail(b, PSABENCH_BAD_ARGUMENT, "%s: expected a span >= 0 and at most %lld ns, got %lld ns", function,
                    (long long)(API_TIME_MAX_NS - b->sched.now_ns), (long long)timeout_ns);
}

int psabench_run_until_level(psabench_part *p, int pin, int level, int64_t timeout_ns)
{
    const struct api_pin *row = api_pin_of(p, pin);
    if (!row) return api_no_pin(p, pin);
    psabench *b = p->bench;
    int bad = check_wait(b, timeout_ns, "psabench_run_until_level()");
    if (!bad) bad = api_not_late(p, row);
    if (bad) return bad;
    if (level != 0 && level != 1)
        return api_fail(b, PSABENCH_BAD_ARGUMENT, "%s: %s: expected a level of 0 or 1, got %d", p->name, row->name,
                        level);
    const struct wait w = {.p = p, .pin = (unsigned)pin, .met = has_level, .level = level};
    const int end = wait_until(b, &w, b->sched.now_ns + timeout_ns);
    if (end != PSABENCH_TIMEOUT) return end;
    return api_fail(b, PSABENCH_TIMEOUT, "%s: %s: expected %d within %lld ns, got no change", p->name, row->name, level,
                    (long long)timeout_ns);
}

static bool had_edge(const struct wait *w)
{
    const uint32_t *now = w->p->edges[w->pin];
    return (now[0] != w->from[0] && api_is_edge((enum psabench_edge)w->edge, false)) ||
           (now[1] != w->from[1] && api_is_edge((enum psabench_edge)w->edge, true));
}

int psabench_run_until_edge(psabench_part *p, int pin, int edge, int64_t timeout_ns)
{
    int bad = api_edge_pin(p, pin, edge, "psabench_run_until_edge()");
    if (!bad) bad = check_wait(p->bench, timeout_ns, "psabench_run_until_edge()");
    if (bad) return bad;
    api_observe(p, (unsigned)pin);
    p->counted |= UINT32_C(1) << pin; /* from now on */
    const uint32_t *edges = p->edges[pin];
    const struct wait w = {.p = p, .pin = (unsigned)pin, .met = had_edge, .edge = edge, .from = {edges[0], edges[1]}};
    const int end = wait_until(p->bench, &w, p->bench->sched.now_ns + timeout_ns);
    if (end != PSABENCH_TIMEOUT) return end;
    return api_fail(p->bench, PSABENCH_TIMEOUT, "%s: %s: expected an edge within %lld ns, got none", p->name,
                    p->kind->pins[pin].name, (long long)timeout_ns);
}

static bool is_interrupted(const struct wait *w)
{
    const psabench *b = w->p->bench;
    return b->served != w->from[0] || api_pending(b);
}

int psabench_run_until_interrupt(psabench *b, int64_t timeout_ns)
{
    if (!b) return PSABENCH_BAD_ARGUMENT;
    const int bad = check_wait(b, timeout_ns, "psabench_run_until_interrupt()");
    if (bad) return bad;
    const struct wait w = {.p = b->parts, .met = b->parts ? is_interrupted : NULL, .from = {b->served}};
    const int end = wait_until(b, &w, b->sched.now_ns + timeout_ns);
    if (end != PSABENCH_TIMEOUT) return end;
    return api_fail(b, PSABENCH_TIMEOUT, "bench: expected an interrupt within %lld ns, got none",
                    (long long)timeout_ns);
}

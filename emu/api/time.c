/* Simulated time of a bench: instant by instant, with what waits for an instant and what ends a program that waits in vain. */
#include "api/internal.h"

#include <stdio.h>

int64_t psabench_now_ns(const psabench *b)
{
    return b ? b->sched.now_ns : PSABENCH_BAD_ARGUMENT;
}

int64_t psabench_next_ns(const psabench *b)
{
    return b ? sched_next_ns(&b->sched) : INT64_MAX;
}

int api_may_move(psabench *b, const char *function)
{
    if (!b->inside) return PSABENCH_OK;
    return api_fail(b, PSABENCH_BAD_ARGUMENT, "%s: expected a call outside callbacks, where time may advance",
                    function);
}

/* ---- reports ---- */

static void notify_part(struct psabench_part *p)
{
    const int64_t t_ns = p->bench->sched.now_ns;
    const uint32_t observed = api_observed(p);
    for (unsigned i = 0; observed && i < p->kind->pin_count; i++) {
        const struct api_pin *pin = &p->kind->pins[i];
        if (!(observed >> i & 1) || pin->dir == API_IN || !pin->get || p->kind->lag_ns) continue;
        const bool level = pin->get(p, pin->arg);
        if (level != (p->level >> i & 1)) api_edge(p, i, level, t_ns);
    }
    if (p->kind->follow) p->kind->follow(p, t_ns);
}

void api_notify(psabench *b)
{
    for (struct psabench_part *p = b->parts; p; p = p->next) notify_part(p);
    if (b->vcd) api_vcd_follow(b);
}

static bool is_edge(enum psabench_edge edge, bool level)
{
    return edge == PSABENCH_EITHER || (edge == PSABENCH_RISING) == level;
}

void api_edge(struct psabench_part *p, unsigned pin, bool level, int64_t t_ns)
{
    const uint32_t bit = UINT32_C(1) << pin;
    p->level = level ? p->level | bit : p->level & ~bit;
    p->edges[pin][level]++;
    if (p->armed & bit && is_edge(p->interrupt[pin].edge, level)) p->pending |= bit;
    if (p->recorded & bit) api_vcd_put(p, pin, level, t_ns);
    const struct api_watch *w = &p->watch[pin];
    if (w->fn && p->kind->pins[pin].dir != API_IN) w->fn(w->ctx, p, (int)pin, level, t_ns);
}

/* A board that reports edges late is asked for them often enough, whatever else happens. */
static int64_t next_notify_ns(const psabench *b)
{
    for (const struct psabench_part *p = b->parts; p; p = p->next)
        if (p->kind->lag_ns && (p->watched | p->recorded)) return b->sched.now_ns + API_STEP_NS;
    return INT64_MAX;
}

/* ---- moving ---- */

static bool has_time(const psabench *b, int64_t t_ns)
{
    return b->sched.now_ns < t_ns || sched_next_ns(&b->sched) <= t_ns;
}

/* To the next instant at which something happens, at most to t_ns: so a change is reported when it happens. */
static void step_time(psabench *b, int64_t t_ns)
{
    const int64_t next_ns = ns_earlier(sched_next_ns(&b->sched), next_notify_ns(b));
    sched_run_until(&b->sched, ns_earlier(next_ns, t_ns));
    api_notify(b);
}

void api_move(psabench *b, int64_t t_ns)
{
    while (has_time(b, t_ns)) step_time(b, t_ns);
}

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
        if (!has_time(b, end_ns)) return PSABENCH_TIMEOUT;
        const int late = api_late(b);
        if (late) return late;
        b->inside++;
        step_time(b, ns_earlier(look_ns(w, end_ns), b->deadline.t_ns));
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

/* ---- waiting for a pin ---- */

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
    return (now[0] != w->from[0] && is_edge((enum psabench_edge)w->edge, false)) ||
           (now[1] != w->from[1] && is_edge((enum psabench_edge)w->edge, true));
}

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

/* ---- the end of a program's time ---- */

enum { POLLS_MAX = 1000000 };

int psabench_deadline(psabench *b, int64_t t_ns, psabench_deadline_fn *fn, void *ctx)
{
    if (!b) return PSABENCH_BAD_ARGUMENT;
    if (t_ns < b->sched.now_ns)
        return api_fail(b, PSABENCH_BAD_ARGUMENT, "deadline: expected %lld ns (now) or later, got %lld ns",
                        (long long)b->sched.now_ns, (long long)t_ns);
    b->deadline = (struct api_deadline){t_ns, fn, ctx};
    b->polls = 0;
    return PSABENCH_OK;
}

/* " DRDY=1 DOUT=0" of all parts: what the program waits for is among them. */
static void list_levels(const psabench *b, char list[API_WHY])
{
    size_t len = 0;
    list[0] = '\0';
    for (const struct psabench_part *p = b->parts; p; p = p->next)
        for (unsigned i = 0; i < p->kind->pin_count && len < API_WHY; i++)
            if (p->kind->pins[i].dir == API_IN || p->kind->pins[i].get)
                len += (size_t)snprintf(list + len, API_WHY - len, " %s.%s=%d", p->name, p->kind->pins[i].name,
                                        api_level(p, i));
}

/* Its function may leave by longjmp() or return; either way the bench is as between two calls. */
static int fire_deadline(psabench *b, const char *got)
{
    char levels[API_WHY];
    const bool serving = b->serving;
    list_levels(b, levels);
    (void)api_fail(b, PSABENCH_DEADLINE, "deadline: expected the program to end by %lld ns, got %s at %lld ns;%s%s",
                   (long long)b->deadline.t_ns, got, (long long)b->sched.now_ns,
                   sched_next_ns(&b->sched) == INT64_MAX ? " nothing will happen by itself;" : "", levels);
    b->serving = false;
    if (b->deadline.fn) b->deadline.fn(b->deadline.ctx, b);
    b->serving = serving;
    return PSABENCH_DEADLINE;
}

int api_late(psabench *b)
{
    return b->sched.now_ns < b->deadline.t_ns ? PSABENCH_OK : fire_deadline(b, "a call that takes time");
}

int api_poll(psabench *b)
{
    if (b->inside || b->deadline.t_ns == INT64_MAX) return PSABENCH_OK;
    if (b->poll_ns != b->sched.now_ns) b->polls = 0;
    b->poll_ns = b->sched.now_ns;
    if (b->polls < POLLS_MAX) b->polls++;
    return b->polls < POLLS_MAX ? PSABENCH_OK : fire_deadline(b, "1000000 looks at pins without time passing");
}

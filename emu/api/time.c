/* Simulated time of a bench: instant by instant, what is reported then, and the end of the program's time. */
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

void api_edge(struct psabench_part *p, unsigned pin, bool level, int64_t t_ns)
{
    const uint32_t bit = UINT32_C(1) << pin;
    p->level = level ? p->level | bit : p->level & ~bit;
    p->edges[pin][level]++;
    if (p->armed & bit && api_is_edge(p->interrupt[pin].edge, level)) p->pending |= bit;
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

bool api_has_time(const psabench *b, int64_t t_ns)
{
    return b->sched.now_ns < t_ns || sched_next_ns(&b->sched) <= t_ns;
}

/* To the next instant at which something happens, at most to t_ns: so a change is reported when it happens. */
void api_step(psabench *b, int64_t t_ns)
{
    const int64_t next_ns = ns_earlier(sched_next_ns(&b->sched), next_notify_ns(b));
    sched_run_until(&b->sched, ns_earlier(next_ns, t_ns));
    api_notify(b);
}

void api_move(psabench *b, int64_t t_ns)
{
    while (api_has_time(b, t_ns)) api_step(b, t_ns);
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

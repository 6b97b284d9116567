#include "api/internal.h"

#include "base/text.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef PSABENCH_VERSION
#error "the Makefile takes PSABENCH_VERSION from pyproject.toml"
#endif

int psabench_abi(void)
{
    return PSABENCH_ABI;
}

const char *psabench_version(void)
{
    return TEXT_OF(PSABENCH_VERSION);
}

int api_fail(psabench *b, int code, const char *format, ...)
{
    if (!b) return code;
    va_list args;
    va_start(args, format);
    (void)vsnprintf(b->error, sizeof b->error, format, args);
    va_end(args);
    text_one_line(b->error);
    return code;
}

psabench *psabench_new(uint64_t seed)
{
    psabench *b = calloc(1, sizeof *b);
    if (!b) return NULL;
    sched_init(&b->sched);
    b->seed = seed;
    return b;
}

void psabench_free(psabench *b)
{
    if (!b || b->inside) return;
    b->inside++; /* the last edges may still reach watchers */
    (void)api_vcd_end(b);
    while (b->parts) {
        struct psabench_part *p = b->parts;
        b->parts = p->next;
        free(p->queue.edge);
        free(p);
    }
    free(b);
}

const char *psabench_error_text(const psabench *b)
{
    return b ? b->error : "no bench: the pointer is NULL";
}

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

static void notify_part(struct psabench_part *p)
{
    const int64_t t_ns = p->bench->sched.now_ns;
    const uint32_t observed = p->watched | p->recorded;
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

/* Instant by instant, so that a change is reported when it happens. */
void api_move(psabench *b, int64_t t_ns)
{
    while (b->sched.now_ns < t_ns || sched_next_ns(&b->sched) <= t_ns) {
        const int64_t event_ns = sched_next_ns(&b->sched);
        const int64_t again_ns = next_notify_ns(b);
        const int64_t next_ns = event_ns < again_ns ? event_ns : again_ns;
        sched_run_until(&b->sched, next_ns < t_ns ? next_ns : t_ns);
        api_notify(b);
    }
}

int psabench_run_until(psabench *b, int64_t t_ns)
{
    if (!b) return PSABENCH_BAD_ARGUMENT;
    const int may = api_may_move(b, "psabench_run_until()");
    if (may) return may;
    if (t_ns < b->sched.now_ns || t_ns > API_TIME_MAX_NS)
        return api_fail(b, PSABENCH_BAD_ARGUMENT, "time: expected %lld ns (now) to %lld ns, got %lld ns",
                        (long long)b->sched.now_ns, (long long)API_TIME_MAX_NS, (long long)t_ns);
    b->inside++;
    api_move(b, t_ns);
    b->inside--;
    return PSABENCH_OK;
}

int psabench_run_for(psabench *b, int64_t dt_ns)
{
    if (!b) return PSABENCH_BAD_ARGUMENT;
    if (dt_ns < 0 || dt_ns > API_TIME_MAX_NS)
        return api_fail(b, PSABENCH_BAD_ARGUMENT, "time span: expected 0 to %lld ns, got %lld ns",
                        (long long)API_TIME_MAX_NS, (long long)dt_ns);
    return psabench_run_until(b, b->sched.now_ns + dt_ns);
}

/* ---- recording ---- */

int psabench_vcd_close(psabench *b)
{
    if (!b) return PSABENCH_BAD_ARGUMENT;
    const int may = api_may_move(b, "psabench_vcd_close()");
    if (may) return may;
    b->inside++;
    const int error = api_vcd_end(b);
    b->inside--;
    return error ? api_fail(b, PSABENCH_SYSTEM, "recording: incomplete: %s", strerror(error)) : PSABENCH_OK;
}

int psabench_vcd(psabench *b, const char *path)
{
    const int closed = psabench_vcd_close(b);
    if (closed) return closed;
    if (!path) return api_fail(b, PSABENCH_BAD_ARGUMENT, "psabench_vcd(): expected a path, got NULL");
    const int error = api_vcd_begin(b, path);
    return error ? api_fail(b, PSABENCH_SYSTEM, "%.200s: %s", path, strerror(error)) : PSABENCH_OK;
}

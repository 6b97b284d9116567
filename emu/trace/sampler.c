#include "trace/sampler.h"

#include <string.h>

static size_t min_size(size_t a, size_t b)
{
    return a < b ? a : b;
}

static void append_run(struct sampler *s, uint8_t byte, size_t n)
{
    while (n > 0) {
        const size_t at = (s->head + s->len) % SAMPLER_RING;
        const size_t run = min_size(n, SAMPLER_RING - at);
        memset(s->ring + at, byte, run);
        s->len += run;
        n -= run;
    }
}

/* Makes n samples of the present levels, as far as the ring has room. */
static void emit_samples(struct sampler *s, int64_t n)
{
    const int64_t room = (int64_t)(SAMPLER_RING - s->len);
    const int64_t kept = n < room ? n : room;
    if (kept > 0) {
        append_run(s, s->level | s->gap, 1);
        append_run(s, s->level, (size_t)kept - 1);
        s->gap = 0;
    }
    if (kept < n) s->gap = SAMPLER_GAP;
    s->dropped += (uint64_t)(n - kept);
    s->next += n;
}

static void sample_until(struct sampler *s, int64_t t_ns)
{
    if (t_ns < s->clock.t0_ns) return;
    const int64_t count = clk_count_at(&s->clock, t_ns);
    if (count > s->next) emit_samples(s, count - s->next);
}

static void on_steps(void *ctx, const struct trace_step *step, unsigned n)
{
    struct sampler *s = ctx;
    for (const struct trace_step *const end = step + n; step < end; step++) {
        if (!(step->lines & s->sink.mask)) continue;
        sample_until(s, step->t_ns); /* a sample at t_ns itself sees the new level */
        for (unsigned i = 0; i < s->lines; i++)
            if (step->lines >> s->sig[i] & 1)
                s->level = (uint8_t)((s->level & ~(1u << i)) | (step->level >> s->sig[i] & 1) << i);
    }
}

static void on_advance(void *ctx, int64_t t_ns)
{
    sample_until(ctx, t_ns);
}

bool sampler_start(struct sampler *s, struct trace *t, const char *const *names, const struct clk *clock)
{
    const struct clk own = *clock; /* may be that of the run before, in s itself */
    memset(s, 0, offsetof(struct sampler, ring));
    s->trace = t;
    s->clock = own;
    uint64_t mask = 0;
    for (unsigned i = 0; names[i]; i++) {
        const int sig = trace_find(t, names[i]);
        if (sig < 0 || i == SAMPLER_LINES) return false;
        s->lines = i + 1;
        s->sig[i] = (uint8_t)sig;
        mask |= TRACE_BIT(sig);
    }
    s->next = clk_count_at(&own, t->done_ns);
    s->sink = (struct trace_sink){.mask = mask, .steps = on_steps, .advance = on_advance, .ctx = s};
    trace_attach(t, &s->sink);
    return true;
}

void sampler_stop(struct sampler *s)
{
    trace_detach(s->trace, &s->sink);
}

size_t sampler_take(struct sampler *s, uint8_t *buf, size_t cap)
{
    const size_t n = min_size(cap, s->len);
    const size_t run = min_size(n, SAMPLER_RING - s->head);
    memcpy(buf, s->ring + s->head, run);
    memcpy(buf + run, s->ring, n - run);
    s->head = (s->head + n) % SAMPLER_RING;
    s->len -= n;
    return n;
}

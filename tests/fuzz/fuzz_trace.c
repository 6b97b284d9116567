/* Reports of lines within the window, two sinks that come and go, a sampler: every sink hears real changes in order, and a
 * sink that was there all the time heard exactly what was reported. */
#include "fuzz.h"

#include "trace/sampler.h"
#include "trace/trace.h"

#include <string.h>

enum { LINES = 5, REPORTS_MAX = 2000 };

struct ear {
    struct trace_sink sink;
    bool attached, all; /* all: from the beginning, every line */
    uint32_t level, known;
    int64_t t_ns, told_ns;
    uint32_t changes[LINES];
};

struct world {
    struct trace t;
    struct ear ear[2];
    struct sampler sampler;
    uint8_t ring[SAMPLER_RING];
    bool sampling;
    int64_t now_ns;
};

static void hear(void *ctx, unsigned sig, bool level, int64_t t_ns)
{
    struct ear *e = ctx;
    const uint32_t bit = UINT32_C(1) << sig;
    assert(sig < LINES && (e->sink.mask & bit) && t_ns >= e->t_ns);
    assert(!(e->known & bit) || level != ((e->level & bit) != 0));
    e->t_ns = t_ns;
    e->known |= bit;
    e->level = level ? e->level | bit : e->level & ~bit;
    e->changes[sig]++;
}

static void steps(void *ctx, const struct trace_step *s, unsigned n)
{
    struct ear *e = ctx;
    for (unsigned i = 0; i < n; i++) assert(i == 0 || s[i].t_ns >= s[i - 1].t_ns);
    trace_each(s, n, e->sink.mask, hear, e);
}

static void advance(void *ctx, int64_t t_ns)
{
    struct ear *e = ctx;
    assert(t_ns >= e->t_ns && t_ns >= e->told_ns);
    e->told_ns = t_ns;
}

static void attach(struct world *w, struct ear *e, uint32_t mask)
{
    e->known = 0;
    e->sink = (struct trace_sink){.mask = mask, .steps = steps, .advance = advance, .ctx = e};
    trace_attach(&w->t, &e->sink);
    assert(e->known == (mask & ((1u << LINES) - 1)));
    e->attached = true;
}

static void listeners(struct world *w, struct script *s)
{
    static const char *const names[] = {"Int", "Data", "CLK", NULL};
    static const struct clk clock = {.hz = SAMPLER_HZ, .div = 1};
    const uint8_t b = script_byte(s);
    if (b & 1) {
        trace_detach(&w->t, &w->ear[1].sink);
        if (b & 2) attach(w, &w->ear[1], b >> 2);
    } else if (w->sampling) {
        sampler_stop(&w->sampler);
        w->sampling = false;
    } else {
        const struct sampler_cfg cfg = sampler_line_port(&clock, names, w->ring);
        w->sampling = sampler_start(&w->sampler, &w->t, &cfg);
        assert(w->sampling);
    }
}

/* A byte's or a word's edges at once, in order of time. */
static void report_steps(struct world *w, struct script *s)
{
    struct trace_step step[8];
    const unsigned n = script_byte(s) % 8;
    int64_t t_ns = w->now_ns;
    for (unsigned i = 0; i < n; i++) {
        const uint8_t b = script_byte(s);
        t_ns += b >> 5 << 6;
        step[i] = (struct trace_step){t_ns, b & 1 ? b >> 1 & 3 : 1u << (b >> 1 & 3), b >> 2};
    }
    trace_steps(&w->t, step, n);
}

static void op(struct world *w, struct script *s)
{
    uint8_t buf[256];
    const uint8_t b = script_byte(s);
    if (b < 96) trace_set(&w->t, b % LINES, b >> 6 & 1, w->now_ns + (int64_t)(b >> 3 & 7) * 10000);
    else if (b < 160) report_steps(w, s);
    else if (b < 200) w->now_ns += script_span_ns(s) % 100000;
    else if (b < 225) trace_advance(&w->t, w->now_ns - b % 2 * TRACE_LAG_NS);
    else if (b < 240) listeners(w, s);
    else
        for (size_t i = 0, n = sampler_take(&w->sampler, buf, sizeof buf); i < n; i++)
            assert((buf[i] & ~(7u | SAMPLER_GAP)) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const names[LINES] = {"Int", "Data", "CLK", "A", "B"};
    static struct world w;
    struct script s = script_of(data, size);
    memset(&w.t, 0, sizeof w.t);
    memset(w.ear, 0, sizeof w.ear);
    w.sampler.head = w.sampler.len = 0;
    w.sampling = false;
    w.now_ns = 0;
    for (unsigned i = 0; i < LINES; i++) trace_add(&w.t, names[i], i & 1);
    attach(&w, &w.ear[0], UINT32_MAX);
    for (unsigned i = 0; i < REPORTS_MAX && script_more(&s); i++) op(&w, &s);
    trace_advance(&w.t, INT64_MAX / 2);
    assert(w.ear[0].level == w.t.level && w.t.dropped == 0);
    if (w.sampling) sampler_stop(&w.sampler);
    return 0;
}

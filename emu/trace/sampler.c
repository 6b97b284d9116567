#include "trace/sampler.h"

#include <string.h>

static size_t min_size(size_t a, size_t b)
{
    return a < b ? a : b;
}

static int64_t min_count(int64_t a, int64_t b)
{
    return a < b ? a : b;
}

static void fill_samples(uint8_t *to, uint16_t level, unsigned bytes, size_t n)
{
    if (bytes == 1) {
        memset(to, level, n);
        return;
    }
    for (size_t i = 0; i < n; i += 2) {
        to[i] = (uint8_t)level;
        to[i + 1] = (uint8_t)(level >> 8);
    }
}

/* n bytes of one level. */
static void append_run(struct sampler *s, uint16_t level, size_t n)
{
    size_t at = s->head + s->len;
    if (at >= s->cap) at -= s->cap;
    s->len += n;
    for (size_t run; n > 0; n -= run, at = 0) {
        run = min_size(n, s->cap - at);
        fill_samples(s->ring + at, level, s->bytes, run);
    }
}

static void keep_samples(struct sampler *s, int64_t n)
{
    if (n == 0) return;
    if (s->gap) {
        append_run(s, s->level | s->gap, s->bytes);
        append_run(s, s->level, (size_t)(n - 1) * s->bytes);
    } else {
        append_run(s, s->level, (size_t)n * s->bytes);
    }
    s->gap = 0;
    s->hole = false;
    s->kept += (uint64_t)n;
}

/* The rest of the block that the last of them is in is lost, too. */
static void lose_samples(struct sampler *s, int64_t n)
{
    if (n == 0) return;
    const uint32_t begun = (uint32_t)(n % s->block);
    s->skip = begun ? s->block - begun : 0;
    s->dropped += (uint64_t)n;
    s->holes += !s->hole;
    s->hole = true;
    s->gap = s->mark;
}

/* Makes n samples of the present levels, as far as the ring has room. */
static void emit_samples(struct sampler *s, int64_t n)
{
    s->next += n;
    const int64_t skipped = min_count(n, s->skip);
    s->skip -= (uint32_t)skipped;
    s->dropped += (uint64_t)skipped;
    n -= skipped;
    const int64_t kept = min_count(n, (int64_t)((s->cap - s->len) / s->bytes));
    keep_samples(s, kept);
    lose_samples(s, n - kept);
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
        uint64_t lines = step->lines & s->sink.mask;
        if (!lines) continue;
        sample_until(s, step->t_ns); /* a sample at t_ns itself sees the new level */
        for (; lines; lines &= lines - 1) {
            const unsigned sig = (unsigned)__builtin_ctzll(lines);
            const uint16_t bit = s->bit[sig];
            s->level = (uint16_t)(step->level >> sig & 1 ? s->level | bit : s->level & ~bit);
        }
    }
}

static void on_advance(void *ctx, int64_t t_ns)
{
    sample_until(ctx, t_ns);
}

unsigned sampler_lines_max(const struct sampler_cfg *cfg)
{
    return cfg->gap ? 7 : 8 * cfg->bytes;
}

bool sampler_start(struct sampler *s, struct trace *t, const struct sampler_cfg *cfg)
{
    struct sampler n = {.trace = t,
                        .clock = cfg->clock,
                        .bytes = cfg->bytes,
                        .mark = cfg->gap,
                        .block = cfg->block,
                        .ring = cfg->ring,
                        .cap = cfg->ring_bytes};
    uint64_t mask = 0;
    for (unsigned i = 0; cfg->names[i]; i++) {
        const int sig = trace_find(t, cfg->names[i]);
        if (sig < 0 || i == sampler_lines_max(cfg)) return false;
        n.bit[sig] |= (uint16_t)(1u << i);
        mask |= TRACE_BIT(sig);
    }
    trace_wake(t);
    n.next = clk_count_at(&n.clock, t->done_ns);
    *s = n;
    s->sink = (struct trace_sink){.mask = mask, .steps = on_steps, .advance = on_advance, .ctx = s};
    trace_attach(t, &s->sink);
    return true;
}

struct sampler_cfg sampler_line_port(const struct clk *clock, const char *const *names, uint8_t *ring)
{
    return (struct sampler_cfg){.clock = *clock,
                                .names = names,
                                .bytes = 1,
                                .gap = SAMPLER_GAP,
                                .block = 1,
                                .ring = ring,
                                .ring_bytes = SAMPLER_RING};
}

void sampler_stop(struct sampler *s)
{
    if (s->trace) trace_detach(s->trace, &s->sink);
}

size_t sampler_take(struct sampler *s, uint8_t *buf, size_t cap)
{
    if (s->len == 0) return 0;
    const size_t n = min_size(cap - cap % s->bytes, s->len);
    const size_t run = min_size(n, s->cap - s->head);
    memcpy(buf, s->ring + s->head, run);
    memcpy(buf + run, s->ring, n - run);
    s->head += n;
    if (s->head >= s->cap) s->head -= s->cap;
    s->len -= n;
    return n;
}

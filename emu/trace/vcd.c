#include "trace/vcd.h"

#include <errno.h>
#include <string.h>

#define STEP_MAX_LEN (sizeof((struct vcd *)0)->prefix + 5u + 3u * TRACE_SIGNALS_MAX) /* time; level, code, newline */
#define CHUNK        10000 /* units: the digits above them are formatted once for all times of a chunk */

static char code_of(unsigned sig)
{
    return (char)('!' + sig); /* TRACE_SIGNALS_MAX codes of the 94 printable ones */
}

static void write_out(struct vcd *v)
{
    errno = 0;
    if (!v->error && v->max_bytes && v->bytes + v->len > v->max_bytes) {
        v->limited = true;
        vcd_fail(v, EFBIG);
    }
    if (!v->error && v->len > 0 && fwrite(v->buf, 1, v->len, v->out) != v->len) v->error = errno ? errno : EIO;
    v->bytes += v->error ? 0 : v->len;
    v->len = 0;
}

static void put_text(struct vcd *v, const char *text)
{
    for (; *text; text++) {
        if (v->len == VCD_BUF) write_out(v);
        v->buf[v->len++] = *text;
    }
}

static void put_u64(struct vcd *v, uint64_t n)
{
    char digits[21];
    char *p = digits + sizeof digits - 1;
    *p = '\0';
    do {
        *--p = (char)('0' + n % 10);
    } while ((n /= 10) > 0);
    put_text(v, p);
}

static void put_time(struct vcd *v, int64_t t_units)
{
    put_text(v, "#");
    put_u64(v, (uint64_t)t_units);
    put_text(v, "\n");
    v->t_units = t_units;
}

/* "#" and the digits above the lowest four of all times in the chunk that begins here. */
static void begin_chunk(struct vcd *v, int64_t t_units)
{
    char digits[20];
    unsigned n = 0;
    for (int64_t high = t_units / CHUNK; high > 0; high /= 10) digits[n++] = (char)('0' + high % 10);
    v->chunk_units = t_units - t_units % CHUNK;
    v->prefix_len = n + 1;
    v->prefix[0] = '#';
    for (unsigned i = 0; i < n; i++) v->prefix[1 + i] = digits[n - 1 - i];
}

/* Times of 10000 units and more; returns the end of the line. */
static char *time_line(struct vcd *v, char *p, int64_t t_units)
{
    if (t_units - v->chunk_units >= CHUNK) begin_chunk(v, t_units);
    const unsigned low = (unsigned)(t_units - v->chunk_units);
    memcpy(p, v->prefix, sizeof v->prefix);
    p += v->prefix_len;
    p[0] = (char)('0' + low / 1000);
    p[1] = (char)('0' + low / 100 % 10);
    p[2] = (char)('0' + low / 10 % 10);
    p[3] = (char)('0' + low % 10);
    p[4] = '\n';
    return p + 5;
}

static char *level_lines(char *p, uint64_t lines, uint64_t level)
{
    for (; lines; lines &= lines - 1) {
        const unsigned sig = (unsigned)__builtin_ctzll(lines);
        *p++ = (char)('0' + (level >> sig & 1));
        *p++ = code_of(sig);
        *p++ = '\n';
    }
    return p;
}

/* The path of every edge. */
static void write_step(struct vcd *v, const struct trace_step *s, uint64_t lines)
{
    if (VCD_BUF - v->len < STEP_MAX_LEN) write_out(v);
    const int64_t t_units = s->t_ns / v->unit_ns;
    char *p = v->buf + v->len;
    if (t_units != v->t_units && t_units < CHUNK) {
        put_time(v, t_units);
        p = v->buf + v->len;
    } else if (t_units != v->t_units) {
        p = time_line(v, p, t_units);
    }
    char *const end = level_lines(p, lines, s->level);
    v->changes += (uint64_t)(end - p) / 3;
    v->len = (size_t)(end - v->buf);
    v->t_units = v->edge_units = t_units;
}

static void on_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    struct vcd *v = ctx;
    for (const struct trace_step *const end = s + n; s < end; s++) {
        const uint64_t lines = s->lines & v->sink.mask;
        if (lines) write_step(v, s, lines);
    }
}

static void on_advance(void *ctx, int64_t t_ns)
{
    struct vcd *v = ctx;
    v->seen_units = t_ns / v->unit_ns;
}

static void put_levels(struct vcd *v, uint64_t lines, uint64_t level)
{
    char text[3 * TRACE_SIGNALS_MAX + 1];
    *level_lines(text, lines & v->sink.mask, level) = '\0';
    put_text(v, text);
}

/* From here on the file has edges. What a line did at from_ns before it was asked for is in its first level. */
static void begin_edges(struct vcd *v)
{
    const uint64_t first = v->before ^ ((v->before ^ v->found) & v->moved);
    put_time(v, v->from_ns / v->unit_ns);
    put_text(v, "$dumpvars\n");
    put_levels(v, UINT64_MAX, first);
    put_text(v, "$end\n");
    put_levels(v, first ^ v->level, v->level);
    v->edge_units = v->seen_units = v->t_units;
    v->sink.steps = on_steps;
    v->sink.advance = on_advance;
}

static void steps_before(void *ctx, const struct trace_step *s, unsigned n)
{
    struct vcd *v = ctx;
    for (; n > 0 && s->t_ns < v->from_ns; n--, s++) v->before = v->level = trace_after(v->level, s);
    for (; n > 0 && s->t_ns == v->from_ns; n--, s++) v->level = trace_after(v->level, s);
    if (n == 0) return;
    begin_edges(v);
    on_steps(v, s, n);
}

static void advance_before(void *ctx, int64_t t_ns)
{
    struct vcd *v = ctx;
    if (t_ns < v->from_ns) return;
    begin_edges(v);
    on_advance(v, t_ns);
}

/* The first that the trace tells: how its lines are at done_ns. */
static void present_levels(void *ctx, const struct trace_step *s, unsigned n)
{
    struct vcd *v = ctx;
    (void)n;
    v->before = v->level = s->level;
}

/* Ends before the trace has come to from_ns. */
static void begin_and_end(struct vcd *v)
{
    if (!v->trace->filter) v->before = v->level = v->found;
    begin_edges(v);
}

/* VCD knows 1, 10 and 100 of ns, us and ms here. */
static bool put_timescale(struct vcd *v, uint32_t unit_ns)
{
    static const char *const unit[] = {"1 ns", "10 ns", "100 ns", "1 us", "10 us", "100 us", "1 ms", "10 ms", "100 ms"};
    uint32_t ns = 1;
    for (size_t i = 0; i < sizeof unit / sizeof *unit; i++, ns *= 10) {
        if (ns != unit_ns) continue;
        put_text(v, "$version psabench $end\n$timescale ");
        put_text(v, unit[i]);
        put_text(v, " $end\n");
        return true;
    }
    return false;
}

static void put_names(struct vcd *v, const char *scope, uint64_t mask)
{
    put_text(v, "$scope module ");
    put_text(v, scope);
    put_text(v, " $end\n");
    for (unsigned i = 0; i < v->trace->count; i++) {
        if (!(mask >> i & 1)) continue;
        const char code[2] = {code_of(i), '\0'};
        put_text(v, "$var wire 1 ");
        put_text(v, code);
        put_text(v, " ");
        put_text(v, v->trace->name[i]);
        put_text(v, " $end\n");
    }
    put_text(v, "$upscope $end\n$enddefinitions $end\n");
}

bool vcd_open(struct vcd *v, const struct vcd_cfg *cfg, struct trace *t)
{
    memset(v, 0, offsetof(struct vcd, buf));
    v->trace = t;
    v->out = cfg->out;
    v->unit_ns = cfg->unit_ns;
    v->max_bytes = cfg->max_bytes;
    if (!put_timescale(v, cfg->unit_ns)) return false;
    put_names(v, cfg->scope, cfg->mask);
    trace_wake(t);
    v->from_ns = cfg->from_ns > t->done_ns ? cfg->from_ns : t->done_ns;
    v->sink = (struct trace_sink){.mask = cfg->mask, .steps = present_levels, .advance = advance_before, .ctx = v};
    trace_attach(t, &v->sink);
    v->sink.steps = steps_before;
    v->found = trace_known(t, v->from_ns);
    v->moved = v->found ^ trace_known(t, v->from_ns - 1);
    if (v->from_ns == t->done_ns) begin_edges(v);
    return true;
}

void vcd_flush(struct vcd *v)
{
    if (v->seen_units > v->t_units) put_time(v, v->seen_units);
    write_out(v);
    errno = 0;
    if (!v->error && fflush(v->out) != 0) v->error = errno ? errno : EIO;
}

void vcd_close(struct vcd *v, int64_t t_ns)
{
    trace_detach(v->trace, &v->sink);
    if (v->sink.steps != on_steps) begin_and_end(v);
    const int64_t end_units = t_ns / v->unit_ns;
    v->seen_units = end_units > v->edge_units ? end_units : v->edge_units + 1;
    vcd_flush(v);
}

int vcd_error(struct vcd *v)
{
    if (v->reported) return 0;
    v->reported = v->error != 0;
    return v->error;
}

void vcd_fail(struct vcd *v, int error)
{
    if (!v->error) v->error = error;
}

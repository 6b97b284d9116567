#include "trace/vcd.h"

#include "base/bits.h"

#include <errno.h>
#include <string.h>

#define CHUNK         10000   /* units: the digits above them are formatted once for all times of a chunk */
#define Q50           50      /* CHUNK * 2^50 is the largest product: 63.3 bits */
#define UNIT_FAST_MAX 100000u /* ns */

/* Time; level, code and newline of each line; and what put_word() writes beyond the last. */
enum { LIMIT_RESERVE = 512 }; /* of a file with a limit: a step that began in an earlier block, and the closing time */

enum { STEP_MAX_LEN = sizeof((struct vcd_chunk *)0)->prefix + 5 + 3 * TRACE_SIGNALS_MAX + 5 };

static char code_of(unsigned sig)
{
    return (char)('!' + sig); /* TRACE_SIGNALS_MAX codes of the 94 printable ones */
}

static char code_of_real(unsigned channel)
{
    return code_of(TRACE_SIGNALS_MAX + channel);
}

static void put_out(struct vcd *v)
{
    errno = 0;
    if (!v->error && v->len > 0 && fwrite(v->buf, 1, v->len, v->out) != v->len) v->error = errno ? errno : EIO;
    v->bytes += v->error ? 0 : v->len;
    v->len = 0;
}

/* Where the next line with a time begins, from `at` on; len: there is none. A line's code may be '#', too, behind a level. */
static size_t next_time(const struct vcd *v, size_t at)
{
    for (; at < v->len; at++)
        if (v->buf[at] == '#' && (at == 0 || v->buf[at - 1] == '\n')) return at;
    return v->len;
}

/* The last time within the room of the file closes it: all edges before it are there. */
static void end_at_limit(struct vcd *v)
{
    const uint64_t room = v->max_bytes - LIMIT_RESERVE > v->bytes ? v->max_bytes - LIMIT_RESERVE - v->bytes : 0;
    size_t end = next_time(v, 0);
    for (size_t at = end; at < v->len && at <= room; at = next_time(v, at + 1)) end = at;
    for (; end < v->len && v->buf[end] != '\n'; end++) continue;
    v->len = end < v->len ? end + 1 : end;
    put_out(v);
    v->limited = true;
    vcd_fail(v, EFBIG);
}

static void write_out(struct vcd *v)
{
    if (!v->error && v->max_bytes && v->bytes + v->len > v->max_bytes - LIMIT_RESERVE) end_at_limit(v);
    else put_out(v);
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

/* "#" and the digits above the lowest four of all times in the chunk of t_ns. */
static void begin_chunk(struct vcd_chunk *c, int64_t t_ns)
{
    char digits[20];
    unsigned n = 0;
    const int64_t chunk = t_ns / c->unit_ns / CHUNK;
    for (int64_t high = chunk; high > 0; high /= 10) digits[n++] = (char)('0' + high % 10);
    c->units = chunk * CHUNK;
    c->ns = c->units * c->unit_ns;
    c->span_ns = (uint64_t)(CHUNK * c->unit_ns);
    c->prefix_len = n + 1;
    c->prefix[0] = '#';
    for (unsigned i = 0; i < n; i++) c->prefix[1 + i] = digits[n - 1 - i];
}

static bool in_chunk(const struct vcd_chunk *c, int64_t t_ns)
{
    return (uint64_t)(t_ns - c->ns) < c->span_ns;
}

/* Units from the chunk's beginning, rounded down; without a division where the product is exact in 64 bits: below
 * CHUNK * unit_ns the error of the reciprocal stays under 1 / unit_ns as long as CHUNK * unit_ns^2 < 2^Q50. */
static unsigned units_in_chunk(const struct vcd_chunk *c, int64_t t_ns)
{
    const uint64_t ns = (uint64_t)(t_ns - c->ns);
    return (unsigned)(c->units_per_ns_q50 ? ns * c->units_per_ns_q50 >> Q50 : ns / (uint64_t)c->unit_ns);
}

static void set_unit(struct vcd_chunk *c, uint32_t unit_ns)
{
    c->unit_ns = unit_ns;
    c->units_per_ns_q50 = unit_ns <= UNIT_FAST_MAX ? (UINT64_C(1) << Q50) / unit_ns + 1 : 0;
}

#define TWO_DIGITS(tens, ones) (uint16_t)('0' + (tens) + (('0' + (ones)) << 8))
#define TEN_PAIRS(tens)                                                                                                \
    TWO_DIGITS(tens, 0), TWO_DIGITS(tens, 1), TWO_DIGITS(tens, 2), TWO_DIGITS(tens, 3), TWO_DIGITS(tens, 4),           \
        TWO_DIGITS(tens, 5), TWO_DIGITS(tens, 6), TWO_DIGITS(tens, 7), TWO_DIGITS(tens, 8), TWO_DIGITS(tens, 9)

static const uint16_t two_digits[100] = {TEN_PAIRS(0), TEN_PAIRS(1), TEN_PAIRS(2), TEN_PAIRS(3), TEN_PAIRS(4),
                                         TEN_PAIRS(5), TEN_PAIRS(6), TEN_PAIRS(7), TEN_PAIRS(8), TEN_PAIRS(9)};

/* Four digits and a newline, for put_word(). */
static uint64_t end_of_time(unsigned low)
{
    const uint64_t newline = (uint64_t)'\n' << 32;
    return newline | two_digits[low / 100] | (uint32_t)two_digits[low % 100] << 16;
}

static char *put_word(char *p, uint64_t text, unsigned len)
{
    bits_put_le((uint8_t *)p, text, 8);
    return p + len;
}

/* Level, code, newline of the first of these lines; for put_word(). */
static uint64_t level_line(uint64_t lines, uint64_t level)
{
    const unsigned sig = (unsigned)__builtin_ctzll(lines);
    return '0' + (level >> sig & 1) + ((uint64_t)(unsigned char)code_of(sig) << 8) + ((uint64_t)'\n' << 16);
}

static char *level_lines(char *p, uint64_t lines, uint64_t level)
{
    for (; lines; lines &= lines - 1) p = put_word(p, level_line(lines, level), 3);
    return p;
}

/* In the first chunk, where numbers have fewer digits. */
static void write_step(struct vcd *v, const struct trace_step *s)
{
    const uint64_t lines = s->lines & v->sink.mask;
    if (!lines) return;
    const int64_t t_units = s->t_ns / v->chunk.unit_ns;
    if (t_units != v->t_units) put_time(v, t_units);
    if (VCD_BUF - v->len < STEP_MAX_LEN) write_out(v);
    char *const p = v->buf + v->len, *const end = level_lines(p, lines, s->level);
    v->changes += (uint64_t)(end - p) / 3;
    v->len += (size_t)(end - p);
    v->edge_units = t_units;
}

/* The path of nearly every edge: steps of a chunk whose higher digits are ready, a time and a level in one word. Returns
 * the first step that is left. */
static const struct trace_step *write_chunk(struct vcd *v, const struct trace_step *s, const struct trace_step *end)
{
    const struct vcd_chunk c = v->chunk; /* what is written through p cannot change it */
    const uint64_t mask = v->sink.mask;
    const char *const room = v->buf + VCD_BUF - STEP_MAX_LEN;
    char *p = v->buf + v->len;
    int64_t before = v->t_units - c.units;
    uint64_t changes = 0;
    for (; s < end && in_chunk(&c, s->t_ns) && p <= room; s++) {
        const uint64_t lines = s->lines & mask;
        if (!lines) continue;
        const unsigned low = units_in_chunk(&c, s->t_ns);
        const uint64_t level = level_line(lines, s->level);
        if (low == before) p = put_word(p, level, 3);
        else {
            memcpy(p, c.prefix, sizeof c.prefix);
            p = put_word(p + c.prefix_len, end_of_time(low) | level << 40, 8);
        }
        before = low;
        changes++;
        for (uint64_t more = lines & (lines - 1); more; more &= more - 1, changes++)
            p = put_word(p, level_line(more, s->level), 3);
    }
    v->changes += changes;
    v->t_units = c.units + before;
    if (changes > 0) v->edge_units = v->t_units;
    v->len = (size_t)(p - v->buf);
    return s;
}

static void write_steps(struct vcd *v, const struct trace_step *s, unsigned n)
{
    for (const struct trace_step *const end = s + n; s < end;) {
        if (VCD_BUF - v->len < STEP_MAX_LEN) write_out(v);
        if (!in_chunk(&v->chunk, s->t_ns)) begin_chunk(&v->chunk, s->t_ns);
        if (v->chunk.units > 0) s = write_chunk(v, s, end);
        else write_step(v, s++);
    }
}

/* ---- real-valued channels: some hundred values a second ---- */

static void write_real(struct vcd *v, const struct vcd_real *r)
{
    char text[48];
    const int64_t t_units = r->t_ns / v->chunk.unit_ns;
    if (t_units != v->t_units) put_time(v, t_units);
    (void)snprintf(text, sizeof text, "r%.9g %c\n", r->value, code_of_real(r->channel));
    put_text(v, text);
    v->changes++;
    v->edge_units = t_units;
}

/* The oldest that waits, if it is of t_ns or before. */
static const struct vcd_real *take_real(struct vcd *v, int64_t t_ns)
{
    const struct vcd_real *r = &v->real[v->real_first];
    if (v->real_count == 0 || r->t_ns > t_ns) return NULL;
    v->real_first = (v->real_first + 1) % VCD_REALS;
    v->real_count--;
    return r;
}

static void write_reals(struct vcd *v, int64_t t_ns)
{
    for (const struct vcd_real *r; (r = take_real(v, t_ns));) write_real(v, r);
}

/* Edges may still come for times before it: it waits. More than can wait are a loss that the file must not hide. */
static void on_real(void *ctx, unsigned channel, double value, int64_t t_ns)
{
    struct vcd *v = ctx;
    if (v->real_count == VCD_REALS) vcd_fail(v, ENOBUFS);
    else v->real[(v->real_first + v->real_count++) % VCD_REALS] = (struct vcd_real){t_ns, channel, value};
}

static void on_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    struct vcd *v = ctx;
    while (v->real_count > 0 && n > 0 && v->real[v->real_first].t_ns < s[n - 1].t_ns) {
        const int64_t t_ns = v->real[v->real_first].t_ns;
        unsigned before = 0;
        while (s[before].t_ns <= t_ns) before++;
        write_steps(v, s, before);
        write_reals(v, t_ns);
        s += before;
        n -= before;
    }
    write_steps(v, s, n);
}

static void on_advance(void *ctx, int64_t t_ns)
{
    struct vcd *v = ctx;
    write_reals(v, t_ns);
    v->seen_units = t_ns / v->chunk.unit_ns;
}

static void put_levels(struct vcd *v, uint64_t lines, uint64_t level)
{
    char text[3 * TRACE_SIGNALS_MAX + 8];
    *level_lines(text, lines & v->sink.mask, level) = '\0';
    put_text(v, text);
}

/* From here on the file has edges. What a line did at from_ns before it was asked for is in its first level. */
static void begin_edges(struct vcd *v)
{
    const uint64_t first = v->before ^ ((v->before ^ v->found) & v->moved);
    put_time(v, v->from_ns / v->chunk.unit_ns);
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

static void put_var(struct vcd *v, const char *kind, char letter, const char *name)
{
    const char code[2] = {letter, '\0'};
    const char *const words[] = {"$var ", kind, code, " ", name, " $end\n"};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) put_text(v, words[i]);
}

static void put_names(struct vcd *v, const char *scope, uint64_t mask)
{
    put_text(v, "$scope module ");
    put_text(v, scope);
    put_text(v, " $end\n");
    for (unsigned i = 0; i < v->trace->count; i++) {
        if (mask >> i & 1) put_var(v, "wire 1 ", code_of(i), v->trace->name[i]);
    }
    for (unsigned i = 0; v->reals && i < v->trace->reals->count; i++)
        put_var(v, "real 64 ", code_of_real(i), v->trace->reals->name[i]);
    put_text(v, "$upscope $end\n$enddefinitions $end\n");
}

bool vcd_open(struct vcd *v, const struct vcd_cfg *cfg, struct trace *t)
{
    memset(v, 0, offsetof(struct vcd, buf));
    v->trace = t;
    v->out = cfg->out;
    v->max_bytes = cfg->max_bytes;
    v->reals = cfg->reals && t->reals;
    if (!put_timescale(v, cfg->unit_ns)) return false;
    set_unit(&v->chunk, cfg->unit_ns);
    put_names(v, cfg->scope, cfg->mask);
    trace_wake(t);
    v->from_ns = cfg->from_ns > t->done_ns ? cfg->from_ns : t->done_ns;
    v->sink = (struct trace_sink){.mask = cfg->mask, .steps = present_levels, .advance = advance_before, .ctx = v};
    trace_attach(t, &v->sink);
    if (v->reals) {
        t->reals->value = on_real;
        t->reals->ctx = v;
    }
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
    if (v->reals) v->trace->reals->value = NULL;
    if (v->sink.steps != on_steps) begin_and_end(v);
    const int64_t end_units = t_ns / v->chunk.unit_ns;
    write_reals(v, t_ns);
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

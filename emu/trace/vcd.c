#include "trace/vcd.h"

#include <errno.h>
#include <string.h>

#define LINE_MAX_LEN 32u /* '#', 20 digits, newline, level, code, newline */

static char code_of(unsigned sig)
{
    return (char)('!' + sig); /* TRACE_SIGNALS_MAX codes of the 94 printable ones */
}

static void write_out(struct vcd *v)
{
    errno = 0;
    if (!v->error && v->len > 0 && fwrite(v->buf, 1, v->len, v->out) != v->len) v->error = errno ? errno : EIO;
    v->len = 0;
}

static void put(struct vcd *v, const char *text)
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
    put(v, p);
}

static void put_time(struct vcd *v, int64_t t_units)
{
    put(v, "#");
    put_u64(v, (uint64_t)t_units);
    put(v, "\n");
    v->t_units = t_units;
}

/* The path of every edge. */
static void change(void *ctx, unsigned sig, bool level, int64_t t_ns)
{
    struct vcd *v = ctx;
    if (VCD_BUF - v->len < LINE_MAX_LEN) write_out(v);
    const int64_t t_units = t_ns / v->unit_ns;
    if (t_units != v->t_units) put_time(v, t_units);
    v->buf[v->len++] = level ? '1' : '0';
    v->buf[v->len++] = code_of(sig);
    v->buf[v->len++] = '\n';
    v->edge_units = t_units;
    v->changes++;
}

static void advance(void *ctx, int64_t t_ns)
{
    struct vcd *v = ctx;
    v->seen_units = t_ns / v->unit_ns;
}

/* VCD knows 1, 10 and 100 of ns, us and ms here. */
static bool put_timescale(struct vcd *v, uint32_t unit_ns)
{
    static const char *const unit[] = {"1 ns", "10 ns", "100 ns", "1 us", "10 us", "100 us", "1 ms", "10 ms", "100 ms"};
    uint32_t ns = 1;
    for (size_t i = 0; i < sizeof unit / sizeof *unit; i++, ns *= 10) {
        if (ns != unit_ns) continue;
        put(v, "$version psabench $end\n$timescale ");
        put(v, unit[i]);
        put(v, " $end\n");
        return true;
    }
    return false;
}

static void put_names(struct vcd *v, const char *scope, uint32_t mask)
{
    put(v, "$scope module ");
    put(v, scope);
    put(v, " $end\n");
    for (unsigned i = 0; i < v->trace->count; i++) {
        if (!(mask >> i & 1)) continue;
        const char code[2] = {code_of(i), '\0'};
        put(v, "$var wire 1 ");
        put(v, code);
        put(v, " ");
        put(v, v->trace->name[i]);
        put(v, " $end\n");
    }
    put(v, "$upscope $end\n$enddefinitions $end\n");
}

bool vcd_open(struct vcd *v, const struct vcd_cfg *cfg, struct trace *t)
{
    memset(v, 0, offsetof(struct vcd, buf));
    v->trace = t;
    v->out = cfg->out;
    v->unit_ns = cfg->unit_ns;
    if (!put_timescale(v, cfg->unit_ns)) return false;
    put_names(v, cfg->scope, cfg->mask);
    v->seen_units = t->done_ns / v->unit_ns;
    put_time(v, v->seen_units);
    put(v, "$dumpvars\n");
    v->sink = (struct trace_sink){.mask = cfg->mask, .change = change, .advance = advance, .ctx = v};
    trace_attach(t, &v->sink); /* tells the levels */
    put(v, "$end\n");
    v->changes = 0;
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
    const int64_t end_units = t_ns / v->unit_ns;
    v->seen_units = end_units > v->edge_units ? end_units : v->edge_units + 1;
    vcd_flush(v);
}

int vcd_error(struct vcd *v)
{
    if (v->told) return 0;
    v->told = v->error != 0;
    return v->error;
}

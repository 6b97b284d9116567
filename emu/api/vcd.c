#include "api/internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Value Change Dump (IEEE 1364-2005 clause 18) of all parts of a bench, a scope each. Not emu/trace/vcd.c, which writes one
 * trace of up to 64 lines: here as many parts as there are, and edges that a board reports late must wait for those that
 * the chips report at once. */
struct api_vcd {
    FILE *out;
    int64_t written_ns; /* the latest time stamp */
    int error;          /* errno of the first failure */
    bool dirty;         /* a change is after it */
};

static void put_text(struct api_vcd *v, const char *text)
{
    const size_t len = strlen(text);
    errno = 0;
    if (!v->error && fwrite(text, 1, len, v->out) != len) v->error = errno ? errno : EIO;
}

static void put_time(struct api_vcd *v, int64_t t_ns)
{
    char text[24];
    (void)snprintf(text, sizeof text, "#%lld\n", (long long)t_ns);
    put_text(v, text);
    v->written_ns = t_ns;
    v->dirty = false;
}

/* Identifier codes: numbers of the 94 printable characters, the lowest digit first. */
static void code_of(unsigned number, char code[8])
{
    do {
        *code++ = (char)('!' + number % 94);
    } while ((number /= 94) > 0);
    *code = '\0';
}

static void put_level(struct api_vcd *v, const struct psabench_part *p, unsigned pin, bool level)
{
    char text[12] = {level ? '1' : '0'};
    code_of(p->first_code + pin, text + 1);
    put_text(v, text);
    put_text(v, "\n");
}

static void put_change(struct api_vcd *v, const struct psabench_part *p, const struct api_edge *e)
{
    const int64_t t_ns = e->t_ns > v->written_ns ? e->t_ns : v->written_ns;
    if (t_ns != v->written_ns) put_time(v, t_ns);
    put_level(v, p, e->pin, e->level);
    v->dirty = true;
}

/* ---- queues ---- */

static bool grow_queue(struct api_queue *q)
{
    const size_t cap = q->cap ? 2 * q->cap : 256;
    struct api_edge *edge = realloc(q->edge, cap * sizeof *edge);
    if (!edge) return false;
    q->edge = edge;
    q->cap = cap;
    return true;
}

void api_vcd_put(struct psabench_part *p, unsigned pin, bool level, int64_t t_ns)
{
    struct api_queue *q = &p->queue;
    if (q->head == q->len) q->head = q->len = 0;
    if (q->len == q->cap && q->head > q->cap / 2) {
        q->len -= q->head;
        memmove(q->edge, q->edge + q->head, q->len * sizeof *q->edge);
        q->head = 0;
    }
    if (q->len == q->cap && !grow_queue(q)) {
        p->bench->vcd->error = ENOMEM;
        return;
    }
    q->edge[q->len++] = (struct api_edge){t_ns, (uint8_t)pin, level};
}

static struct psabench_part *earliest_part(const psabench *b)
{
    struct psabench_part *first = NULL;
    for (struct psabench_part *p = b->parts; p; p = p->next) {
        const struct api_queue *q = &p->queue;
        if (q->head == q->len) continue;
        if (!first || q->edge[q->head].t_ns < first->queue.edge[first->queue.head].t_ns) first = p;
    }
    return first;
}

static void write_until(psabench *b, int64_t t_ns)
{
    for (struct psabench_part *p; (p = earliest_part(b)) && p->queue.edge[p->queue.head].t_ns <= t_ns;)
        put_change(b->vcd, p, &p->queue.edge[p->queue.head++]);
}

void api_vcd_follow(psabench *b)
{
    int64_t lag_ns = 0;
    for (const struct psabench_part *p = b->parts; p; p = p->next)
        if (p->recorded && p->kind->lag_ns > lag_ns) lag_ns = p->kind->lag_ns;
    write_until(b, b->sched.now_ns - lag_ns);
}

/* ---- beginning and end ---- */

/* From here on its pins are recorded; what they are now is known. */
static void begin_part(struct psabench_part *p, unsigned first_code)
{
    const uint32_t before = p->watched;
    p->first_code = first_code;
    p->recorded = (uint32_t)((UINT64_C(1) << p->kind->pin_count) - 1);
    for (unsigned i = 0; i < p->kind->pin_count; i++) {
        const struct api_pin *pin = &p->kind->pins[i];
        if (pin->dir == API_IN || !pin->get || p->kind->lag_ns || before >> i & 1) continue;
        const uint32_t bit = UINT32_C(1) << i;
        p->level = pin->get(p, pin->arg) ? p->level | bit : p->level & ~bit;
    }
    if (p->kind->follow) p->kind->follow(p, p->bench->sched.now_ns);
    p->queue.head = p->queue.len = 0;
}

static void put_scope(struct api_vcd *v, const struct psabench_part *p)
{
    char code[8], line[64];
    (void)snprintf(line, sizeof line, "$scope module %s $end\n", p->name);
    put_text(v, line);
    for (unsigned i = 0; i < p->kind->pin_count; i++) {
        code_of(p->first_code + i, code);
        (void)snprintf(line, sizeof line, "$var wire 1 %s %s $end\n", code, p->kind->pins[i].name);
        put_text(v, line);
    }
    put_text(v, "$upscope $end\n");
}

static void write_header(psabench *b)
{
    unsigned code = 0;
    put_text(b->vcd, "$version psabench $end\n$timescale 1 ns $end\n");
    for (struct psabench_part *p = b->parts; p; p = p->next) {
        begin_part(p, code);
        code += p->kind->pin_count;
        put_scope(b->vcd, p);
    }
    put_text(b->vcd, "$enddefinitions $end\n");
    put_time(b->vcd, b->sched.now_ns);
    put_text(b->vcd, "$dumpvars\n");
    for (const struct psabench_part *p = b->parts; p; p = p->next)
        for (unsigned i = 0; i < p->kind->pin_count; i++) put_level(b->vcd, p, i, p->level >> i & 1);
    put_text(b->vcd, "$end\n");
}

int api_vcd_begin(psabench *b, const char *path)
{
    struct api_vcd *v = calloc(1, sizeof *v);
    errno = 0;
    FILE *out = v ? fopen(path, "w") : NULL;
    if (!out) {
        const int error = v ? errno : ENOMEM;
        free(v);
        return error;
    }
    v->out = out;
    b->vcd = v;
    b->inside++;
    write_header(b);
    b->inside--;
    return 0;
}

int api_vcd_end(psabench *b)
{
    struct api_vcd *v = b->vcd;
    if (!v) return 0;
    const int64_t now_ns = b->sched.now_ns;
    for (struct psabench_part *p = b->parts; p; p = p->next)
        if (p->kind->finish) p->kind->finish(p, now_ns);
    write_until(b, now_ns);
    for (struct psabench_part *p = b->parts; p; p = p->next) {
        p->recorded = 0;
        if (p->kind->follow) p->kind->follow(p, now_ns);
    }
    /* A closing time later than the last change: sigrok loses that change otherwise. */
    const int64_t last_ns = v->written_ns + v->dirty;
    if (now_ns > v->written_ns || v->dirty) put_time(v, now_ns > last_ns ? now_ns : last_ns);
    errno = 0;
    if (fclose(v->out) != 0 && !v->error) v->error = errno ? errno : EIO;
    const int error = v->error;
    free(v);
    b->vcd = NULL;
    return error;
}

#include "app/logic.h"

#include "base/why.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define RING_BYTES ((size_t)16 << 20) /* 1 s at 8 MHz; a slice of 1 ms at 100 MHz is 200 kB */

/* ---- a capture: a sampler and its ring */

struct capture {
    struct sampler sampler;
    uint8_t *ring;
    int64_t first_ns;
};

static void free_capture(struct capture *c)
{
    free(c->ring);
    free(c);
}

static void *start_capture(void *ctx, const struct beagle_request *r)
{
    const struct logic_port *p = ctx;
    struct trace *t = unit_trace(&p->bench->unit[p->bench->watched]);
    struct capture *c = calloc(1, sizeof *c);
    if (!c) return NULL;
    c->ring = malloc(RING_BYTES);
    const char *name[BEAGLE_CHANNELS + 1];
    memcpy(name, p->name, sizeof name);
    if (r->bytes == 1) name[8] = NULL; /* channels 0 to 7 alone */
    const struct sampler_cfg cfg = {.clock = {.hz = r->hz, .div = 1},
                                    .names = name,
                                    .bytes = r->bytes,
                                    .block = r->block,
                                    .ring = c->ring,
                                    .ring_bytes = RING_BYTES};
    if (!c->ring || !sampler_start(&c->sampler, t, &cfg)) {
        free_capture(c);
        return NULL;
    }
    c->first_ns = clk_edge_ns(&c->sampler.clock, c->sampler.next);
    return c;
}

static void stop_capture(void *capture)
{
    struct capture *c = capture;
    sampler_stop(&c->sampler);
    free_capture(c);
}

static size_t take_samples(void *capture, uint8_t *buf, size_t cap)
{
    return sampler_take(&((struct capture *)capture)->sampler, buf, cap);
}

static void look_at(const void *capture, struct beagle_progress *out)
{
    const struct capture *c = capture;
    *out = (struct beagle_progress){.first_ns = c->first_ns,
                                    .kept = c->sampler.kept,
                                    .dropped = c->sampler.dropped,
                                    .holes = c->sampler.holes,
                                    .waiting = c->sampler.len};
}

/* ---- which lines */

static const struct board_type *watched_type(const struct bench *b)
{
    return b->scenario.units[b->watched].cfg.type;
}

/* The first lines of the board; of a board that has more than there are channels, those that never move in operation are
 * left out first. */
static void default_lines(const struct board_type *t, const char **name)
{
    static const char *const left_out[] = {"Res", "SYNC_T"};
    unsigned n = 0;
    for (unsigned i = 0; i < t->line_count && n < BEAGLE_CHANNELS; i++) {
        bool out = false;
        for (unsigned k = 0; k < sizeof left_out / sizeof *left_out; k++)
            out |= t->line_count > BEAGLE_CHANNELS && strcmp(t->lines[i].name, left_out[k]) == 0;
        if (!out) name[n++] = t->lines[i].name;
    }
    name[n] = NULL;
}

/* The board's own pointer to a name of len characters, or NULL. */
static const char *line_name(const struct board_type *t, const char *text, size_t len)
{
    for (unsigned i = 0; i < t->line_count; i++)
        if (strlen(t->lines[i].name) == len && memcmp(t->lines[i].name, text, len) == 0) return t->lines[i].name;
    return NULL;
}

static bool fail_line(const struct board_type *t, const char *text, size_t len, char *why, size_t cap)
{
    char known[480] = "", got[64];
    for (unsigned i = 0; i < t->line_count; i++) why_list_add(known, sizeof known, t->lines[i].name);
    snprintf(got, sizeof got, "%.*s", (int)(len < 60 ? len : 60), text);
    return why_expected(why, cap, "--logic", WHY_TEXT(got), "lines of the watched unit, a %s: %s", t->title, known);
}

/* The lines of an option in the order of channels. False with one line in why. */
static bool find_lines(const struct board_type *t, const struct options_logic *o, const char **name, char *why,
                       size_t cap)
{
    unsigned n = 0;
    if (!o->lines) {
        default_lines(t, name);
        return true;
    }
    for (const char *at = o->lines;; at++) {
        const size_t len = strcspn(at, ",");
        const char *const found = line_name(t, at, len);
        if (!found) return fail_line(t, at, len, why, cap);
        if (n == BEAGLE_CHANNELS) return why_expected(why, cap, "--logic", WHY_TEXT(o->lines), "up to 14 lines");
        name[n++] = found;
        name[n] = NULL;
        at += len;
        if (!*at) return true;
    }
}

bool logic_check(const struct bench *b, const struct options *o, char *why, size_t cap)
{
    const char *name[BEAGLE_CHANNELS + 1];
    for (unsigned i = 0; i < o->logic_count; i++)
        if (!find_lines(watched_type(b), &o->logic[i], name, why, cap)) return false;
    return true;
}

/* ---- ports */

static void join_names(struct logic_port *p)
{
    size_t n = 0;
    for (unsigned i = 0; p->name[i]; i++)
        n += (size_t)snprintf(p->names + n, sizeof p->names - n, "%s%s", i ? "," : "", p->name[i]);
}

static bool open_port(struct logic_ports *all, struct links *links, struct bench *b, const struct options *o,
                      unsigned i, char *why, size_t cap)
{
    struct logic_port *p = calloc(1, sizeof *p);
    if (!p) return why_fail(why, cap, "--logic: out of memory");
    p->bench = b;
    const struct beagle_source source = {.ctx = p,
                                         .start = start_capture,
                                         .take = take_samples,
                                         .look = look_at,
                                         .stop = stop_capture,
                                         .high = o->pace == PACE_WALL ? 0 : RING_BYTES / 2};
    int err = 0;
    if (find_lines(watched_type(b), &o->logic[i], p->name, why, cap)) {
        join_names(p);
        err = beagle_open(&p->server, links, &source, o->logic[i].port);
        if (!err) {
            all->port[all->count++] = p;
            return true;
        }
    }
    free(p);
    char where[48];
    snprintf(where, sizeof where, "--logic beaglelogic:%u", o->logic[i].port);
    return err ? why_port(why, cap, where, -err) : false;
}

bool logic_open(struct logic_ports *all, struct links *links, struct bench *b, const struct options *o, char *why,
                size_t cap)
{
    for (unsigned i = 0; i < o->logic_count; i++)
        if (!open_port(all, links, b, o, i, why, cap)) return false;
    return true;
}

void logic_close(struct logic_ports *all)
{
    for (unsigned i = 0; i < all->count; i++) beagle_close(&all->port[i]->server);
}

void logic_free(struct logic_ports *all)
{
    for (unsigned i = 0; i < all->count; i++) free(all->port[i]);
    all->count = 0;
}

bool logic_is_sampling(const struct logic_ports *all)
{
    for (unsigned i = 0; i < all->count; i++)
        if (beagle_is_sampling(&all->port[i]->server)) return true;
    return false;
}

bool logic_has_begun(const struct logic_ports *all)
{
    for (unsigned i = 0; i < all->count; i++)
        if (all->port[i]->server.ended.captures) return true;
    return false;
}

/* ---- counters */

void logic_describe(const struct logic_ports *all, cJSON *result)
{
    cJSON *ports = all->count ? cJSON_AddArrayToObject(result, "logic") : NULL;
    for (unsigned i = 0; i < all->count; i++) {
        const struct beagle_totals t = beagle_totals(&all->port[i]->server);
        cJSON *j = cJSON_CreateObject();
        cJSON_AddNumberToObject(j, "port", all->port[i]->server.port);
        cJSON_AddNumberToObject(j, "clients", all->port[i]->server.clients);
        cJSON_AddNumberToObject(j, "captures", (double)t.captures);
        cJSON_AddNumberToObject(j, "running", t.running);
        cJSON_AddNumberToObject(j, "samples", (double)t.samples);
        cJSON_AddNumberToObject(j, "lost", (double)t.lost);
        cJSON_AddNumberToObject(j, "holes", (double)t.holes);
        cJSON_AddNumberToObject(j, "rejected", (double)t.rejected);
        cJSON_AddNumberToObject(j, "first_ns", (double)t.first_ns);
        cJSON_AddItemToArray(ports, j);
    }
}

void logic_print_counters(const struct logic_ports *all)
{
    for (unsigned i = 0; i < all->count; i++) {
        const struct beagle_totals t = beagle_totals(&all->port[i]->server);
        if (t.captures)
            fprintf(stderr,
                    "psa-emu: logic analyser, port %u: captures %" PRIu64 ", samples %" PRIu64 ", lost %" PRIu64
                    " in %" PRIu64 " places, lines rejected %" PRIu64 "\n",
                    all->port[i]->server.port, t.captures, t.samples, t.lost, t.holes, t.rejected);
    }
}

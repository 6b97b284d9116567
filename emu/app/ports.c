#define _GNU_SOURCE /* open_memstream, strtok_r */
#include "app/ports.h"

#include "base/why.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/* ---- CAN */

static bool open_socketcand(struct can_hub *hub, struct ports_can *c, const struct options_can *o, char *why,
                            size_t cap)
{
    const int err = socketcand_listen(&c->socketcand, hub, c->hubs, o->port);
    if (!err) return true;
    if (err == -EADDRINUSE) {
        return why_fail(why, cap,
                        "--can socketcand:%u: expected a free port of 127.0.0.1 or 0 (any free port), got one in use",
                        o->port);
    }
    return why_fail(why, cap, "--can socketcand:%u: %s", o->port, strerror(-err));
}

static bool open_slcan(struct can_hub *hub, struct ports_can *c, const struct options_can *o, char *why, size_t cap)
{
    const int err = slcan_pty_open(&c->slcan, hub, o->arg);
    if (!err) return true;
    if (err == -EEXIST)
        return why_fail(why, cap, "--can slcan:%s: expected a new name or a symbolic link to a pty, got another file",
                        o->arg);
    return why_fail(why, cap, "--can slcan%s%s: %s", o->arg ? ":" : "", o->arg ? o->arg : "", strerror(-err));
}

static bool open_socketcan(struct can_hub *hub, struct ports_can *c, const struct options_can *o, char *why, size_t cap)
{
    const int err = socketcan_open(&c->socketcan, hub, o->arg);
    if (!err) return true;
    if (err == -ENODEV) {
        return why_fail(why, cap,
                        "--can socketcan:%s: expected a CAN interface, got none; as root: ip link add %s type vcan && "
                        "ip link set %s up",
                        o->arg, o->arg, o->arg);
    }
    if (err == -ENETDOWN)
        return why_fail(
            why, cap,
            "--can socketcan:%s: expected an interface that is up, got one that is down; as root: ip link set %s up",
            o->arg, o->arg);
    if (err == -EAFNOSUPPORT || err == -EPROTONOSUPPORT) {
        return why_fail(why, cap, "--can socketcan:%s: expected a kernel with CAN; use --can socketcand or --can slcan",
                        o->arg);
    }
    return why_fail(why, cap, "--can socketcan:%s: %s", o->arg, strerror(-err));
}

static bool open_log(struct can_hub *hub, struct ports_can *c, const struct options_can *o, char *why, size_t cap)
{
    const int err = can_log_open(&c->log, hub->bus, hub->name, o->arg, hub->epoch_ns);
    return !err || why_fail(why, cap, "--can log:%s: %s", o->arg, strerror(-err));
}

/* The hub of a bus, the first of all for no name; NULL: there is no such bus. */
static struct can_hub *hub_of(struct ports *p, const char *bus)
{
    for (unsigned i = 0; i < p->hubs; i++)
        if (!bus[0] || strcmp(p->hub[i].name, bus) == 0) return &p->hub[i];
    return NULL;
}

static bool fail_bus(const struct ports *p, const char *bus, char *why, size_t cap)
{
    char known[160] = "";
    for (unsigned i = 0; i < p->hubs; i++) why_list_add(known, sizeof known, p->hub[i].name);
    return why_expected(why, cap, "--can BUS=...", WHY_TEXT(bus), "one of %s", known);
}

static bool open_can(struct ports *p, const struct options *o, char *why, size_t cap)
{
    typedef bool open_fn(struct can_hub *, struct ports_can *, const struct options_can *, char *, size_t);
    static open_fn *const open[] = {[OPTIONS_SOCKETCAND] = open_socketcand,
                                    [OPTIONS_SLCAN] = open_slcan,
                                    [OPTIONS_SOCKETCAN] = open_socketcan,
                                    [OPTIONS_CAN_LOG] = open_log};
    for (unsigned i = 0; i < o->can_count; i++) {
        struct ports_can *c = calloc(1, sizeof *c);
        if (!c) return why_fail(why, cap, "--can: out of memory");
        struct can_hub *hub = hub_of(p, o->can[i].bus);
        c->kind = o->can[i].kind;
        const bool all = c->kind == OPTIONS_SOCKETCAND && !o->can[i].bus[0];
        c->hubs = all ? p->hubs : 1;
        c->bus = p->hubs > 1 && !all ? hub->name : NULL;
        if (!open[c->kind](hub, c, &o->can[i], why, cap)) {
            free(c);
            return false;
        }
        p->can[p->can_count++] = c;
    }
    return true;
}

/* ---- line port: the sampler of the watched unit is its source */

static bool line_start(void *ctx, int64_t t_ns)
{
    struct bench *b = ctx;
    (void)t_ns;
    const struct unit *u = &b->unit[b->watched];
    return sampler_start(&b->sampler, unit_trace(u), u->type->port_lines, &b->sampler.clock);
}

static void line_stop(void *ctx)
{
    sampler_stop(&((struct bench *)ctx)->sampler);
}

static size_t line_take(void *ctx, uint8_t *buf, size_t cap)
{
    return sampler_take(&((struct bench *)ctx)->sampler, buf, cap);
}

static size_t line_waiting(void *ctx)
{
    return ((struct bench *)ctx)->sampler.len;
}

static bool open_line(struct ports *p, struct bench *b, const struct options *o, char *why, size_t cap)
{
    if (!o->line) return true;
    const char *name = strcmp(o->line, "-") == 0 ? NULL : o->line;
    const struct line_source source = {b,         line_start,   line_stop,
                                       line_take, line_waiting, p->hub[0].lossless ? SAMPLER_RING / 2 : 0};
    b->sampler.clock = (struct clk){.hz = o->line_hz, .div = 1};
    p->line = calloc(1, sizeof *p->line);
    const int err = p->line ? line_pty_open(p->line, &p->links, &source, name) : -ENOMEM;
    if (!err) return true;
    free(p->line);
    p->line = NULL;
    if (err == -EEXIST)
        return why_fail(why, cap, "--line %s: expected a new name or a symbolic link to a pty, got another file",
                        o->line);
    return why_fail(why, cap, "--line %s: %s", o->line, strerror(-err));
}

/* ---- sockets and file */

static bool open_socket(struct ctl_server *s, const char *option, const char *path, char *why, size_t cap)
{
    if (!path) return true;
    const int err = ctl_listen(s, path);
    if (!err) return true;
    if (err == -EADDRINUSE)
        return why_fail(why, cap, "--%s %s: expected a free path, got one that another process uses", option, path);
    if (err == -EEXIST)
        return why_fail(why, cap, "--%s %s: expected a new path or a socket, got another file", option, path);
    if (err == -ENAMETOOLONG) return why_fail(why, cap, "--%s %s: expected a path of up to 107 bytes", option, path);
    return why_fail(why, cap, "--%s %s: %s", option, path, strerror(-err));
}

static bool open_vcd(struct ports *p, struct bench *b, const struct options *o, char *why, size_t cap)
{
    if (!o->vcd) return true;
    p->vcd = fopen(o->vcd, "wbe");
    if (!p->vcd) return why_fail(why, cap, "--vcd %s: %s", o->vcd, strerror(errno));
    return bench_record(b, b->watched, p->vcd, o->vcd_unit_ns) ||
           why_fail(why, cap, "--vcd-unit: expected a time unit of VCD, got %u", o->vcd_unit_ns);
}

void ports_init(struct ports *p, struct bench *b, const struct options *o)
{
    p->control.listen.fd = p->truth.listen.fd = -1;
    p->control.links = p->truth.links = &p->links;
    p->scpi.links = &p->links;
    p->hubs = b->buses;
    for (unsigned i = 0; i < p->hubs; i++) {
        struct can_hub *h = &p->hub[i];
        h->name = b->scenario.bus[i].name;
        h->bus = &b->bus[i];
        h->links = &p->links;
        h->connections = &p->connections;
        h->lossless = o->pace != PACE_WALL;
        h->epoch_ns = o->epoch_ns;
    }
}

bool ports_check(struct ports *p, const struct bench *b, const struct options *o, char *why, size_t cap)
{
    for (unsigned i = 0; i < o->can_count; i++) {
        if (!hub_of(p, o->can[i].bus)) return fail_bus(p, o->can[i].bus, why, cap);
    }
    return instruments_check(&p->scpi, o, why, cap) && bus_ports_check(b, o, why, cap);
}

bool ports_open(struct ports *p, struct bench *b, const struct options *o, char *why, size_t cap)
{
    return open_can(p, o, why, cap) && open_line(p, b, o, why, cap) &&
           bus_ports_open(&p->bus, &p->links, b, o, why, cap) && open_vcd(p, b, o, why, cap) &&
           instruments_open(&p->scpi, o, why, cap) && open_socket(&p->control, "control", o->control, why, cap) &&
           open_socket(&p->truth, "truth", o->truth, why, cap);
}

static void ready_pty(FILE *out, const char *what, const struct pty *pty, const char *bus)
{
    fprintf(out, "ready %s pty=%s%s%s%s%s\n", what, pty->path, pty->name ? " link=" : "", pty->name ? pty->name : "",
            bus ? " bus=" : "", bus ? bus : "");
}

void ports_ready(const struct ports *p, const struct options *o, FILE *out)
{
    for (unsigned i = 0; i < p->can_count; i++) {
        const struct ports_can *c = p->can[i];
        if (c->kind == OPTIONS_SOCKETCAND)
            fprintf(out, "ready can=socketcand host=127.0.0.1 port=%u%s%s\n", c->socketcand.port, c->bus ? " bus=" : "",
                    c->bus ? c->bus : "");
        if (c->kind == OPTIONS_SLCAN) ready_pty(out, "can=slcan", &c->slcan.pty, c->bus);
        if (c->kind == OPTIONS_SOCKETCAN) {
            fprintf(out, "ready can=socketcan channel=%s fd=%s%s%s\n", c->socketcan.can.name,
                    c->socketcan.can.node.fd ? "true" : "false", c->bus ? " bus=" : "", c->bus ? c->bus : "");
        }
        if (c->kind == OPTIONS_CAN_LOG)
            fprintf(out, "ready log=%s%s%s\n", c->log.path, c->bus ? " bus=" : "", c->bus ? c->bus : "");
    }
    if (p->line) {
        char what[64];
        snprintf(what, sizeof what, "line=sampled hz=%" PRId64, o->line_hz);
        ready_pty(out, what, &p->line->pty, NULL);
    }
    bus_ports_ready(&p->bus, out);
    instruments_ready(&p->scpi, out);
    if (o->vcd) fprintf(out, "ready vcd=%s\n", o->vcd);
    if (o->control) fprintf(out, "ready control=%s\n", o->control);
    if (o->truth) fprintf(out, "ready truth=%s\n", o->truth);
    fprintf(out, "ready all\n");
    fflush(out);
}

bool ports_logs_whole(struct ports *p, void (*say)(void *ctx, const char *text))
{
    bool whole = true;
    for (unsigned i = 0; i < p->can_count; i++) {
        char text[512];
        const int err = p->can[i]->kind == OPTIONS_CAN_LOG ? can_log_flush(&p->can[i]->log) : 0;
        if (!err) continue;
        snprintf(text, sizeof text, "--can log:%.400s: %s; it is not complete", p->can[i]->log.path, strerror(-err));
        say(NULL, text);
        whole = false;
    }
    return whole;
}

static void close_can(struct ports_can *c)
{
    if (c->kind == OPTIONS_SOCKETCAND) socketcand_close(&c->socketcand);
    if (c->kind == OPTIONS_SLCAN) slcan_pty_close(&c->slcan);
    if (c->kind == OPTIONS_SOCKETCAN) socketcan_close(&c->socketcan);
    if (c->kind == OPTIONS_CAN_LOG) can_log_close(&c->log);
}

static void close_all(struct ports *p)
{
    for (unsigned i = 0; i < p->can_count; i++) close_can(p->can[i]);
    if (p->line) line_pty_close(p->line);
    bus_ports_close(&p->bus);
    instruments_close(&p->scpi);
    ctl_close(&p->control);
    ctl_close(&p->truth);
    for (struct link *l = p->links.first; l; l = l->next) l->gone = true;
    links_reap(&p->links);
    for (unsigned i = 0; i < p->can_count; i++) free(p->can[i]);
    bus_ports_free(&p->bus);
    instruments_free(&p->scpi);
    free(p->line);
    if (p->vcd) fclose(p->vcd);
    p->can_count = 0;
    p->line = NULL;
    p->vcd = NULL;
}

void ports_close(struct ports *p)
{
    close_all(p);
    *p = (struct ports){.control.listen.fd = -1, .truth.listen.fd = -1};
}

void ports_abandon(struct ports *p)
{
    for (unsigned i = 0; i < p->can_count; i++) {
        if (p->can[i]->kind == OPTIONS_SLCAN) p->can[i]->slcan.pty.name = NULL;
    }
    for (unsigned i = 0; i < p->scpi.count; i++) p->scpi.port[i]->port.pty.name = NULL;
    if (p->line) p->line->pty.name = NULL;
    bus_ports_abandon(&p->bus);
    p->control.path = p->truth.path = "";
    close_all(p);
}

/* ---- the ready lines as JSON */

/* ready key=value key=value: an object. */
static void add_one(cJSON *endpoints, char *line)
{
    char *rest = NULL;
    cJSON *e = cJSON_CreateObject();
    for (char *word = strtok_r(line, " ", &rest); word; word = strtok_r(NULL, " ", &rest)) {
        char *value = strchr(word, '=');
        if (!value) continue;
        *value = '\0';
        cJSON_AddStringToObject(e, word, value + 1);
    }
    if (e->child) cJSON_AddItemToArray(endpoints, e);
    else cJSON_Delete(e);
}

void ports_add_endpoints(cJSON *result, char *text)
{
    char *rest = NULL;
    cJSON *endpoints = cJSON_AddArrayToObject(result, "endpoints");
    for (char *line = strtok_r(text, "\n", &rest); line; line = strtok_r(NULL, "\n", &rest)) add_one(endpoints, line);
}

bool ports_describe(const struct ports *p, const struct options *o, cJSON *result)
{
    char *text = NULL;
    size_t len;
    FILE *out = open_memstream(&text, &len);
    if (!out) return false;
    ports_ready(p, o, out);
    const bool whole = fclose(out) == 0;
    if (whole) ports_add_endpoints(result, text);
    free(text);
    return whole;
}

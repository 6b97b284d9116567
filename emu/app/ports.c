#define _GNU_SOURCE /* open_memstream, strtok_r */
#include "app/ports.h"

#include "base/why.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static bool fail_pty(char *why, size_t cap, const char *option, const char *arg, int err)
{
    static const char expected[] = "expected a new name or a symbolic link to a pty, got another file";
    return why_fail(why, cap, "%s%s: %s", option, arg, err == -EEXIST ? expected : strerror(-err));
}

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
    return !err || fail_pty(why, cap, o->arg ? "--can slcan:" : "--can slcan", o->arg ? o->arg : "", err);
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
    return fail_pty(why, cap, "--line ", o->line, err);
}

/* ---- bus ports: cycles of the parallel buses of units as lines of text */

static const struct board_type *type_of(const struct bench *b, unsigned unit)
{
    return b->scenario.units[unit].cfg.type;
}

/* The unit of that name, the first that has a bus for none; the number of units if there is none. */
static unsigned find_unit(const struct bench *b, const char *name)
{
    unsigned i = 0;
    for (; i < b->scenario.unit_count; i++)
        if (name[0] ? strcmp(b->scenario.units[i].name, name) == 0 : type_of(b, i)->bus != NULL) break;
    return i;
}

/* Whether there are such units and their boards have a bus. */
static bool check_bus_ports(const struct bench *b, const struct options *o, char *why, size_t cap)
{
    for (unsigned i = 0; i < o->bus_count; i++) {
        const struct options_bus *p = &o->bus[i];
        const unsigned unit = find_unit(b, p->unit);
        if (unit == b->scenario.unit_count && p->unit[0])
            return why_fail(why, cap, "--bus-port %s: expected a unit of the scenario, got \"%s\"", p->arg, p->unit);
        if (unit == b->scenario.unit_count)
            return why_fail(why, cap, "--bus-port %s: expected a scenario with a unit that has a parallel bus", p->arg);
        if (!type_of(b, unit)->bus) {
            return why_fail(why, cap, "--bus-port %s: expected a unit with a parallel bus, got %s, a %s", p->arg,
                            p->unit, type_of(b, unit)->title);
        }
        for (unsigned k = 0; k < i; k++)
            if (find_unit(b, o->bus[k].unit) == unit)
                return why_fail(why, cap, "--bus-port %s: expected one bus port per unit, got a second for %s", p->arg,
                                b->scenario.units[unit].name);
    }
    return true;
}

static void on_done(void *ctx, const struct board_cycle *c, enum board_cycle_result r, int64_t t_ns)
{
    struct bus_port *p = ctx;
    if (r == BOARD_CYCLE_OK) bus_pty_done(&p->pty, c->data, t_ns);
    else bus_pty_failed(&p->pty, board_cycle_word(r), t_ns);
}

static const char *submit_cycle(void *ctx, const struct bus_request *r, int64_t t_ns)
{
    struct bus_port *p = ctx;
    const struct board_cycle cycle = {
        .write = r->op == BUS_WRITE, .address = r->address, .data = r->data, .strobe_ns = r->strobe_ns};
    const struct bench_cycle request = {.cycle = cycle, .done = on_done, .ctx = p};
    const enum board_cycle_result result = bench_cycle(p->bench, p->unit, &request, t_ns);
    return result == BOARD_CYCLE_OK ? NULL : board_cycle_word(result);
}

static const char *name_of(void *ctx, unsigned address)
{
    const struct bus_port *p = ctx;
    return board_bus_name(type_of(p->bench, p->unit)->bus, address);
}

static bool open_bus_port(struct ports *p, struct bench *b, const struct options_bus *o, char *why, size_t cap)
{
    struct bus_port *bus = calloc(1, sizeof *bus);
    if (!bus) return why_fail(why, cap, "--bus-port %s: out of memory", o->arg);
    bus->bench = b;
    bus->unit = find_unit(b, o->unit);
    const struct board_type *type = type_of(b, bus->unit);
    const struct bus_pty_ops ops = {
        .ctx = bus, .submit = submit_cycle, .board = type->name, .addresses = type->bus->addresses, .name = name_of};
    const int err = bus_pty_open(&bus->pty, &p->links, &ops, o->link);
    if (!err) {
        p->bus[p->bus_count++] = bus;
        return true;
    }
    free(bus);
    return fail_pty(why, cap, "--bus-port ", o->arg, err);
}

static bool open_bus_ports(struct ports *p, struct bench *b, const struct options *o, char *why, size_t cap)
{
    for (unsigned i = 0; i < o->bus_count; i++)
        if (!open_bus_port(p, b, &o->bus[i], why, cap)) return false;
    return true;
}

/* A cycle under way goes on, no client waits for it. */
static void close_bus_port(struct bus_port *p)
{
    bench_cycle_forget(p->bench, p->unit);
    bus_pty_close(&p->pty);
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
    return instruments_check(&p->scpi, o, why, cap) && check_bus_ports(b, o, why, cap);
}

bool ports_open(struct ports *p, struct bench *b, const struct options *o, char *why, size_t cap)
{
    return open_can(p, o, why, cap) && open_line(p, b, o, why, cap) && open_bus_ports(p, b, o, why, cap) &&
           open_vcd(p, b, o, why, cap) && instruments_open(&p->scpi, o, why, cap) &&
           open_socket(&p->control, "control", o->control, why, cap) &&
           open_socket(&p->truth, "truth", o->truth, why, cap);
}

static void put_key(FILE *out, const char *key, const char *value)
{
    if (value) fprintf(out, " %s=%s", key, value);
}

static void put_pty(FILE *out, const struct pty *pty)
{
    put_key(out, "pty", pty->path);
    put_key(out, "link", pty->name);
}

static void ready_can(const struct ports_can *c, FILE *out)
{
    fprintf(out, "ready ");
    if (c->kind == OPTIONS_SOCKETCAND) fprintf(out, "can=socketcand host=127.0.0.1 port=%u", c->socketcand.port);
    if (c->kind == OPTIONS_SLCAN) {
        fprintf(out, "can=slcan");
        put_pty(out, &c->slcan.pty);
    }
    if (c->kind == OPTIONS_SOCKETCAN) {
        const struct can_client *client = &c->socketcan.can;
        fprintf(out, "can=socketcan channel=%s fd=%s", client->name, client->node.fd ? "true" : "false");
    }
    if (c->kind == OPTIONS_CAN_LOG) fprintf(out, "log=%s", c->log.path);
    put_key(out, "bus", c->bus);
    fprintf(out, "\n");
}

void ports_ready(const struct ports *p, const struct options *o, FILE *out)
{
    for (unsigned i = 0; i < p->can_count; i++) ready_can(p->can[i], out);
    if (p->line) {
        fprintf(out, "ready line=sampled hz=%" PRId64, o->line_hz);
        put_pty(out, &p->line->pty);
        fprintf(out, "\n");
    }
    for (unsigned i = 0; i < p->bus_count; i++) {
        const struct bus_port *b = p->bus[i];
        fprintf(out, "ready bus=pty unit=%s", b->bench->scenario.units[b->unit].name);
        put_pty(out, &b->pty.pty);
        fprintf(out, "\n");
    }
    instruments_ready(&p->scpi, out);
    if (o->vcd) fprintf(out, "ready vcd=%s\n", o->vcd);
    if (o->control) fprintf(out, "ready control=%s\n", o->control);
    if (o->truth) fprintf(out, "ready truth=%s\n", o->truth);
    fprintf(out, "ready all\n");
    fflush(out);
}

bool ports_logs_whole(struct ports *p, void (*say)(const char *text))
{
    bool whole = true;
    for (unsigned i = 0; i < p->can_count; i++) {
        char text[512];
        const int err = p->can[i]->kind == OPTIONS_CAN_LOG ? can_log_flush(&p->can[i]->log) : 0;
        if (!err) continue;
        snprintf(text, sizeof text, "--can log:%.400s: %s; it is not complete", p->can[i]->log.path, strerror(-err));
        say(text);
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
    for (unsigned i = 0; i < p->bus_count; i++) close_bus_port(p->bus[i]);
    instruments_close(&p->scpi);
    ctl_close(&p->control);
    ctl_close(&p->truth);
    for (struct link *l = p->links.first; l; l = l->next) l->gone = true;
    links_reap(&p->links);
    for (unsigned i = 0; i < p->can_count; i++) free(p->can[i]);
    for (unsigned i = 0; i < p->bus_count; i++) free(p->bus[i]);
    instruments_free(&p->scpi);
    free(p->line);
    if (p->vcd) fclose(p->vcd);
    p->can_count = p->bus_count = 0;
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
    for (unsigned i = 0; i < p->bus_count; i++) p->bus[i]->pty.pty.name = NULL;
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

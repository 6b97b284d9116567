#include "app/ports.h"

#include "app/loop.h"
#include "app/mavlink.h"
#include "base/why.h"
#include "link/own_file.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/* The loop has room for every link: listeners and their clients, ptys and their watches. */
_Static_assert(LOOP_LINKS_MAX >= OPTIONS_CAN_MAX * (SOCKETCAND_CLIENTS_MAX + 1) + OPTIONS_CAN_MAX +
                                     INSTRUMENTS_MAX * (SCPI_PORT_CLIENTS_MAX + 1) + 2 * (CTL_CLIENTS_MAX + 1) +
                                     2 * OPTIONS_BUS_MAX + 2 * OPTIONS_SERIAL_MAX +
                                     OPTIONS_LOGIC_MAX * (BEAGLE_CLIENTS_MAX + 1) +
                                     OPTIONS_MAVLINK_MAX * (MAV_PEERS_MAX + 1) + 3,
               "LOOP_LINKS_MAX");

/* ---- CAN */

static bool fail_port(char *why, size_t cap, const char *kind, unsigned port, int err)
{
    char where[64];
    snprintf(where, sizeof where, "--can %s:%u", kind, port);
    return why_port(why, cap, where, -err);
}

static bool open_socketcand(struct can_hub *hub, struct ports_can *c, const struct options_can *o, char *why,
                            size_t cap)
{
    const int err = socketcand_listen(&c->socketcand, hub, c->hubs, o->port);
    return !err || fail_port(why, cap, "socketcand", o->port, err);
}

static bool open_slcan(struct can_hub *hub, struct ports_can *c, const struct options_can *o, char *why, size_t cap)
{
    const int err = slcan_pty_open(&c->slcan, hub, o->arg);
    return !err || pty_fail_option(o->arg ? "--can slcan:" : "--can slcan", o->arg ? o->arg : "",
                                   (struct pty_error){&c->slcan.pty, err, &c->refused}, why, cap);
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
    return why_fail(why, cap, "--can socketcan:%s: expected a CAN interface, got \"%s\"", o->arg, strerror(-err));
}

static bool open_udp(struct can_hub *hub, struct ports_can *c, const struct options_can *o, char *why, size_t cap)
{
    const int err = udp_can_open(&c->udp, hub, o->arg);
    if (!err) return true;
    if (err == -ENODEV || err == -ENETUNREACH || err == -EADDRNOTAVAIL) {
        if (strchr(o->arg, ':') != strrchr(o->arg, ':'))
            return why_fail(
                why, cap,
                "--can udp:%s: expected an interface with IPv6 multicast, which lo does not have, got none; "
                "use --can udp, an IPv4 group",
                o->arg);
        return why_fail(
            why, cap,
            "--can udp:%s: expected a route for multicast, got none; as root: ip link set lo up && ip route "
            "add 239.0.0.0/8 dev lo, or run all programs in `unshare -rn` after these commands",
            o->arg);
    }
    return why_fail(why, cap, "--can udp:%s: expected a multicast group, got \"%s\"", o->arg, strerror(-err));
}

static bool open_cannelloni(struct can_hub *hub, struct ports_can *c, const struct options_can *o, char *why,
                            size_t cap)
{
    const int err = cannelloni_can_open(&c->cannelloni, hub, o->tunnel);
    return !err || fail_port(why, cap, "cannelloni", o->tunnel.own, err);
}

static bool open_log(struct can_hub *hub, struct ports_can *c, const struct options_can *o, char *why, size_t cap)
{
    long owner = 0;
    const int err = can_log_open(&c->log, hub->bus, hub->name, o->arg, hub->epoch_ns, &owner);
    return !err || own_file_fail("--can log:", o->arg, err, owner, &c->refused, why, cap);
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
    static open_fn *const open[] = {[OPTIONS_SOCKETCAND] = open_socketcand, [OPTIONS_SLCAN] = open_slcan,
                                    [OPTIONS_SOCKETCAN] = open_socketcan,   [OPTIONS_UDP] = open_udp,
                                    [OPTIONS_CANNELLONI] = open_cannelloni, [OPTIONS_CAN_LOG] = open_log};
    for (unsigned i = 0; i < o->can_count; i++) {
        struct ports_can *c = calloc(1, sizeof *c);
        if (!c) return why_fail(why, cap, "--can: out of memory");
        struct can_hub *hub = hub_of(p, o->can[i].bus);
        c->kind = o->can[i].kind;
        const bool all = c->kind == OPTIONS_SOCKETCAND && !o->can[i].bus[0];
        c->hubs = all ? p->hubs : 1;
        c->bus = p->hubs > 1 && !all ? hub->name : NULL;
        if (!open[c->kind](hub, c, &o->can[i], why, cap)) {
            p->refused = c->refused;
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
    const bool wires = b->line_wires && u->type->pair_port_lines;
    const char *const *const names = wires ? u->type->pair_port_lines : u->type->port_lines;
    const struct sampler_cfg cfg = sampler_line_port(&b->sampler.clock, names, b->line_ring);
    if (wires) line_pairs_show(&u->board->line);
    return sampler_start(&b->sampler, unit_trace(u), &cfg);
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
    b->line_wires = o->pairs;
    p->line = calloc(1, sizeof *p->line);
    const int err = p->line ? line_pty_open(p->line, &p->links, &source, name) : -ENOMEM;
    if (!err) return true;
    const struct pty pty = p->line ? p->line->pty : (struct pty){0};
    free(p->line);
    p->line = NULL;
    return pty_fail_option("--line ", o->line, (struct pty_error){&pty, err, &p->refused}, why, cap);
}

/* ---- bus ports: cycles of the parallel buses of units as lines of text */

static const struct board_type *type_of(const struct bench *b, unsigned unit)
{
    return b->scenario.units[unit].cfg.type;
}

static bool has_bus(const struct board_type *t)
{
    return t->bus != NULL;
}

static bool has_serial(const struct board_type *t)
{
    return t->serial != NULL;
}

/* An option that opens ports of units, and which boards have such a port. */
struct port_kind {
    const char *option, *name, *port; /* "--bus-port", "bus port", "parallel bus" */
    bool (*has)(const struct board_type *t);
};
static const struct port_kind bus_ports = {"--bus-port", "bus port", "parallel bus", has_bus},
                              serial_ports = {"--serial", "serial port", "serial port", has_serial};

/* The unit of that name, the first that has such a port for none; the number of units if there is none. */
static unsigned find_unit(const struct bench *b, const struct port_kind *kind, const char *name)
{
    unsigned i = 0;
    for (; i < b->scenario.unit_count; i++)
        if (name[0] ? strcmp(b->scenario.units[i].name, name) == 0 : kind->has(type_of(b, i))) break;
    return i;
}

/* Whether there are such units, their boards have such a port, and none is named twice. */
static bool check_unit_ports(const struct bench *b, const struct port_kind *k, const struct options_bus *port,
                             unsigned count, char *why, size_t cap)
{
    for (unsigned i = 0; i < count; i++) {
        const struct options_bus *p = &port[i];
        const unsigned unit = find_unit(b, k, p->unit);
        if (unit == b->scenario.unit_count && p->unit[0])
            return why_fail(why, cap, "%s %s: expected a unit of the scenario, got \"%s\"", k->option, p->arg, p->unit);
        if (unit == b->scenario.unit_count)
            return why_fail(why, cap, "%s %s: expected a scenario with a unit that has a %s", k->option, p->arg,
                            k->port);
        if (!k->has(type_of(b, unit))) {
            return why_fail(why, cap, "%s %s: expected a unit with a %s, got %s, a %s", k->option, p->arg, k->port,
                            p->unit, type_of(b, unit)->title);
        }
        for (unsigned other = 0; other < i; other++)
            if (find_unit(b, k, port[other].unit) == unit)
                return why_fail(why, cap, "%s %s: expected one %s per unit, got a second for %s", k->option, p->arg,
                                k->name, b->scenario.units[unit].name);
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
    bus->unit = find_unit(b, &bus_ports, o->unit);
    const struct board_type *type = type_of(b, bus->unit);
    const struct bus_pty_ops ops = {
        .ctx = bus, .submit = submit_cycle, .board = type->name, .addresses = type->bus->addresses, .name = name_of};
    const int err = bus_pty_open(&bus->pty, &p->links, &ops, o->link);
    if (!err) {
        p->bus[p->bus_count++] = bus;
        return true;
    }
    const struct pty pty = bus->pty.pty;
    free(bus);
    return pty_fail_option("--bus-port ", o->arg, (struct pty_error){&pty, err, &p->refused}, why, cap);
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

/* ---- serial ports of units */

/* A receiver whose messages do not fit loses some of them: said at the start. */
static void notice_unfit(struct serial_port *p)
{
    const struct board_serial *serial = p->unit->type->serial;
    char unfit[120];
    serial->unfit(p->unit->board, unfit, sizeof unfit);
    if (!unfit[0]) return;
    snprintf(p->notice, sizeof p->notice,
             "messages of %s that do not fit into the period at %u bit/s, and may be lost: %s", p->unit->cfg.name,
             serial->baud(p->unit->board), unfit);
    p->pty.pty.link.notice = p->notice;
}

static bool open_serial_port(struct ports *p, struct bench *b, const struct options_bus *o, char *why, size_t cap)
{
    struct serial_port *port = calloc(1, sizeof *port);
    if (!port) return why_fail(why, cap, "--serial %s: out of memory", o->arg);
    port->unit = &b->unit[find_unit(b, &serial_ports, o->unit)];
    const int err = serial_pty_open(&port->pty, &p->links, p->hub[0].lossless, o->link);
    if (err) {
        const struct pty pty = port->pty.pty.pty;
        free(port);
        return pty_fail_option("--serial ", o->arg, (struct pty_error){&pty, err, &p->refused}, why, cap);
    }
    port->unit->type->serial->connect(port->unit->board, serial_pty_byte, &port->pty);
    notice_unfit(port);
    p->serial[p->serial_count++] = port;
    return true;
}

static bool open_serial_ports(struct ports *p, struct bench *b, const struct options *o, char *why, size_t cap)
{
    for (unsigned i = 0; i < o->serial_count; i++)
        if (!open_serial_port(p, b, &o->serial[i], why, cap)) return false;
    return true;
}

static void close_serial_port(struct serial_port *p)
{
    p->unit->type->serial->connect(p->unit->board, NULL, NULL);
    serial_pty_close(&p->pty);
}

/* ---- sockets and file */

static bool open_socket(struct ports *p, struct ctl_server *s, const char *option, const char *path, char *why,
                        size_t cap)
{
    char where[1024];
    if (!path) return true;
    long owner = 0;
    const int err = ctl_listen(s, path, &owner);
    if (!err) return true;
    snprintf(where, sizeof where, "--%s %s", option, path);
    p->refused = err != -EADDRINUSE && !why_machine(-err);
    if (err == -EADDRINUSE)
        return why_fail(why, cap, "%s: expected a free path, got one that another process uses, pid %ld", where, owner);
    if (err == -EEXIST) return why_expected(why, cap, where, "another file", "a new path or a socket");
    if (err == -ENAMETOOLONG)
        return why_fail(why, cap, "%s: expected up to %u bytes, got %zu", where, CTL_PATH_MAX, strlen(path));
    return why_unwritable(why, cap, where, -err);
}

static bool open_mavlinks(struct ports *p, struct bench *b, const struct options *o, char *why, size_t cap)
{
    for (unsigned i = 0; i < o->mavlink_count; i++) {
        struct mavlink *m = mavlink_open(b, p->hub, o, &o->mavlink[i], &p->refused, why, cap);
        if (!m) return false;
        p->mavlink[p->mavlink_count++] = m;
    }
    return true;
}

/* --pairs and --vcd-analog add to recordings: of --vcd the unit, without it one of the bench must have what they add. */
static bool check_signals(const struct bench *b, const struct options *o, char *why, size_t cap)
{
    const unsigned first = o->vcd ? b->watched : 0, end = o->vcd ? first + 1 : b->scenario.unit_count;
    bool pairs = false, reals = false;
    for (unsigned i = first; i < end; i++) {
        pairs |= b->unit[i].type->pairs != NULL;
        reals |= unit_trace(&b->unit[i])->reals != NULL;
    }
    const char *const got = b->unit[first].type->name;
    if (o->pairs && !pairs)
        return why_fail(why, cap, "--pairs: expected a board with differential pairs (psa2, bins), got %s", got);
    return !o->vcd_analog || reals ||
           why_fail(why, cap, "--vcd-analog: expected a board with real-valued channels (pmka), got %s", got);
}

static bool open_vcd(struct ports *p, struct bench *b, const struct options *o, char *why, size_t cap)
{
    if (!o->vcd) return true;
    p->vcd = own_file_output("--vcd ", o->vcd, &p->refused, why, cap);
    if (!p->vcd) return false;
    const struct bench_recording what = {b->watched, o->pairs, o->vcd_analog, o->vcd_unit_ns, 0};
    return bench_record(b, &what, p->vcd) ||
           why_fail(why, cap, "--vcd-unit: expected a time unit of VCD, got %u", o->vcd_unit_ns);
}

void ports_init(struct ports *p, struct bench *b, const struct options *o)
{
    p->control.listen.link.fd = p->truth.listen.link.fd = -1;
    p->control.name = "control socket";
    p->truth.name = "truth port";
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
    return instruments_check(&p->scpi, o, why, cap) &&
           check_unit_ports(b, &bus_ports, o->bus, o->bus_count, why, cap) &&
           check_unit_ports(b, &serial_ports, o->serial, o->serial_count, why, cap) && logic_check(b, o, why, cap) &&
           mavlink_check(b, o, why, cap) && check_signals(b, o, why, cap);
}

bool ports_open(struct ports *p, struct bench *b, const struct options *o, char *why, size_t cap)
{
    return open_can(p, o, why, cap) && open_line(p, b, o, why, cap) && open_bus_ports(p, b, o, why, cap) &&
           open_serial_ports(p, b, o, why, cap) && logic_open(&p->logic, &p->links, b, o, why, cap) &&
           open_mavlinks(p, b, o, why, cap) && open_vcd(p, b, o, why, cap) && instruments_open(&p->scpi, o, why, cap) &&
           open_socket(p, &p->control, "control", o->control, why, cap) &&
           open_socket(p, &p->truth, "truth", o->truth, why, cap);
}

static void close_can(struct ports_can *c)
{
    if (c->kind == OPTIONS_SOCKETCAND) socketcand_close(&c->socketcand);
    if (c->kind == OPTIONS_SLCAN) slcan_pty_close(&c->slcan);
    if (c->kind == OPTIONS_SOCKETCAN) socketcan_close(&c->socketcan);
    if (c->kind == OPTIONS_UDP) udp_can_close(&c->udp);
    if (c->kind == OPTIONS_CANNELLONI) cannelloni_can_close(&c->cannelloni);
    if (c->kind == OPTIONS_CAN_LOG) can_log_close(&c->log);
}

static void close_all(struct ports *p)
{
    for (unsigned i = 0; i < p->can_count; i++) close_can(p->can[i]);
    if (p->line) line_pty_close(p->line);
    for (unsigned i = 0; i < p->bus_count; i++) close_bus_port(p->bus[i]);
    for (unsigned i = 0; i < p->serial_count; i++) close_serial_port(p->serial[i]);
    logic_close(&p->logic);
    for (unsigned i = 0; i < p->mavlink_count; i++) mavlink_close(p->mavlink[i]);
    instruments_close(&p->scpi);
    ctl_close(&p->control);
    ctl_close(&p->truth);
    for (struct link *l = p->links.first; l; l = l->next) l->gone = true;
    links_reap(&p->links);
    for (unsigned i = 0; i < p->can_count; i++) free(p->can[i]);
    for (unsigned i = 0; i < p->bus_count; i++) free(p->bus[i]);
    for (unsigned i = 0; i < p->mavlink_count; i++) mavlink_free(p->mavlink[i]);
    instruments_free(&p->scpi);
    for (unsigned i = 0; i < p->serial_count; i++) free(p->serial[i]);
    logic_free(&p->logic);
    free(p->line);
    if (p->vcd) fclose(p->vcd);
    p->can_count = p->bus_count = p->serial_count = p->mavlink_count = 0;
    p->line = NULL;
    p->vcd = NULL;
}

void ports_close(struct ports *p)
{
    close_all(p);
    *p = (struct ports){.control.listen.link.fd = -1, .truth.listen.link.fd = -1};
}

void ports_abandon(struct ports *p)
{
    for (unsigned i = 0; i < p->can_count; i++) {
        if (p->can[i]->kind == OPTIONS_SLCAN) p->can[i]->slcan.pty.name = NULL;
    }
    for (unsigned i = 0; i < p->scpi.count; i++) p->scpi.port[i]->port.pty.name = NULL;
    if (p->line) p->line->pty.name = NULL;
    for (unsigned i = 0; i < p->bus_count; i++) p->bus[i]->pty.pty.name = NULL;
    for (unsigned i = 0; i < p->serial_count; i++) p->serial[i]->pty.pty.pty.name = NULL;
    for (unsigned i = 0; i < p->mavlink_count; i++) p->mavlink[i]->port.pty.name = NULL;
    p->control.path = p->truth.path = "";
    close_all(p);
}

#include "app/bus_ports.h"

#include "base/why.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

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

bool bus_ports_check(const struct bench *b, const struct options *o, char *why, size_t cap)
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

static bool open_one(struct bus_ports *all, struct links *links, struct bench *b, const struct options_bus *o,
                     char *why, size_t cap)
{
    struct bus_port *p = calloc(1, sizeof *p);
    if (!p) return why_fail(why, cap, "--bus-port %s: out of memory", o->arg);
    p->bench = b;
    p->unit = find_unit(b, o->unit);
    const struct board_type *type = type_of(b, p->unit);
    const struct bus_pty_ops ops = {
        .ctx = p, .submit = submit_cycle, .board = type->name, .addresses = type->bus->addresses, .name = name_of};
    const int err = bus_pty_open(&p->pty, links, &ops, o->link);
    if (!err) {
        all->port[all->count++] = p;
        return true;
    }
    free(p);
    if (err == -EEXIST)
        return why_fail(why, cap, "--bus-port %s: expected a new name or a symbolic link to a pty, got another file",
                        o->arg);
    return why_fail(why, cap, "--bus-port %s: %s", o->arg, strerror(-err));
}

bool bus_ports_open(struct bus_ports *p, struct links *links, struct bench *b, const struct options *o, char *why,
                    size_t cap)
{
    for (unsigned i = 0; i < o->bus_count; i++)
        if (!open_one(p, links, b, &o->bus[i], why, cap)) return false;
    return true;
}

void bus_ports_ready(const struct bus_ports *p, FILE *out)
{
    for (unsigned i = 0; i < p->count; i++) {
        const struct bus_port *b = p->port[i];
        const struct pty *pty = &b->pty.pty;
        fprintf(out, "ready bus=pty unit=%s pty=%s%s%s\n", b->bench->scenario.units[b->unit].name, pty->path,
                pty->name ? " link=" : "", pty->name ? pty->name : "");
    }
}

void bus_ports_abandon(struct bus_ports *p)
{
    for (unsigned i = 0; i < p->count; i++) p->port[i]->pty.pty.name = NULL;
}

void bus_ports_close(struct bus_ports *p)
{
    for (unsigned i = 0; i < p->count; i++) {
        bench_cycle_forget(p->port[i]->bench, p->port[i]->unit);
        bus_pty_close(&p->port[i]->pty);
    }
}

void bus_ports_free(struct bus_ports *p)
{
    for (unsigned i = 0; i < p->count; i++) free(p->port[i]);
    p->count = 0;
}

#include "app/serial.h"

#include "app/pace.h"
#include "base/why.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct board_type *type_of(const struct bench *b, unsigned unit)
{
    return b->scenario.units[unit].cfg.type;
}

/* The unit of that name, the first that has a serial port for none; the number of units if there is none. */
static unsigned find_unit(const struct bench *b, const char *name)
{
    unsigned i = 0;
    for (; i < b->scenario.unit_count; i++)
        if (name[0] ? strcmp(b->scenario.units[i].name, name) == 0 : type_of(b, i)->serial != NULL) break;
    return i;
}

bool serial_check(const struct bench *b, const struct options *o, char *why, size_t cap)
{
    for (unsigned i = 0; i < o->serial_count; i++) {
        const struct options_bus *p = &o->serial[i];
        const unsigned unit = find_unit(b, p->unit);
        if (unit == b->scenario.unit_count && p->unit[0])
            return why_fail(why, cap, "--serial %s: expected a unit of the scenario, got \"%s\"", p->arg, p->unit);
        if (unit == b->scenario.unit_count)
            return why_fail(why, cap, "--serial %s: expected a scenario with a unit that has a serial port", p->arg);
        if (!type_of(b, unit)->serial)
            return why_fail(why, cap, "--serial %s: expected a unit with a serial port, got %s, a %s", p->arg, p->unit,
                            type_of(b, unit)->title);
        for (unsigned k = 0; k < i; k++)
            if (find_unit(b, o->serial[k].unit) == unit)
                return why_fail(why, cap, "--serial %s: expected one serial port per unit, got a second for %s", p->arg,
                                b->scenario.units[unit].name);
    }
    return true;
}

/* ---- a port: from the unit into the ring, out of it into the pseudo-terminal */

static void on_byte(void *ctx, uint8_t byte, int64_t t_ns)
{
    struct serial_port *p = ctx;
    (void)t_ns;
    if (!p->open) return;
    if (p->count == SERIAL_RING) {
        p->pty.link.notice = "its reader is too slow: bytes are lost";
        return;
    }
    p->ring[(p->first + p->count++) % SERIAL_RING] = byte;
}

static bool start_port(void *ctx, int64_t t_ns)
{
    struct serial_port *p = ctx;
    (void)t_ns;
    p->first = p->count = 0;
    return p->open = true;
}

static void stop_port(void *ctx)
{
    ((struct serial_port *)ctx)->open = false;
}

static size_t take_bytes(void *ctx, uint8_t *buf, size_t cap)
{
    struct serial_port *p = ctx;
    size_t n = 0;
    for (; n < cap && p->count; n++, p->count--) {
        buf[n] = p->ring[p->first];
        p->first = (p->first + 1) % SERIAL_RING;
    }
    return n;
}

static size_t count_waiting(void *ctx)
{
    return ((struct serial_port *)ctx)->count;
}

/* A receiver whose messages do not fit loses some of them: its user is told at the start. */
static void notice_unfit(struct serial_port *p)
{
    const struct board_serial *serial = p->unit->type->serial;
    char unfit[120];
    serial->unfit(p->unit->board, unfit, sizeof unfit);
    if (!unfit[0]) return;
    snprintf(p->notice, sizeof p->notice,
             "messages of %s that do not fit into the period at %u bit/s, and may be lost: %s", p->unit->cfg.name,
             serial->baud(p->unit->board), unfit);
    p->pty.link.notice = p->notice;
}

static bool open_port(struct serial_ports *all, struct links *links, struct bench *b, const struct options *o,
                      unsigned i, char *why, size_t cap)
{
    struct serial_port *p = calloc(1, sizeof *p);
    if (!p) return why_fail(why, cap, "--serial %s: out of memory", o->serial[i].arg);
    const size_t high = o->pace == PACE_WALL ? 0 : SERIAL_RING / 2;
    const struct line_source source = {p, start_port, stop_port, take_bytes, count_waiting, high};
    p->unit = &b->unit[find_unit(b, o->serial[i].unit)];
    const int err = line_pty_open(&p->pty, links, &source, o->serial[i].link);
    if (err) {
        char where[80];
        snprintf(where, sizeof where, "--serial %.60s", o->serial[i].arg);
        const struct pty pty = p->pty.pty;
        free(p);
        return pty_fail(&pty, where, err, why, cap);
    }
    snprintf(p->pty.link.who, sizeof p->pty.link.who, "serial port %s", p->pty.pty.path);
    p->unit->type->serial->connect(p->unit->board, on_byte, p);
    notice_unfit(p);
    all->port[all->count++] = p;
    return true;
}

bool serial_open(struct serial_ports *all, struct links *links, struct bench *b, const struct options *o, char *why,
                 size_t cap)
{
    for (unsigned i = 0; i < o->serial_count; i++)
        if (!open_port(all, links, b, o, i, why, cap)) return false;
    return true;
}

void serial_close(struct serial_ports *all)
{
    for (unsigned i = 0; i < all->count; i++) {
        struct serial_port *p = all->port[i];
        p->unit->type->serial->connect(p->unit->board, NULL, NULL);
        line_pty_close(&p->pty);
    }
}

void serial_free(struct serial_ports *all)
{
    for (unsigned i = 0; i < all->count; i++) free(all->port[i]);
    all->count = 0;
}

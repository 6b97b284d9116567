/* What there is: one object for each endpoint, also the lines of standard output. */
#include "app/ports.h"

#include "app/mavlink.h"

#include <inttypes.h>
#include <string.h>

static cJSON *add_endpoint(cJSON *all, const char *kind, const char *what)
{
    cJSON *e = cJSON_CreateObject();
    cJSON_AddStringToObject(e, kind, what);
    cJSON_AddItemToArray(all, e);
    return e;
}

static void add_key(cJSON *e, const char *key, const char *value)
{
    if (value) cJSON_AddStringToObject(e, key, value);
}

static void add_number(cJSON *e, const char *key, unsigned value)
{
    char number[12];
    snprintf(number, sizeof number, "%u", value);
    add_key(e, key, number);
}

static void add_port(cJSON *e, unsigned port)
{
    add_key(e, "host", "127.0.0.1");
    add_number(e, "port", port);
}

static void add_pty(cJSON *e, const struct pty *pty)
{
    add_key(e, "pty", pty->path);
    add_key(e, "link", pty->name);
}

static void add_can(const struct ports_can *c, cJSON *all)
{
    static const char *const kinds[] = {[OPTIONS_SOCKETCAND] = "socketcand",
                                        [OPTIONS_SLCAN] = "slcan",
                                        [OPTIONS_SOCKETCAN] = "socketcan",
                                        [OPTIONS_UDP] = "udp",
                                        [OPTIONS_CANNELLONI] = "cannelloni"};
    const bool log = c->kind == OPTIONS_CAN_LOG;
    cJSON *e = add_endpoint(all, log ? "log" : "can", log ? c->log.path : kinds[c->kind]);
    if (c->kind == OPTIONS_SOCKETCAND) add_port(e, c->socketcand.port);
    if (c->kind == OPTIONS_SLCAN) add_pty(e, &c->slcan.pty);
    if (c->kind == OPTIONS_SOCKETCAN) {
        add_key(e, "channel", c->socketcan.can.name);
        add_key(e, "fd", c->socketcan.can.node.fd ? "true" : "false");
    }
    if (c->kind == OPTIONS_UDP) {
        add_key(e, "group", c->udp.group);
        add_number(e, "port", c->udp.port);
    }
    if (c->kind == OPTIONS_CANNELLONI) {
        add_port(e, c->cannelloni.ports.own);
        add_number(e, "peer_port", c->cannelloni.ports.peer);
    }
    add_key(e, "bus", c->bus);
}

static void add_line(const struct ports *p, const struct options *o, cJSON *all)
{
    char hz[24];
    if (!p->line) return;
    cJSON *e = add_endpoint(all, "line", "sampled");
    snprintf(hz, sizeof hz, "%" PRId64, o->line_hz);
    add_key(e, "hz", hz);
    add_pty(e, &p->line->pty);
}

static void add_serial(const struct serial_port *p, cJSON *all)
{
    cJSON *e = add_endpoint(all, "serial", "8n1");
    add_key(e, "unit", p->unit->cfg.name);
    add_number(e, "baud", p->unit->type->serial->baud(p->unit->board));
    add_pty(e, &p->pty.pty.pty);
}

static void add_logic(const struct logic_port *p, cJSON *all)
{
    cJSON *e = add_endpoint(all, "logic", "beaglelogic");
    add_port(e, p->server.port);
    add_key(e, "lines", p->names);
}

static void add_mavlink(const struct mavlink *m, cJSON *all)
{
    cJSON *e = add_endpoint(all, "mavlink", mavlink_kind_name(m->port.kind));
    if (m->port.kind == MAV_PTY) add_pty(e, &m->port.pty);
    else add_port(e, m->port.port);
    add_key(e, "unit", m->unit->cfg.name);
}

static void add_instrument(const struct instrument *i, cJSON *all)
{
    cJSON *e = add_endpoint(all, "scpi", i->kind->name);
    if (i->port.terminal) add_pty(e, &i->port.pty);
    else add_port(e, i->port.port);
}

cJSON *ports_endpoints(const struct ports *p, const struct options *o)
{
    cJSON *all = cJSON_CreateArray();
    for (unsigned i = 0; i < p->can_count; i++) add_can(p->can[i], all);
    add_line(p, o, all);
    for (unsigned i = 0; i < p->bus_count; i++) {
        const struct bus_port *b = p->bus[i];
        cJSON *e = add_endpoint(all, "bus", "pty");
        add_key(e, "unit", b->bench->scenario.units[b->unit].name);
        add_pty(e, &b->pty.pty);
    }
    for (unsigned i = 0; i < p->serial_count; i++) add_serial(p->serial[i], all);
    for (unsigned i = 0; i < p->logic.count; i++) add_logic(p->logic.port[i], all);
    for (unsigned i = 0; i < p->mavlink_count; i++) add_mavlink(p->mavlink[i], all);
    for (unsigned k = 0; k < p->scpi.count; k++) add_instrument(p->scpi.port[k], all);
    if (o->lcm) add_endpoint(all, "lcm", o->lcm);
    if (o->vcd) add_endpoint(all, "vcd", o->vcd);
    if (o->control) add_endpoint(all, "control", o->control);
    if (o->truth) add_endpoint(all, "truth", o->truth);
    return all;
}

/* As it is, or as a string of JSON where a space, a quote or a control character would end it early. */
static void put_value(const cJSON *value, FILE *out)
{
    const char *text = value->valuestring;
    bool plain = *text != '\0';
    for (const char *c = text; *c; c++) plain &= (unsigned char)*c > ' ' && *c != '"' && *c != '\\';
    char *quoted = plain ? NULL : cJSON_PrintUnformatted(value);
    fputs(quoted ? quoted : text, out);
    cJSON_free(quoted);
}

bool ports_ready(const struct ports *p, const struct options *o, FILE *out)
{
    cJSON *all = ports_endpoints(p, o);
    const cJSON *e, *value;
    cJSON_ArrayForEach(e, all)
    {
        fprintf(out, "ready");
        cJSON_ArrayForEach(value, e)
        {
            fprintf(out, " %s=", value->string);
            put_value(value, out);
        }
        fprintf(out, "\n");
    }
    fprintf(out, "ready all\n");
    cJSON_Delete(all);
    return fflush(out) == 0 && !ferror(out);
}

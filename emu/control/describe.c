#include "control/describe.h"

#include "command/args.h"

#include <string.h>

/* ---- commands */

void describe_arg(const struct control_arg *a, bool optional, cJSON *list)
{
    cJSON *j = add_object(list);
    cJSON_AddStringToObject(j, "name", a->name);
    cJSON_AddStringToObject(j, "type", control_type_name(a->type));
    cJSON_AddBoolToObject(j, "optional", optional);
    if (control_type_numeric(a->type)) {
        add_real(j, "min", a->min);
        add_real(j, "max", a->max);
        if (a->least > 0.0) add_real(j, "least", a->least);
    }
    if (a->unit) cJSON_AddStringToObject(j, "unit", a->unit);
    const char *word = control_choice(a, 0);
    cJSON *choices = word ? cJSON_AddArrayToObject(j, "choices") : NULL;
    for (unsigned i = 1; word; word = control_choice(a, i++)) cJSON_AddItemToArray(choices, cJSON_CreateString(word));
    cJSON_AddStringToObject(j, "what", a->what);
}

void describe_rows(const struct control_table *const *tables, cJSON *list)
{
    const struct control_command *row;
    for (unsigned i = 0; (row = control_row(tables, i)); i++) {
        cJSON *j = add_object(list);
        cJSON_AddStringToObject(j, "name", row->name);
        cJSON_AddStringToObject(j, "what", row->what);
        cJSON *args = cJSON_AddArrayToObject(j, "args");
        for (unsigned k = 0; k < control_arg_count(row); k++) describe_arg(&row->arg[k], row->arg[k].optional, args);
        cJSON *scpi = row->scpi[0].header ? cJSON_AddArrayToObject(j, "scpi") : NULL;
        for (unsigned k = 0; k < CONTROL_SCPI_MAX && row->scpi[k].header; k++) {
            cJSON_AddItemToArray(scpi, cJSON_CreateString(row->scpi[k].header));
        }
    }
}

enum control_outcome describe_commands(const struct control_call *call)
{
    describe_rows(call->control->tables, cJSON_AddArrayToObject(call->result, "commands"));
    return CONTROL_DONE;
}

/* ---- traffic */

static void add_client(const struct control_client *k, cJSON *to)
{
    add_count(to, "delivered", k->delivered);
    add_count(to, "taken", k->taken);
    add_count(to, "dropped", k->dropped);
    add_count(to, "overrun", k->overrun);
    add_count(to, "refused", k->refused);
}

void describe_clients(const struct control_bench *b, cJSON *to)
{
    struct control_client k;
    cJSON *list = cJSON_AddArrayToObject(to, "clients");
    for (unsigned i = 0; b->clients.nth(b->ctx, i, &k); i++) {
        cJSON *j = add_object(list);
        cJSON_AddStringToObject(j, "adapter", k.adapter);
        cJSON_AddStringToObject(j, "name", k.name);
        add_count(j, "came", k.connection);
        add_client(&k, j);
    }
    b->clients.gone(b->ctx, &k);
    add_client(&k, cJSON_AddObjectToObject(to, "gone"));
}

void describe_pace(const struct control_bench *b, cJSON *to)
{
    struct control_pace p = {0};
    b->sim.pace(b->ctx, &p);
    cJSON *j = cJSON_AddObjectToObject(to, "pace");
    cJSON_AddStringToObject(j, "name", p.name);
    add_count(j, "turns", p.turns);
    add_count(j, "late", p.late);
    add_count(j, "slips", p.slips);
    add_real(j, "p50_us", p.p50_us);
    add_real(j, "p99_us", p.p99_us);
    add_real(j, "p999_us", p.p999_us);
    add_real(j, "max_us", p.max_us);
    add_count(j, "frames", p.frames);
    add_real(j, "frame_p50_us", p.frame_p50_us);
    add_real(j, "frame_p99_us", p.frame_p99_us);
    add_real(j, "frame_p999_us", p.frame_p999_us);
    add_real(j, "frame_max_us", p.frame_max_us);
}

static void add_bus(const struct can_bus *bus, cJSON *j, int64_t t_ns)
{
    const int64_t busy_ns = can_busy_ns(bus, t_ns);
    add_count(j, "bitrate_hz", bus->cfg.bitrate_hz);
    add_count(j, "data_bitrate_hz", bus->cfg.data_bitrate_hz);
    add_count(j, "frames", bus->frames);
    add_real(j, "load", t_ns > 0 ? (double)busy_ns / (double)t_ns : 0.0);
}

void describe_bus(const struct control_bench *b, cJSON *to, int64_t t_ns)
{
    add_bus(b->bus[0], cJSON_AddObjectToObject(to, "bus"), t_ns);
    if (b->buses < 2) return;
    cJSON *list = cJSON_AddArrayToObject(to, "buses");
    for (unsigned i = 0; i < b->buses; i++) {
        add_bus(b->bus[i], add_object(list), t_ns);
    }
}

/* ---- units */

static void add_bus_name(const struct control_bench *b, const struct can_node *node, cJSON *to)
{
    for (unsigned i = 0; node && i < b->buses; i++) {
        if (b->bus[i] == node->bus && b->bus_name[i]) cJSON_AddStringToObject(to, "bus", b->bus_name[i]);
    }
}

enum control_outcome describe_units(const struct control_call *call)
{
    const struct control_bench *b = call->bench;
    cJSON *list = cJSON_AddArrayToObject(call->result, "units");
    for (unsigned i = 0; i < b->units; i++) {
        const struct unit *u = b->unit[i];
        cJSON *j = add_object(list);
        cJSON_AddStringToObject(j, "name", u->cfg.name);
        cJSON_AddStringToObject(j, "board", u->type->name);
        add_count(j, "serial", u->cfg.board.serial);
        add_count(j, "node", u->cfg.node);
        add_bus_name(b, b->node[i], j);
        cJSON_AddStringToObject(j, "profile", u->profile);
        cJSON_AddStringToObject(j, "on", unit_mounts[u->cfg.mounting.on]);
        cJSON_AddBoolToObject(j, "ready", u->type->ready(u->board));
        const char *why = unit_why_eager(b->unit[i], call->t_ns);
        cJSON_AddItemToObject(j, "eager", why ? cJSON_CreateString(why) : cJSON_CreateNull());
    }
    return CONTROL_DONE;
}

static void add_counters(const struct board_part *p, const struct board *board, cJSON *to)
{
    for (unsigned i = 0; i < p->counter_count; i++) {
        uint32_t n;
        memcpy(&n, (const char *)board + p->offset + p->counters[i].offset, sizeof n);
        add_count(to, p->counters[i].name, n);
    }
}

static void add_node(const struct can_node *n, cJSON *to)
{
    add_count(to, "tx_frames", n->tx_frames);
    add_count(to, "rx_frames", n->rx_frames);
    add_count(to, "tx_overflow", n->tx_overflow);
    add_count(to, "fd_refused", n->fd_refused);
}

void describe_unit_counters(const struct control_bench *b, unsigned unit, cJSON *to)
{
    const struct unit *u = b->unit[unit];
    const struct trace *t = unit_trace(b->unit[unit]);
    for (unsigned i = 0; i < u->type->part_count; i++) {
        const struct board_part *p = &u->type->parts[i];
        add_counters(p, u->board, cJSON_AddObjectToObject(to, p->label));
    }
    if (b->node[unit]) add_node(b->node[unit], cJSON_AddObjectToObject(to, "can"));
    cJSON *trace = cJSON_AddObjectToObject(to, "trace");
    add_count(trace, "late", t->late);
    add_count(trace, "dropped", t->dropped);
}

/* ---- at a glance */

void describe_status(const struct control_bench *b, cJSON *to, int64_t t_ns)
{
    struct control_pace p = {0};
    uint64_t frames = 0;
    b->sim.pace(b->ctx, &p);
    for (unsigned i = 0; i < b->buses; i++) frames += b->bus[i]->frames;
    cJSON_AddStringToObject(to, "pace", p.name);
    add_count(to, "frames", frames);
    add_count(to, "late", p.late);
    add_real(to, "head_deg", head_read_deg(&b->lab->head, t_ns));
    if (b->lab->table.cfg.axes) {
        const struct table_reading r = table_read(&b->lab->table, 0, t_ns);
        add_real(to, "angle_deg", r.angle_deg);
        add_real(to, "rate_dps", r.rate_dps);
    }
    if (b->lab->chamber.cfg.present) add_real(to, "temp_degc", chamber_shown_degc(&b->lab->chamber, t_ns));
    if (b->lab->supply.cfg.present) add_real(to, "supply_v", supply_shown_v(&b->lab->supply, t_ns));
}

#include "control/describe.h"

#include "control/args.h"

#include <stddef.h>
#include <string.h>

static void add_count(cJSON *to, const char *name, uint64_t n)
{
    cJSON_AddNumberToObject(to, name, (double)n);
}

static void add_real(cJSON *to, const char *name, double v)
{
    cJSON_AddNumberToObject(to, name, v);
}

/* ---- commands */

static void describe_arg(const struct control_arg *a, cJSON *list)
{
    cJSON *j = cJSON_CreateObject();
    cJSON_AddStringToObject(j, "name", a->name);
    cJSON_AddStringToObject(j, "type", control_type_name(a->type));
    cJSON_AddBoolToObject(j, "optional", a->optional);
    if (control_type_numeric(a->type)) {
        add_real(j, "min", a->min);
        add_real(j, "max", a->max);
        if (a->least > 0.0) add_real(j, "least", a->least);
    }
    if (a->unit) cJSON_AddStringToObject(j, "unit", a->unit);
    cJSON *choices = a->choices ? cJSON_AddArrayToObject(j, "choices") : NULL;
    for (unsigned i = 0; choices && a->choices[i]; i++) {
        cJSON_AddItemToArray(choices, cJSON_CreateString(a->choices[i]));
    }
    cJSON_AddStringToObject(j, "what", a->what);
    cJSON_AddItemToArray(list, j);
}

void describe_commands(const struct control *c, cJSON *to)
{
    cJSON *list = cJSON_AddArrayToObject(to, "commands");
    const struct control_command *row;
    for (unsigned i = 0; (row = control_row(c->tables, i)); i++) {
        cJSON *j = cJSON_CreateObject();
        cJSON_AddStringToObject(j, "name", row->name);
        cJSON_AddStringToObject(j, "what", row->what);
        cJSON *args = cJSON_AddArrayToObject(j, "args");
        for (unsigned k = 0; k < control_arg_count(row); k++) describe_arg(&row->arg[k], args);
        cJSON *scpi = row->scpi[0].header ? cJSON_AddArrayToObject(j, "scpi") : NULL;
        for (unsigned k = 0; k < CONTROL_SCPI_MAX && row->scpi[k].header; k++) {
            cJSON_AddItemToArray(scpi, cJSON_CreateString(row->scpi[k].header));
        }
        cJSON_AddItemToArray(list, j);
    }
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
    for (unsigned i = 0; b->client(b->ctx, i, &k); i++) {
        cJSON *j = cJSON_CreateObject();
        cJSON_AddStringToObject(j, "adapter", k.adapter);
        cJSON_AddStringToObject(j, "name", k.name);
        add_count(j, "came", k.came);
        add_client(&k, j);
        cJSON_AddItemToArray(list, j);
    }
    b->gone(b->ctx, &k);
    add_client(&k, cJSON_AddObjectToObject(to, "gone"));
}

void describe_pace(const struct control_bench *b, cJSON *to)
{
    struct control_pace p = {0};
    b->pace(b->ctx, &p);
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
        cJSON *j = cJSON_CreateObject();
        add_bus(b->bus[i], j, t_ns);
        cJSON_AddItemToArray(list, j);
    }
}

/* ---- units */

static void add_bus_name(const struct control_bench *b, const struct can_node *node, cJSON *to)
{
    for (unsigned i = 0; node && i < b->buses; i++) {
        if (b->bus[i] == node->bus && b->bus_name[i]) cJSON_AddStringToObject(to, "bus", b->bus_name[i]);
    }
}

void describe_units(const struct control_bench *b, cJSON *to)
{
    cJSON *list = cJSON_AddArrayToObject(to, "units");
    for (unsigned i = 0; i < b->units; i++) {
        const struct unit *u = b->unit[i];
        cJSON *j = cJSON_CreateObject();
        cJSON_AddStringToObject(j, "name", u->cfg.name);
        add_count(j, "serial", u->cfg.board.serial);
        add_count(j, "node", u->cfg.node);
        add_bus_name(b, b->node[i], j);
        cJSON_AddStringToObject(j, "profile", u->profile);
        cJSON_AddBoolToObject(j, "ready", u->type->ready(u->board));
        cJSON_AddItemToArray(list, j);
    }
}

/* A counter by name: each is a uint32_t somewhere in a struct. */
struct counter {
    const char *name;
    size_t offset;
};

#define COUNTER(type, field)                                                                                           \
    {                                                                                                                  \
#field, offsetof(struct type, field)                                                                           \
    }

// clang-format off
static const struct counter ads1282_counters[] = {
#define N(field) COUNTER(ads1282_counters, field)
    N(conversions), N(overruns), N(torn_reads), N(late_reads), N(bad_opcodes), N(refused), N(gap_violations), N(restarts),
    N(clipped), N(realigned), N(calibrations),
#undef N
};

static const struct counter ads1256_counters[] = {
#define N(field) COUNTER(ads1256_counters, field)
    N(conversions), N(overruns), N(torn_reads), N(window_reads), N(clipped), N(buffer_clipped), N(range_exceeded), N(bad_mux),
    N(calibrations), N(cal_clamped), N(restarts), N(power_downs), N(bad_opcodes), N(refused), N(bad_drate), N(gap_violations),
    N(dropped),
#undef N
};

static const struct counter reg_counters[] = {
    {"bad_register",    offsetof(struct reg_file, bad_access)},
    {"unmodelled_bit",  offsetof(struct reg_file, unimp_access)},
    {"read_only_write", offsetof(struct reg_file, ro_write)},
};

static const struct counter board_counters[] = {
#define N(field) COUNTER(psa2_counters, field)
    N(frames), N(resets), N(requests), N(timeouts), N(overruns), N(int_late),
#undef N
};
// clang-format on

static void add_counters(const struct counter *row, size_t rows, const void *of, cJSON *to)
{
    for (; rows > 0; rows--, row++) {
        uint32_t n;
        memcpy(&n, (const char *)of + row->offset, sizeof n);
        add_count(to, row->name, n);
    }
}

#define ADD_COUNTERS(table, of, to) add_counters(table, sizeof(table) / sizeof *(table), of, to)

static void add_node(const struct can_node *n, cJSON *to)
{
    add_count(to, "tx_frames", n->tx_frames);
    add_count(to, "rx_frames", n->rx_frames);
    add_count(to, "tx_overflow", n->tx_overflow);
    add_count(to, "fd_refused", n->fd_refused);
}

void describe_unit_counters(const struct control_bench *b, unsigned unit, cJSON *to)
{
    static const char *const adc[] = {"adc_x", "adc_y", "adc_z"};
    const struct psa2 *p = b->unit[unit]->board;
    ADD_COUNTERS(board_counters, &p->counters, cJSON_AddObjectToObject(to, "board"));
    for (unsigned i = 0; i < 3; i++) {
        cJSON *j = cJSON_AddObjectToObject(to, adc[i]);
        ADD_COUNTERS(ads1282_counters, &p->adc[i].count, j);
        ADD_COUNTERS(reg_counters, &p->adc[i].regs, j);
    }
    cJSON *temp = cJSON_AddObjectToObject(to, "adc_temp");
    ADD_COUNTERS(ads1256_counters, &p->tadc.n, temp);
    ADD_COUNTERS(reg_counters, &p->tadc.regs, temp);
    if (b->node[unit]) add_node(b->node[unit], cJSON_AddObjectToObject(to, "can"));
    cJSON *trace = cJSON_AddObjectToObject(to, "trace");
    add_count(trace, "late", p->trace.late);
    add_count(trace, "dropped", p->trace.dropped);
}

/* ---- at a glance */

void describe_status(const struct control_bench *b, cJSON *to, int64_t t_ns)
{
    struct control_pace p = {0};
    uint64_t frames = 0;
    b->pace(b->ctx, &p);
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

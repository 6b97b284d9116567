#include "app/mavlink.h"

#include "base/why.h"
#include "board/psa2/psa2.h"
#include "canopen/co_node.h"
#include "gen/parameter_names.h"
#include "gen/psa2_od.h"
#include "phys/motion/vehicle.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double deg_of_rad = 57.295779513082320877;

/* ---- what the station asks for */

static void on_readouts(void *ctx, struct mav_readouts *out, int64_t t_ns)
{
    const struct mavlink *m = ctx;
    const struct lab *l = &m->bench->lab;
    out->axes = l->table.cfg.axes;
    for (unsigned i = 0; i < out->axes && i < 3; i++) {
        const struct table_reading r = table_read(&l->table, i, t_ns);
        out->table_deg[i] = r.angle_deg;
        out->table_dps[i] = r.rate_dps;
    }
    out->head = true;
    out->head_deg = head_read_deg(&l->head, t_ns);
}

static void put_aircraft(const struct flight_state *s, struct mav_world *out)
{
    out->latitude_deg = s->lat_rad * deg_of_rad;
    out->longitude_deg = s->lon_rad * deg_of_rad;
    out->height_m = s->h_m;
    out->east_mps = s->v_enu_mps[0];
    out->north_mps = s->v_enu_mps[1];
    out->down_mps = -s->v_enu_mps[2];
}

static void on_world(void *ctx, struct mav_world *out, int64_t t_ns)
{
    const struct mavlink *m = ctx;
    struct lab *l = &m->bench->lab;
    const double origin_m[3] = {0};
    struct kinematics k;
    lab_kinematics(l, &m->unit->cfg.mounting, origin_m, t_ns, &k);
    memcpy(out->gyro_radps, k.w_radps, sizeof out->gyro_radps);
    out->latitude_deg = l->site.latitude_rad * deg_of_rad;
    out->longitude_deg = l->site.longitude_rad * deg_of_rad;
    out->height_m = l->site.height_m;
    if (m->unit->cfg.mounting.on == LAB_FLIGHT) put_aircraft(lab_aircraft(l, t_ns), out);
    if (m->unit->cfg.mounting.on != LAB_PLATFORM) return;
    struct vehicle_state v;
    vehicle_at(&l->platform.vehicle, t_ns, &v);
    out->latitude_deg = v.latitude_rad * deg_of_rad;
    out->north_mps = v.speed_mps * cos(v.heading_rad);
    out->east_mps = v.speed_mps * sin(v.heading_rad);
}

/* ---- parameters of the bench, all to be read only */

enum { NODE, BUS_HZ, DATA_HZ, HEAD_DEG, TABLE_AXES, TABLE_1_DEG, TABLE_2_DEG, TABLE_3_DEG, BENCH_PARAMS };

static const char *const bench_names[BENCH_PARAMS] = {
    [NODE] = "UNIT_NODE",          [BUS_HZ] = "BUS_BITRATE_HZ",  [DATA_HZ] = "BUS_DATA_HZ",
    [HEAD_DEG] = "HEAD_DEG",       [TABLE_AXES] = "TABLE_AXES",  [TABLE_1_DEG] = "TABLE_1_DEG",
    [TABLE_2_DEG] = "TABLE_2_DEG", [TABLE_3_DEG] = "TABLE_3_DEG"};

static double on_value(void *ctx, unsigned which, int64_t t_ns)
{
    const struct mavlink *m = ctx;
    const struct can_bus_cfg *bus = &m->port.station.sdo.hub->bus->cfg;
    struct mav_readouts r = {0};
    on_readouts(ctx, &r, t_ns);
    switch (which) {
    case NODE:
        return m->unit->cfg.node;
    case BUS_HZ:
        return bus->bitrate_hz;
    case DATA_HZ:
        return bus->data_bitrate_hz;
    case HEAD_DEG:
        return r.head_deg;
    case TABLE_AXES:
        return r.axes;
    default:
        return which < BENCH_PARAMS ? r.table_deg[which - TABLE_1_DEG] : 0;
    }
}

static struct mav_param bench_param(unsigned which)
{
    struct mav_param p = {.bytes = 4, .code = MAV_CODE_REAL, .index = (uint16_t)which};
    snprintf(p.name, sizeof p.name, "%s", bench_names[which]);
    return p;
}

/* ---- parameters of the unit: its objects that are numbers */

static enum mav_param_code code_of(uint8_t type)
{
    switch (type) {
    case CO_REAL32:
        return MAV_CODE_REAL;
    case CO_INTEGER8:
    case CO_INTEGER16:
    case CO_INTEGER24:
    case CO_INTEGER32:
        return MAV_CODE_SIGNED;
    default:
        return MAV_CODE_UNSIGNED;
    }
}

static struct mav_param object_param(const struct co_entry *e, const char *name)
{
    struct mav_param p = {.object = true,
                          .writable = e->access == CO_RW,
                          .index = e->index,
                          .sub = e->sub,
                          .bytes = (uint8_t)co_type_size(e->type),
                          .code = (uint8_t)code_of(e->type),
                          .low = e->low,
                          .high = e->high};
    snprintf(p.name, sizeof p.name, "%s", name);
    return p;
}

static const char *const *names_of(const struct co_od *od)
{
    unsigned i = 0;
    while (i < PARAMETER_NAMES && parameter_names[i].od != od) i++;
    return i < PARAMETER_NAMES ? parameter_names[i].name : NULL;
}

static const struct co_node *node_of(const struct unit *u)
{
    return u->type->can->node(u->can);
}

static unsigned make_params(struct mavlink *m)
{
    const struct co_od *od = node_of(m->unit)->cfg.od;
    const char *const *name = names_of(od);
    m->params = calloc(MAV_OWN_PARAMS + BENCH_PARAMS + od->count, sizeof *m->params);
    if (!m->params) return 0;
    unsigned n = MAV_OWN_PARAMS;
    memcpy(m->params, mav_own_params, sizeof mav_own_params);
    for (unsigned i = 0; i < BENCH_PARAMS; i++) m->params[n++] = bench_param(i);
    for (unsigned i = 0; name && i < od->count; i++)
        if (name[i]) m->params[n++] = object_param(&od->entry[i], name[i]);
    return n;
}

/* ---- the unit's frames */

/* PSABENCH_STATUS of the dialect has the board's bits. */
_Static_assert((int)PSABENCH_STATUS_SETTLED == (int)PSA2_ST_SETTLED && (int)PSABENCH_STATUS_CLIP == (int)PSA2_ST_CLIP &&
                   (int)PSABENCH_STATUS_OVERRUN == (int)PSA2_ST_OVERRUN &&
                   (int)PSABENCH_STATUS_TEMP_NEW == (int)PSA2_ST_TEMP_NEW,
               "PSABENCH_STATUS");

struct mav_reading mavlink_reading(const struct psa2_reading *r)
{
    struct mav_reading out = {.t_ns = r->t_ns,
                              .lost = r->lost,
                              .temp_code = r->temp_code,
                              .temp_channel = r->temp_channel < 0 ? 0 : (uint8_t)r->temp_channel,
                              .status = r->status};
    memcpy(out.code, r->code, sizeof out.code);
    memcpy(out.volts, r->volts, sizeof out.volts);
    return out;
}

static void on_frame(void *ctx, const struct can_msg *frame, int64_t t_ns)
{
    struct mavlink *m = ctx;
    struct psa2_reading r[PSA2_READINGS_MAX];
    mav_station_frame(&m->port.station, frame, t_ns);
    const unsigned n = m->decodes ? psa2_reading_take(&m->psa2, frame, t_ns, r) : 0;
    for (unsigned i = 0; i < n; i++) {
        const struct mav_reading out = mavlink_reading(&r[i]);
        mav_station_reading(&m->port.station, &out);
    }
}

/* What the unit has now: a host may have written it before this link was opened (--restore). */
static double held_value(const struct unit *u, uint16_t index, uint8_t sub, int64_t t_ns)
{
    const struct co_node *n = node_of(u);
    struct co_value v = {0};
    uint32_t abort = 0;
    const struct co_entry *e = co_find(n->cfg.od, index, sub, &abort);
    return e && n->io.read(n->io.ctx, e, &v, t_ns) == CO_OK ? v.number : 0;
}

static void set_scale(struct mavlink *m, struct mav_cfg *c, int64_t t_ns)
{
    for (uint8_t k = 0; k < 3; k++) {
        c->zero_v[k] = m->decodes ? held_value(m->unit, PSA2_OD_ZERO_V, (uint8_t)(k + 1), t_ns) : 0;
        c->scale_v_per_g[k] = m->decodes ? held_value(m->unit, PSA2_OD_SCALE_V_PER_G, (uint8_t)(k + 1), t_ns) : 1;
    }
    c->zero_index = m->decodes ? PSA2_OD_ZERO_V : 0;
    c->scale_index = m->decodes ? PSA2_OD_SCALE_V_PER_G : 0;
}

static void open_station(struct mavlink *m, const struct options *o, unsigned params)
{
    const struct mav_options *a = m->o;
    const struct mav_io io = {.ctx = m,
                              .send = mav_port_send,
                              .readouts = on_readouts,
                              .world = a->hil_hz > 0 ? on_world : NULL,
                              .value = on_value};
    struct mav_cfg cfg = {.sysid = a->sysid,
                          .compid = a->compid,
                          .autopilot = a->autopilot,
                          .type = MAV_TYPE_GENERIC,
                          .imu_hz = a->imu_hz,
                          .angles_hz = a->angles_hz,
                          .hil_hz = a->hil_hz,
                          .epoch_ns = o->epoch_ns,
                          .params = m->params,
                          .param_count = params};
    set_scale(m, &cfg, m->bench->sched.now_ns);
    mav_station_open(&m->port.station, &cfg, &io, &m->bench->sched);
}

/* ---- */

const char *mavlink_kind_name(enum mav_port_kind kind)
{
    static const char *const names[] = {
        [MAV_UDP_OUT] = "udp", [MAV_UDP_IN] = "udpin", [MAV_TCP] = "tcp", [MAV_PTY] = "pty"};
    return names[kind];
}

/* The unit of that name, the first for none; -1: there is no such unit. */
static int find_unit(const struct bench *b, const char *name)
{
    return name[0] ? bench_find_unit(&b->scenario, name) : 0;
}

bool mavlink_check(const struct bench *b, const struct options *o, char *why, size_t cap)
{
    for (unsigned i = 0; i < o->mavlink_count; i++) {
        const struct mav_options *m = &o->mavlink[i];
        const int unit = find_unit(b, m->unit);
        if (unit < 0 || (unsigned)unit >= b->scenario.unit_count)
            return why_fail(why, cap, "--mavlink %s: expected a unit of the scenario, got \"%s\"", m->arg, m->unit);
    }
    return true;
}

static bool fail_open(const struct mavlink *m, int err, bool *user, char *why, size_t cap)
{
    char where[512];
    snprintf(where, sizeof where, "--mavlink %s", m->o->arg);
    if (m->o->kind != MAV_PTY) return why_port(why, cap, where, -err);
    return pty_fail(&m->port.pty, where, err, user, why, cap);
}

struct mavlink *mavlink_open(struct bench *b, struct can_hub *hubs, const struct options *o,
                             const struct mav_options *a, bool *refused, char *why, size_t cap)
{
    struct mavlink *m = calloc(1, sizeof *m);
    const unsigned unit = (unsigned)find_unit(b, a->unit);
    if (m) *m = (struct mavlink){.bench = b, .unit = &b->unit[unit], .o = a};
    const unsigned params = m ? make_params(m) : 0;
    if (!params) {
        why_fail(why, cap, "--mavlink: out of memory");
        free(m);
        return NULL;
    }
    struct can_hub *hub = &hubs[b->scenario.units[unit].bus];
    m->decodes = node_of(m->unit)->cfg.od == &psa2_od;
    m->psa2.node = m->unit->cfg.node;
    m->port.kind = a->kind;
    m->port.port = a->port;
    m->port.links = hub->links;
    m->port.lossless = hub->lossless;
    m->port.station.sdo.hub = hub;
    m->port.station.sdo.node = m->unit->cfg.node;
    open_station(m, o, params);
    const int err = mav_port_open(&m->port, a->link[0] ? a->link : NULL);
    if (err) {
        fail_open(m, err, refused, why, cap);
        mav_station_close(&m->port.station);
        mavlink_free(m);
        return NULL;
    }
    m->ear = (struct can_node){.name = "mavlink", .fd = true, .rx = on_frame, .ctx = m};
    can_attach(hub->bus, &m->ear);
    return m;
}

void mavlink_print_counters(const struct mavlink *m, FILE *out)
{
    const struct mav_station *s = &m->port.station;
    fprintf(out,
            "psa-emu: mavlink %s: readings %u, lost by the board %u; messages sent %u, lost %u, received %u, "
            "malformed %u, of strangers %u; parameters rejected %u\n",
            mavlink_kind_name(m->port.kind), s->counters.readings, s->counters.readings_lost, s->counters.sent, s->lost,
            s->received, s->malformed, m->port.strangers, s->counters.params_refused);
}

void mavlink_close(struct mavlink *m)
{
    can_detach(m->ear.bus, &m->ear);
    mav_port_close(&m->port);
}

void mavlink_free(struct mavlink *m)
{
    free(m->params);
    free(m);
}

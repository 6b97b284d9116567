/* The kinds of instruments: whose rows they speak, when they are at rest, what they have to report. */
#include "scpi/scpi.h"

#include <string.h>

#define FAR_S 4e9 /* with as much before it the nanoseconds still fit an int64_t */

/* ---- dividing head */

static int64_t head_over_ns(const struct control_bench *b)
{
    return head_rest_ns(&b->lab->head);
}

static uint16_t head_operation(const struct control_bench *b, int64_t t_ns)
{
    return head_at_rest(&b->lab->head, t_ns) ? 0 : SCPI_OPER_SETTLING;
}

/* ---- rate table */

/* A rate and a sine never end: they are over, for *OPC?, when the axis has reached them. */
static int64_t axis_over_ns(const struct motion *m)
{
    const struct motion_plan *p = &m->plan[m->latest];
    if (p->ends) return motion_rest_ns(m);
    const double over_s = p->piece[p->count - 1].t_s;
    return over_s < FAR_S ? p->start_ns + (int64_t)(over_s * 1e9) + 1 : INT64_MAX;
}

static int64_t table_over_ns(const struct control_bench *b)
{
    int64_t over_ns = 0;
    for (unsigned i = 0; i < b->lab->table.cfg.axes; i++) {
        const int64_t ns = axis_over_ns(&b->lab->table.axis[i]);
        if (ns > over_ns) over_ns = ns;
    }
    return over_ns;
}

static uint16_t table_operation(const struct control_bench *b, int64_t t_ns)
{
    unsigned bits = table_over_ns(b) > t_ns ? SCPI_OPER_SETTLING : 0;
    for (unsigned i = 0; i < b->lab->table.cfg.axes; i++) {
        const struct motion *m = &b->lab->table.axis[i];
        const enum motion_mode mode = motion_mode(m);
        if ((mode == MOTION_SINE || mode == MOTION_PROFILE) && !motion_at_rest(m, t_ns)) bits |= SCPI_OPER_SWEEPING;
    }
    return (uint16_t)bits;
}

/* ---- thermal chamber */

static int64_t chamber_over_ns(const struct control_bench *b)
{
    return chamber_stable_ns(&b->lab->chamber);
}

static uint16_t chamber_operation(const struct control_bench *b, int64_t t_ns)
{
    return chamber_stable(&b->lab->chamber, t_ns) ? 0 : SCPI_OPER_SETTLING;
}

static uint16_t chamber_questionable(const struct control_bench *b, int64_t t_ns)
{
    return chamber_stable(&b->lab->chamber, t_ns) ? 0 : SCPI_QUES_TEMPERATURE;
}

/* ---- supply */

/* Output on, but below what the boards need. */
static uint16_t supply_questionable(const struct control_bench *b, int64_t t_ns)
{
    const struct supply *s = &b->lab->supply;
    return s->on && supply_volts(s, t_ns) < s->cfg.brownout_v ? SCPI_QUES_VOLTAGE : 0;
}

const struct scpi_kind scpi_kinds[] = {
    {"head", "DIVIDING HEAD", "head.", head_over_ns, head_operation, NULL},
    {"table", "RATE TABLE", "table.", table_over_ns, table_operation, NULL},
    {"chamber", "THERMAL CHAMBER", "chamber.", chamber_over_ns, chamber_operation, chamber_questionable},
    {"supply", "SUPPLY", "supply.", NULL, NULL, supply_questionable},
    {0},
};

const struct scpi_kind *scpi_kind(const char *name)
{
    const struct scpi_kind *k = scpi_kinds;
    while (k->name && strcmp(k->name, name) != 0) k++;
    return k->name ? k : NULL;
}

#include "fault/point.h"

#include <ctype.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

static const struct {
    const char *name; /* as the page shows its points */
    const char *what;
} places[FAULT_PLACES] = {
    [FAULT_AT_SENSOR] = {"UNIT.sensor.x|y|z", "the output of a sensor"},
    [FAULT_AT_AFE] = {"UNIT.afe.x|y|z", "the analog chain of a channel"},
    [FAULT_AT_TEMP] = {"UNIT.temp.x|y|z|board", "a temperature sensor"},
    [FAULT_AT_CHIP] = {"UNIT.CHIP", "a chip of a board"},
    [FAULT_AT_CONTROLLER] = {"UNIT.CONTROLLER", "the controller of a board"},
    [FAULT_AT_LINE] = {"UNIT.line.NAME", "a line of a board"},
    [FAULT_AT_NODE] = {"UNIT.can", "the CAN node of a board"},
    [FAULT_AT_GYRO] = {"UNIT.gyro.x|y|z", "a gyro that counts angle"},
    [FAULT_AT_BUS] = {"bus.NAME", "a CAN bus"},
    [FAULT_AT_CLIENT] = {"client.N", "a program on the CAN bus"},
    [FAULT_AT_SUPPLY] = {"supply", "the power supply"},
    [FAULT_AT_TORQUER] = {"platform.level|azimuth", "an axis of the platform"},
    [FAULT_AT_ENCODER] = {"platform.encoder", "the angle sensor of the platform"},
    [FAULT_AT_CHAMBER] = {"chamber", "the thermal chamber"},
    [FAULT_AT_TABLE] = {"table.N", "an axis of the rate table"},
    [FAULT_AT_HEAD] = {"head", "the dividing head"},
    [FAULT_AT_SCPI] = {"scpi.head|table|chamber|supply", "the SCPI link of an instrument"},
};

const char *fault_place_any(enum fault_place place)
{
    return places[place].name;
}

const char *fault_place_what(enum fault_place place)
{
    return places[place].what;
}

/* ---- points of one unit, in a row */

static const struct {
    enum fault_place place;
    const char *infix;
} of_unit[] = {
    {FAULT_AT_SENSOR, "sensor."}, {FAULT_AT_AFE, "afe."},   {FAULT_AT_TEMP, "temp."}, {FAULT_AT_CHIP, ""},
    {FAULT_AT_CONTROLLER, ""},    {FAULT_AT_LINE, "line."}, {FAULT_AT_NODE, "can"},   {FAULT_AT_GYRO, "gyro."},
};

enum { OF_UNIT = sizeof of_unit / sizeof *of_unit };

/* What a point is called behind its infix; NULL: no faults there. */
static const char *point_suffix(const struct board_type *t, enum fault_place place, unsigned index)
{
    static const char *const axis[UNIT_AXES] = {"x", "y", "z"};
    switch (place) {
    case FAULT_AT_SENSOR:
    case FAULT_AT_AFE:
    case FAULT_AT_GYRO:
        return axis[index];
    case FAULT_AT_TEMP:
        return t->temps[index];
    case FAULT_AT_CHIP:
    case FAULT_AT_CONTROLLER:
        return t->parts[index].name;
    case FAULT_AT_LINE:
        return t->lines[index].name;
    default:
        return "";
    }
}

static unsigned temp_count(const struct board_type *t)
{
    unsigned n = 0;
    while (t->temps && t->temps[n]) n++;
    return n;
}

/* Indices at a place of a board: from `first`, `count` of them. */
static unsigned index_count(const struct board_type *t, enum fault_place place, unsigned *first)
{
    *first = place == FAULT_AT_CHIP;
    switch (place) {
    case FAULT_AT_SENSOR:
    case FAULT_AT_AFE:
        return t->analog ? UNIT_AXES : 0;
    case FAULT_AT_GYRO:
        return t->gyros ? UNIT_AXES : 0;
    case FAULT_AT_TEMP:
        return temp_count(t);
    case FAULT_AT_CHIP:
        return t->part_count - 1;
    case FAULT_AT_LINE:
        return t->line_count;
    default:
        return 1;
    }
}

/* The n-th point of a unit; false past the last. */
static bool unit_point(const struct control_bench *b, unsigned unit, unsigned n, struct fault_point *p, char *name)
{
    const struct board_type *t = b->unit[unit]->type;
    for (unsigned row = 0; row < OF_UNIT; row++) {
        unsigned first;
        const enum fault_place place = of_unit[row].place;
        const unsigned count = index_count(t, place, &first);
        for (unsigned i = first; i < first + count; i++) {
            const char *last = point_suffix(t, place, i);
            if (!last || n-- > 0) continue;
            *p = (struct fault_point){.place = place, .unit = unit, .index = i};
            snprintf(name, FAULT_POINT_MAX, "%s.%s%s", b->unit_name[unit], of_unit[row].infix, last);
            return true;
        }
    }
    return false;
}

/* ---- points of a bench */

static unsigned client_count(const struct control_bench *b)
{
    struct control_client c;
    unsigned n = 0;
    while (b->clients.nth && b->clients.nth(b->ctx, n, &c)) n++;
    return n;
}

static bool point_of_platform(unsigned n, struct fault_point *p, char *name)
{
    static const char *const names[] = {[PLATFORM_LEVEL] = "level", [PLATFORM_AZIMUTH] = "azimuth", "encoder"};
    *p = (struct fault_point){.place = n < PLATFORM_AXES ? FAULT_AT_TORQUER : FAULT_AT_ENCODER, .index = n};
    snprintf(name, FAULT_POINT_MAX, "platform.%s", names[n]);
    return true;
}

/* An instrument of which there is one. */
static bool point_of_whole(enum fault_place place, struct fault_point *p, char *name)
{
    *p = (struct fault_point){.place = place};
    snprintf(name, FAULT_POINT_MAX, "%s", places[place].name);
    return true;
}

static bool point_of_table(unsigned axis, struct fault_point *p, char *name)
{
    *p = (struct fault_point){.place = FAULT_AT_TABLE, .index = axis};
    snprintf(name, FAULT_POINT_MAX, "table.%u", axis + 1);
    return true;
}

const char *const fault_scpi_instruments[FAULT_SCPI_LINKS] = {"head", "table", "chamber", "supply"};

/* The link of the n-th instrument that the bench has. */
static bool point_of_link(const struct control_bench *b, unsigned n, struct fault_point *p, char *name)
{
    const struct lab *l = b->lab;
    const bool has[FAULT_SCPI_LINKS] = {l != NULL, l && l->table.cfg.axes > 0, l && l->chamber.cfg.present,
                                        l && l->supply.cfg.present};
    for (unsigned i = 0; i < FAULT_SCPI_LINKS; i++) {
        if (!has[i] || n-- > 0) continue;
        *p = (struct fault_point){.place = FAULT_AT_SCPI, .index = i};
        snprintf(name, FAULT_POINT_MAX, "scpi.%s", fault_scpi_instruments[i]);
        return true;
    }
    return false;
}

/* The n-th of the instruments that not every bench has, then of those that came to have faults later. */
static bool point_of_instrument(const struct control_bench *b, unsigned n, struct fault_point *p, char *name)
{
    const bool chamber = b->lab && b->lab->chamber.cfg.present;
    const unsigned axes = b->lab ? b->lab->table.cfg.axes : 0;
    const unsigned platform = b->lab && b->lab->platform.cfg.present ? PLATFORM_AXES + 1 : 0;
    if (chamber && n == 0) return point_of_whole(FAULT_AT_CHAMBER, p, name);
    n -= chamber;
    if (n < axes) return point_of_table(n, p, name);
    n -= axes;
    if (n < platform) return point_of_platform(n, p, name);
    n -= platform;
    if (b->lab && n == 0) return point_of_whole(FAULT_AT_HEAD, p, name);
    return b->lab && point_of_link(b, n - 1, p, name);
}

/* The n-th of those that are not a unit's; false past the last. */
static bool bench_point(const struct control_bench *b, unsigned n, struct fault_point *p, char *name)
{
    if (n < b->buses) {
        *p = (struct fault_point){.place = FAULT_AT_BUS, .index = n};
        if (b->bus_name[n]) snprintf(name, FAULT_POINT_MAX, "bus.%s", b->bus_name[n]);
        else snprintf(name, FAULT_POINT_MAX, "bus.can%u", n);
        return true;
    }
    n -= b->buses;
    const unsigned programs = client_count(b);
    if (n < programs) {
        struct control_client c = {0};
        (void)b->clients.nth(b->ctx, n, &c);
        *p = (struct fault_point){.place = FAULT_AT_CLIENT, .index = c.slot};
        snprintf(name, FAULT_POINT_MAX, "client.%" PRIu32, c.connection);
        return true;
    }
    return n == programs ? point_of_whole(FAULT_AT_SUPPLY, p, name) : point_of_instrument(b, n - programs - 1, p, name);
}

bool fault_point_next(const struct control_bench *b, struct fault_points *at, struct fault_point *p,
                      char name[FAULT_POINT_MAX])
{
    for (; at->unit < b->units; at->unit++, at->n = 0) {
        if (unit_point(b, at->unit, at->n, p, name)) {
            at->n++;
            return true;
        }
    }
    return bench_point(b, at->n++, p, name);
}

static bool same_letters(const char *a, const char *b)
{
    while (*a && toupper((unsigned char)*a) == toupper((unsigned char)*b)) a++, b++;
    return *a == *b;
}

/* A line may be written in capitals: Int of the trace is INT in much of the literature. */
bool fault_point_find(const struct control_bench *b, const char *text, struct fault_point *p,
                      char name[FAULT_POINT_MAX])
{
    for (struct fault_points at = {0}; fault_point_next(b, &at, p, name);) {
        if (strcmp(name, text) == 0) return true;
        if (p->place == FAULT_AT_LINE && same_letters(name, text)) return true;
    }
    return false;
}

/* ---- how points of a place are named */

/* Bytes of a part's name up to its dot: adc.x, adc.y and adc.z are one group, adc.x|y|z. */
static size_t group_len(const char *part)
{
    const char *dot = strchr(part, '.');
    return dot ? (size_t)(dot - part) + 1 : 0;
}

static bool same_group(const char *a, const char *b)
{
    const size_t n = group_len(a);
    return n > 0 && n == group_len(b) && strncmp(a, b, n) == 0;
}

static void add_name(struct fault_names *names, const char *name)
{
    for (unsigned i = 0; i < names->count; i++)
        if (strcmp(names->name[i], name) == 0) return;
    if (names->count < FAULT_NAMES_MAX) snprintf(names->name[names->count++], FAULT_POINT_MAX, "%s", name);
}

static void add_parts(const struct board_type *t, enum fault_place place, struct fault_names *names)
{
    unsigned first;
    const unsigned count = index_count(t, place, &first), end = first + count;
    for (unsigned p = first; p < end; p++) {
        char name[FAULT_POINT_MAX];
        const char *part = t->parts[p].name;
        if (!part) continue;
        size_t at = (size_t)snprintf(name, sizeof name, "UNIT.%s", part);
        for (; p + 1 < end && t->parts[p + 1].name && same_group(part, t->parts[p + 1].name); p++) {
            if (at < sizeof name)
                at += (size_t)snprintf(name + at, sizeof name - at, "|%s", t->parts[p + 1].name + group_len(part));
        }
        add_name(names, name);
    }
}

void fault_place_names(const struct control_bench *b, const struct board_type *only, uint64_t at,
                       struct fault_names *names)
{
    names->count = 0;
    for (unsigned p = 0; p < FAULT_PLACES; p++) {
        const bool of_parts = p == FAULT_AT_CHIP || p == FAULT_AT_CONTROLLER;
        if (!(at >> p & 1)) continue;
        if (!of_parts) add_name(names, places[p].name);
        for (unsigned i = 0; of_parts && i < (only ? 1 : b->units); i++)
            add_parts(only ? only : b->unit[i]->type, (enum fault_place)p, names);
    }
}

#include "control/fault_point.h"

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
    [FAULT_AT_ADC] = {"UNIT.adc.x|y|z", "an accelerometer converter"},
    [FAULT_AT_TADC] = {"UNIT.tadc", "the temperature converter"},
    [FAULT_AT_KPSA] = {"UNIT.kpsa", "the controller of a board"},
    [FAULT_AT_LINE] = {"UNIT.line.NAME", "a line of a board"},
    [FAULT_AT_NODE] = {"UNIT.can", "the CAN node of a board"},
    [FAULT_AT_BUS] = {"bus.NAME", "a CAN bus"},
    [FAULT_AT_CLIENT] = {"client.N", "a program on the CAN bus"},
    [FAULT_AT_SUPPLY] = {"supply", "the power supply"},
};

const char *fault_place_name(enum fault_place place)
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
    unsigned points;
    const char *infix;
} of_unit[] = {
    {FAULT_AT_SENSOR, UNIT_AXES, "sensor."},
    {FAULT_AT_AFE, UNIT_AXES, "afe."},
    {FAULT_AT_ADC, UNIT_AXES, "adc."},
    {FAULT_AT_TADC, 1, "tadc"},
    {FAULT_AT_KPSA, 1, "kpsa"},
    {FAULT_AT_LINE, PSA2_LINES, "line."},
    {FAULT_AT_NODE, 1, "can"},
};

enum { OF_UNIT = sizeof of_unit / sizeof *of_unit, UNIT_POINTS = 3 * UNIT_AXES + PSA2_LINES + 3 };

static const char *suffix(enum fault_place place, unsigned index)
{
    static const char *const axis[UNIT_AXES] = {"x", "y", "z"};
    if (place == FAULT_AT_LINE) return psa2_line_name((enum psa2_line)index);
    return place == FAULT_AT_SENSOR || place == FAULT_AT_AFE || place == FAULT_AT_ADC ? axis[index] : "";
}

static void unit_point(const struct control_bench *b, unsigned n, struct fault_point *p, char *name)
{
    unsigned row = 0;
    p->unit = n / UNIT_POINTS;
    p->index = n % UNIT_POINTS;
    while (p->index >= of_unit[row].points) p->index -= of_unit[row++].points;
    p->place = of_unit[row].place;
    snprintf(name, FAULT_POINT_MAX, "%s.%s%s", b->unit_name[p->unit], of_unit[row].infix, suffix(p->place, p->index));
}

static unsigned clients(const struct control_bench *b)
{
    struct control_client c;
    unsigned n = 0;
    while (b->client && b->client(b->ctx, n, &c)) n++;
    return n;
}

bool fault_point(const struct control_bench *b, unsigned n, struct fault_point *p, char name[FAULT_POINT_MAX])
{
    *p = (struct fault_point){.place = FAULT_AT_SUPPLY};
    if (n < b->units * UNIT_POINTS) {
        unit_point(b, n, p, name);
        return true;
    }
    n -= b->units * UNIT_POINTS;
    if (n < b->buses) {
        *p = (struct fault_point){.place = FAULT_AT_BUS, .index = n};
        if (b->bus_name[n]) snprintf(name, FAULT_POINT_MAX, "bus.%s", b->bus_name[n]);
        else snprintf(name, FAULT_POINT_MAX, "bus.can%u", n);
        return true;
    }
    n -= b->buses;
    const unsigned programs = clients(b);
    if (n < programs) {
        struct control_client c = {0};
        (void)b->client(b->ctx, n, &c);
        *p = (struct fault_point){.place = FAULT_AT_CLIENT, .index = c.place};
        snprintf(name, FAULT_POINT_MAX, "client.%" PRIu32, c.came);
        return true;
    }
    snprintf(name, FAULT_POINT_MAX, "supply");
    return n == programs;
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
    for (unsigned n = 0; fault_point(b, n, p, name); n++) {
        if (strcmp(name, text) == 0) return true;
        if (p->place == FAULT_AT_LINE && same_letters(name, text)) return true;
    }
    return false;
}

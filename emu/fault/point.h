/* Where on a bench faults can be: points by name, in the order in which fault.points lists them. */
#ifndef PSABENCH_FAULT_POINT_H
#define PSABENCH_FAULT_POINT_H

#include "command/command.h"

#define FAULT_POINT_MAX 32u /* bytes of a point's name */

enum fault_place {
    FAULT_AT_SENSOR,     /* a.sensor.x */
    FAULT_AT_AFE,        /* a.afe.x */
    FAULT_AT_CHIP,       /* a.adc.x, a.tadc: board_type.parts but the first */
    FAULT_AT_CONTROLLER, /* a.kpsa: the first */
    FAULT_AT_LINE,       /* a.line.Int */
    FAULT_AT_NODE,       /* a.can */
    FAULT_AT_BUS,        /* bus.can0 */
    FAULT_AT_CLIENT,     /* client.1, by struct control_client.connection */
    FAULT_AT_SUPPLY,     /* supply */
    FAULT_AT_TORQUER,    /* platform.level, platform.azimuth: by enum platform_axis */
    FAULT_AT_ENCODER,    /* platform.encoder */
    FAULT_PLACES
};

struct fault_point {
    enum fault_place place;
    unsigned unit, index; /* index: axis, part, line or bus, from 0; of a client its control_client.slot */
};

#define FAULT_TYPES_MAX 8u /* of boards */

/* Types of boards whose points are meant. */
struct fault_types {
    const struct board_type *type[FAULT_TYPES_MAX];
    unsigned count;
};

struct fault_types fault_types_of(const struct control_bench *b); /* each once, in order of the units */
struct fault_types fault_type_of(const struct board_type *t);     /* this one alone */

/* The n-th point of a bench with its name; false past the last. */
bool fault_point(const struct control_bench *b, unsigned n, struct fault_point *p, char name[FAULT_POINT_MAX]);

/* The i-th way in which points of a place are named on such boards: "UNIT.sensor.x|y|z"; false past the last. */
bool fault_place_name(const struct fault_types *t, enum fault_place place, unsigned i, char name[FAULT_POINT_MAX]);

const char *fault_place_any(enum fault_place place); /* on whatever board: "UNIT.CHIP" */
bool fault_point_find(const struct control_bench *b, const char *text, struct fault_point *p,
                      char name[FAULT_POINT_MAX]);

/* "the output of a sensor" */
const char *fault_place_what(enum fault_place place);

#endif

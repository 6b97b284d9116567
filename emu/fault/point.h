/* Where on a bench faults can be: points by name, in the order in which fault.points lists them. */
#ifndef PSABENCH_FAULT_POINT_H
#define PSABENCH_FAULT_POINT_H

#include "command/command.h"

#define FAULT_POINT_MAX 32u /* bytes of a point's name */

enum fault_place {
    FAULT_AT_SENSOR,     /* a.sensor.x */
    FAULT_AT_AFE,        /* a.afe.x */
    FAULT_AT_TEMP,       /* a.temp.x: by the row of board_type.temps */
    FAULT_AT_CHIP,       /* a.adc.x, a.tadc: board_type.parts but the first */
    FAULT_AT_CONTROLLER, /* a.kpsa: the first */
    FAULT_AT_LINE,       /* a.line.Int */
    FAULT_AT_NODE,       /* a.can */
    FAULT_AT_GYRO,       /* a.gyro.x: board_type.gyros */
    FAULT_AT_BUS,        /* bus.can0 */
    FAULT_AT_CLIENT,     /* client.1, by struct control_client.connection */
    FAULT_AT_SUPPLY,     /* supply */
    FAULT_AT_TORQUER,    /* platform.level, platform.azimuth: by enum platform_axis */
    FAULT_AT_ENCODER,    /* platform.encoder */
    FAULT_AT_CHAMBER,    /* chamber */
    FAULT_AT_TABLE,      /* table.1: an axis, from the outermost */
    FAULT_AT_HEAD,       /* head */
    FAULT_AT_SCPI,       /* scpi.head: by the row of scpi_instruments */
    FAULT_PLACES
};

struct fault_point {
    enum fault_place place;
    unsigned unit, index; /* index: axis, part, line or bus, from 0; of a client its control_client.slot */
};

struct fault_points {
    unsigned unit, n; /* all zero: before the first point of a bench */
};

/* The next point of a bench with its name; false past the last. */
bool fault_point_next(const struct control_bench *b, struct fault_points *at, struct fault_point *p,
                      char name[FAULT_POINT_MAX]);

enum { FAULT_SCPI_LINKS = 4 };
extern const char *const fault_scpi_instruments[FAULT_SCPI_LINKS]; /* "head", as the option --scpi has them */

#define FAULT_NAMES_MAX 64u

/* How points are named: "UNIT.sensor.x|y|z", each once. */
struct fault_names {
    char name[FAULT_NAMES_MAX][FAULT_POINT_MAX];
    unsigned count;
};

/* Names of the points at these places (bits of enum fault_place): on the boards of a bench, or on those of a type alone
 * (NULL: of all). */
void fault_place_names(const struct control_bench *b, const struct board_type *only, uint64_t at,
                       struct fault_names *names);

const char *fault_place_any(enum fault_place place); /* on whatever board: "UNIT.CHIP" */
bool fault_point_find(const struct control_bench *b, const char *text, struct fault_point *p,
                      char name[FAULT_POINT_MAX]);

/* "the output of a sensor" */
const char *fault_place_what(enum fault_place place);

#endif

/* --mavlink: a unit of the bench as a MAVLink system (docs/tools/mavlink.md). Its readings are those of its CAN frames. */
#ifndef PSABENCH_APP_MAVLINK_H
#define PSABENCH_APP_MAVLINK_H

#include "app/options.h"
#include "bench/bench.h"
#include "link/mavlink/mav_port.h"
#include "telemetry/psa2_reading.h"

struct mavlink {
    struct mav_port port; /* first */
    struct bench *bench;
    struct unit *unit;
    const struct mav_options *o;
    struct can_node ear; /* on the unit's bus; sends nothing */
    bool decodes;        /* the unit is a PSA-2 */
    struct psa2_reader psa2;
    struct mav_param *params;
};

/* Whether the bench has the units that the options name. False with one line in why. */
bool mavlink_check(const struct bench *b, const struct options *o, char *why, size_t cap);

/* Opens one, checked; hubs: those of the buses. NULL with one line in why; *refused: another name would do. */
struct mavlink *mavlink_open(struct bench *b, struct can_hub *hubs, const struct options *o,
                             const struct mav_options *m, bool *refused, char *why, size_t cap);

/* A reading as a station takes it. Pure. */
struct mav_reading mavlink_reading(const struct psa2_reading *r);

void mavlink_close(struct mavlink *m); /* its links are gone; mavlink_free() after they were reaped */
void mavlink_free(struct mavlink *m);

void mavlink_print_counters(const struct mavlink *m, FILE *out);
const char *mavlink_kind_name(enum mav_port_kind kind);

#endif

/* Where a unit is and how it moves, as its board can ask for it: kinematics, place, height, supply, the platform under it. */
#ifndef PSABENCH_UNIT_SURROUNDINGS_H
#define PSABENCH_UNIT_SURROUNDINGS_H

#include "unit/unit.h"

/* io->ctx is the unit. */
void unit_put_surroundings(const struct unit *u, struct board_io *io);

#endif

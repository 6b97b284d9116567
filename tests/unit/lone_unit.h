/* One unit of a board's type in a world of its own, on no bus, not powered. */
#ifndef PSABENCH_TESTS_LONE_UNIT_H
#define PSABENCH_TESTS_LONE_UNIT_H

#include "unit/unit.h"

static inline void lone_unit(struct unit *u, struct lab *world, struct sched *s, const struct board_type *t,
                             uint32_t serial)
{
    const struct lab_cfg lab = lab_default();
    struct unit_cfg cfg = unit_default("a");
    sched_init(s);
    lab_init(world, &lab, 1);
    unit_cfg_type(&cfg, t);
    cfg.board.serial = serial;
    unit_init(u, &cfg, world, s);
}

#endif

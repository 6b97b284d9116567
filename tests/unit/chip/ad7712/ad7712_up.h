/* An AD7712 whose conversions run. */
#ifndef PSABENCH_TESTS_AD7712_UP_H
#define PSABENCH_TESTS_AD7712_UP_H

#include "ad7712_rig.h"

#define FAST AD7712_CONTROL(0, 0, 0, 1, 0, 19)

static inline void up(struct rig *r, const struct ad7712_cfg *cfg, uint32_t control)
{
    power_up(r, cfg);
    r->v[0] = 0.7;
    write_control(r, control);
    await_fall(r);
    r->sdata.n = r->sclk.n = 0;
}

#endif

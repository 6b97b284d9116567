/* Arguments of fault.add and of the kinds of faults. */
#ifndef PSABENCH_FAULT_ARGS_H
#define PSABENCH_FAULT_ARGS_H

#include "command/command.h"

#define FAULT_PPM_MAX 500000.0 /* of a chip's clock */

/* What is less changes no code of any board: one of PSA-2 is 10 V / 2^23 = 1.19 uV at the load, or more by the tolerances of
 * the chain. Boards of coarser codes want more: board_type.code_v. */
#define FAULT_LEAST_V   2e-6
#define FAULT_LEAST_PPM 1.0

/* Arguments of fault.add, in the order of its row. The values after FAULT_FOR_S belong to the kinds. */
enum fault_arg {
    FAULT_KIND,
    FAULT_POINT,
    FAULT_AT_S,
    FAULT_AFTER,
    FAULT_COUNT,
    FAULT_SINCE,
    FAULT_UNIT,
    FAULT_DELAY_S,
    FAULT_FOR_S,
    FAULT_OUT_V,
    FAULT_BIAS_V,
    FAULT_DRIFT_V_PER_S,
    FAULT_SCALE_PPM,
    FAULT_RMS_V,
    FAULT_LOW_V,
    FAULT_HIGH_V,
    FAULT_REFERENCE_PPM,
    FAULT_DRIFT_PPM_PER_S,
    FAULT_AMPLITUDE_V,
    FAULT_FREQUENCY_HZ,
    FAULT_LEVEL,    /* 0 low, 1 high */
    FAULT_REGISTER, /* number in the chip */
    FAULT_MASK,
    FAULT_CLOCK_PPM,
    FAULT_WIDTH_NS,
    FAULT_PULSE,
    FAULT_RATE_HZ,
    FAULT_PROBABILITY,
    FAULT_FRAMES,
    FAULT_ID,
    FAULT_ID_MASK,
    FAULT_HOLD_S,
    FAULT_DROP_V,
    FAULT_DRIFT_DEGPH,
    FAULT_RATE_PART,
    FAULT_READOUT_K,
    FAULT_RIPPLE_DPS,
    FAULT_OVERSHOOT_K,
    FAULT_SLIP_DEG,
    FAULT_LATE_S,
    FAULT_RAMP_MPS,
    FAULT_JUMP_M,
    FAULT_AZIMUTH_DEG,
    FAULT_WEEKS,
    FAULT_LIMIT_DPS,
    FAULT_LOCK_IN_DEGPH,
    FAULT_ARGS
};

extern const struct control_arg fault_args[]; /* names, units, ranges; up to the one without a name */

#endif

/* What a board is given: what it can reach of the world, and what is its own among boards of its profile. */
#ifndef PSABENCH_BOARD_CFG_H
#define PSABENCH_BOARD_CFG_H

#include "base/looks.h"
#include "board/afe.h"
#include "phys/receiver/place.h"

#include <stdint.h>

#define BOARD_AXES 3u

/* What a board can reach of the gyro-stabilised platform, phys/motion/platform.h; ctx is that of board_io. */
struct board_platform_io {
    void (*torque)(void *ctx, double u1_radps, double u2_radps, int64_t t_ns); /* rates for its torquers */
    void (*reposition)(void *ctx, int64_t t_ns);                               /* a new setting */
    double (*servo_rad)(void *ctx, int64_t t_ns);   /* its angle sensor, as the servo has it */
    double (*encoder_rad)(void *ctx, int64_t t_ns); /* and as the encoder has it */
    /* Heading by the induction sensor, in (-pi, pi]. False: none is fitted. */
    bool (*magnetic_rad)(void *ctx, int64_t t_ns, double *heading_rad);
};

/* What a board can reach of the world. */
struct board_io {
    void *ctx;
    /* Sensor outputs at a row of looks, A or V by the channel's afe_cfg.input; none earlier than the axis's last call. Call
     * sample_until() before an abrupt change of the physics. */
    void (*accel)(void *ctx, unsigned axis, const struct looks *at, double *out);
    /* What such an output stays within up to until_ns, looks every_ns apart. *why, where that is not known or the output depends on
     * more of the past than accel_past_ns() says. NULL: nothing is known. */
    struct looks_range (*accel_range)(void *ctx, unsigned axis, int64_t every_ns, int64_t until_ns, const char **why);
    /* An output follows from the looks since so long before it, to the bit; 0: from its own instant. skip_accel: as if the last look had
     * been at t_ns. Where accel_range is. */
    int64_t (*accel_past_ns)(void *ctx, unsigned axis);
    void (*skip_accel)(void *ctx, unsigned axis, int64_t t_ns);
    double (*temp_degc)(void *ctx, unsigned channel, int64_t t_ns); /* at X, Y, Z sensor and the board itself (3) */
    void (*rate_radps)(void *ctx, int64_t t_ns, double w_ib_b[3]);  /* inertial rate, axes of the unit's case */
    /* Specific force at the unit's origin and inertial rate, axes of the unit's case; and up to which instant after t_ns they are
     * smooth, if nothing changes abruptly before. */
    void (*kinematics)(void *ctx, int64_t t_ns, double f_b_mps2[3], double w_ib_b_radps[3]);
    int64_t (*smooth_ns)(void *ctx, int64_t t_ns);
    place_at_fn *place;                                     /* of the unit's antenna */
    double (*baro_m)(void *ctx, int64_t t_ns);              /* height that the altimeter beside the unit shows */
    void (*event)(void *ctx, unsigned event, int64_t t_ns); /* number in board_type.events; may be NULL */
    /* The voltage that feeds the unit, to its nominal one. NULL: the bench has no supply. */
    double (*supply_ratio)(void *ctx, int64_t t_ns);
    const struct board_platform_io *platform; /* NULL: there is none */
};

#define BOARD_CHAIN_MODULATOR 1u /* adc_chain: looks at the input at each clock of the modulator */

/* One specimen: what differs between two boards of a profile. */
struct board_cfg {
    struct afe_cfg afe[BOARD_AXES];
    double adc_noise_scale, temp_noise_scale;      /* 1 published, 0 none */
    unsigned adc_chain;                            /* PSA-2: enum ads1282_chain; see BOARD_CHAIN_MODULATOR */
    double temp_adc_offset_v, temp_adc_gain_error; /* PSA-2 */
    uint64_t seed;
    uint32_t serial;
    uint8_t level_node; /* gyro unit: node of the unit that reads its level sensors; 0: none */
};

#endif

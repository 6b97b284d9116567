/* Frame forms of a PSA-2 on CAN (object 2020h): which frames carry a sample, and whether a bus can carry them. Pure. */
#ifndef PSABENCH_BOARD_PSA2_CAN_FORM_H
#define PSABENCH_BOARD_PSA2_CAN_FORM_H

#include "base/can.h"
#include "board/node.h"
#include "board/psa2/psa2.h"
#include "gen/psa2_od.h"

#define PSA2_FORM_FRAMES_MAX 2u

enum psa2_sample_mode { PSA2_FREE_RUN, PSA2_ON_SYNC, PSA2_EVERY_NTH };

/* Objects 2020h.. and 2210h, 2211h. */
struct psa2_can_settings {
    uint8_t form;        /* enum psa2_form */
    uint8_t sample_mode; /* enum psa2_sample_mode */
    uint16_t nth;
    bool sync_pin;
    float zero_v[3], scale_v_per_g[3];
};

/* A block that is being filled. */
struct psa2_block {
    struct can_msg m;
    unsigned samples;
};

/* TPDOs of a form: the first, and all of them as a mask. */
unsigned psa2_form_first_tpdo(unsigned form);
unsigned psa2_form_tpdos(unsigned form);

/* Packs a sample; the number of frames in m to send now: 0 while a block is being filled. */
unsigned psa2_form_pack(unsigned form, struct psa2_block *block, const struct psa2_frame *f,
                        struct can_msg m[PSA2_FORM_FRAMES_MAX]);

/* Whether the bus can carry these settings at a data period (0: unknown, not checked); if not, the reason is in why. */
bool psa2_form_fits(const struct can_bus_cfg *bus, const struct psa2_can_settings *set, int64_t period_ns,
                    char why[BOARD_NODE_TEXT]);

#endif

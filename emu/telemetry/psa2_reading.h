/* Samples of a PSA-2 (PSA-1) out of its CAN frames, in all four forms (docs/reference/protocol.md): what LCM and MAVLink send. No
 * I/O. */
#ifndef PSABENCH_TELEMETRY_PSA2_READING_H
#define PSABENCH_TELEMETRY_PSA2_READING_H

#include "base/can/can.h"

#define PSA2_READINGS_MAX 5u /* in one frame */

struct psa2_reading {
    uint8_t form, sample; /* object 2020h; sample: 0, of a block 0 to 4 */
    int32_t code[3];
    double volts[3];     /* nominal, at the load */
    int32_t sequence;    /* of the conversion, low 16 bits; -1: the form has none */
    double t_sample_s;   /* instant of the sample as the board gives it, with its wrap; NaN: the form has none */
    int64_t t_ns;        /* the same without the wrap; end of the frame where the form has none */
    uint32_t lost;       /* readings missing before this one, by the board's own count */
    int16_t temp_code;   /* 0: the form has none */
    int8_t temp_channel; /* -1: the form has none */
    uint8_t status;      /* PSA2_ST; 0: the form has none */
};

struct psa2_reader { /* all zero but the node: at the beginning */
    uint8_t node;
    struct can_msg xy; /* first half of a pair */
    bool has_xy, has_seq, has_toggle;
    uint16_t seq;
    uint8_t toggle;
    uint32_t block_us; /* time stamp of the latest block */
    bool has_block;
};

/* Readings that are complete with this frame, oldest first; their number. */
unsigned psa2_reading_take(struct psa2_reader *d, const struct can_msg *m, int64_t t_ns,
                           struct psa2_reading out[PSA2_READINGS_MAX]);

#endif

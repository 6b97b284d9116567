/* A gyro unit on CAN (docs/reference/protocol_gyro.md; the mapping is ours, E0): three PDOs a step, settings as objects; and the frames
 * of the level unit, which it receives on the same bus. */
#ifndef PSABENCH_BOARD_GYRO_BOARD_H
#define PSABENCH_BOARD_GYRO_BOARD_H

#include "board/gyro/gyro.h"
#include "board/node.h"

struct gyro_can {
    struct board_node node;
    uint32_t level_id; /* of PSA2_XY of the level unit; 0: none is fitted */
};

extern const struct board_type gyro_board; /* the board as the bench knows it */
extern const struct board_can gyro_can;

#endif

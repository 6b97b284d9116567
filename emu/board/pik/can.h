/* A PIK on CAN: proto/pik.yaml behind the common node. */
#ifndef PSABENCH_BOARD_PIK_CAN_H
#define PSABENCH_BOARD_PIK_CAN_H

#include "board/node.h"

struct pik_can {
    struct board_node node; /* first */
};

extern const struct board_can pik_can_side;

#endif

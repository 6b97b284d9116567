/* A PIK on CAN: proto/pik.yaml behind the common node. */
#ifndef PSABENCH_BOARD_PIK_BOARD_H
#define PSABENCH_BOARD_PIK_BOARD_H

#include "board/node.h"
#include "board/pik/pik.h"

struct pik_can {
    struct board_node node; /* first */
};

extern const struct board_type pik_board; /* the board as the bench knows it */
extern const struct board_can pik_can;

#endif

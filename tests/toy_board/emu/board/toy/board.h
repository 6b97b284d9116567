/* TOY as a type of board, and its CAN side: proto/toy.yaml behind the common node. */
#ifndef PSABENCH_BOARD_TOY_BOARD_H
#define PSABENCH_BOARD_TOY_BOARD_H

#include "board/node.h"
#include "board/toy/toy.h"

struct toy_can {
    struct board_node node; /* first */
};

extern const struct board_can toy_can;
extern const struct board_type toy_board;

#endif

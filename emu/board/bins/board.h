/* БИНС as a type of board, and its CAN side: proto/bins.yaml behind the common node. */
#ifndef PSABENCH_BOARD_BINS_BOARD_H
#define PSABENCH_BOARD_BINS_BOARD_H

#include "board/bins/bins.h"
#include "board/node.h"

struct bins_can {
    struct board_node node; /* first */
};

extern const struct board_can bins_can;
extern const struct board_type bins_board;

#endif

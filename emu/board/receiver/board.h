/* The satellite receiver as a type of board, and its CAN side: proto/receiver.yaml behind the common node. */
#ifndef PSABENCH_BOARD_RECEIVER_BOARD_H
#define PSABENCH_BOARD_RECEIVER_BOARD_H

#include "board/node.h"
#include "board/receiver/receiver.h"

struct receiver_can {
    struct board_node node; /* first */
};

extern const struct board_can receiver_can;
extern const struct board_type receiver_board;

#endif

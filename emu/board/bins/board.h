/* БИНС as a type of board, and its CAN side: proto/bins.yaml behind the common node. */
#ifndef PSABENCH_BOARD_BINS_BOARD_H
#define PSABENCH_BOARD_BINS_BOARD_H

#include "board/bins/bins.h"
#include "board/node.h"

#define BINS_NAV_FIELDS 13u /* of object 2210h */

struct bins_can {
    struct board_node node;      /* first */
    double nav[BINS_NAV_FIELDS]; /* the latest outputs, as in the messages */
};

extern const struct board_can bins_can;
extern const struct board_type bins_board;

#endif

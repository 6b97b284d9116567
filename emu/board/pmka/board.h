/* A PMKA unit on CAN (docs/reference/protocol_pmka.md; the mapping is ours, E0): the readings as a pair of PDOs, all else by the
 * parallel bus, object 2002h. */
#ifndef PSABENCH_BOARD_PMKA_BOARD_H
#define PSABENCH_BOARD_PMKA_BOARD_H

#include "board/node.h"
#include "board/pmka/pmka.h"

struct pmka_can {
    struct board_node node;
};

extern const struct board_type pmka_board; /* the board as the bench knows it */
extern const struct board_can pmka_can;

#endif

/* PSA-2 as the bench knows it. */
#ifndef PSABENCH_BOARD_PSA2_BOARD_H
#define PSABENCH_BOARD_PSA2_BOARD_H

#include "board/board.h"

extern const struct board_type psa2_board;

#endif

/* PIK, PIK-5 and PIK-6 as a type of board. */
#ifndef PSABENCH_BOARD_PIK_BOARD_H
#define PSABENCH_BOARD_PIK_BOARD_H

#include "board/pik/can.h"
#include "board/pik/pik.h"

extern const struct board_type pik_board;

#endif

/* PSA-2 as the bench knows it. */
#ifndef PSABENCH_BOARD_PSA2_BOARD_H
#define PSABENCH_BOARD_PSA2_BOARD_H

#include "board/psa2/can.h"
#include "board/psa2/psa2.h"

extern const struct board_type psa2_board;

#endif

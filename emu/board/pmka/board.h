/* PMKA as the bench knows it. */
#ifndef PSABENCH_BOARD_PMKA_BOARD_H
#define PSABENCH_BOARD_PMKA_BOARD_H

#include "board/board.h"

extern const struct board_type pmka_board;

#endif

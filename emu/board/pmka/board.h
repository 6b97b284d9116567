/* PMKA as the bench knows it. */
#ifndef PSABENCH_BOARD_PMKA_BOARD_H
#define PSABENCH_BOARD_PMKA_BOARD_H

#include "board/pmka/can.h"
#include "board/pmka/pmka.h"

extern const struct board_type pmka_board;

#endif

/* PSD-1 as one of the bench's boards. */
#ifndef PSABENCH_BOARD_PSD1_BOARD_H
#define PSABENCH_BOARD_PSD1_BOARD_H

#include "board/psd1/can.h"
#include "board/psd1/psd1.h"

extern const struct board_type psd1_board;

#endif

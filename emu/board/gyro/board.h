/* The gyro unit as the bench knows it. */
#ifndef PSABENCH_BOARD_GYRO_BOARD_H
#define PSABENCH_BOARD_GYRO_BOARD_H

#include "board/gyro/can.h"
#include "board/gyro/gyro.h"

extern const struct board_type gyro_board;

#endif

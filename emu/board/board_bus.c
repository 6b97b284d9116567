#include "board/board_bus.h"

const char *board_cycle_word(enum board_cycle_result r)
{
    static const char *const words[] = {
        [BOARD_CYCLE_OK] = "ok",
        [BOARD_CYCLE_NO_ADDRESS] = "no-address",
        [BOARD_CYCLE_READ_ONLY] = "read-only",
        [BOARD_CYCLE_WRITE_ONLY] = "write-only",
        [BOARD_CYCLE_NOT_READY] = "not-ready",
        [BOARD_CYCLE_TOO_SHORT] = "too-short",
        [BOARD_CYCLE_BUSY] = "busy",
        [BOARD_CYCLE_BAD_VALUE] = "bad-value",
        [BOARD_CYCLE_TAKEN] = "taken",
        [BOARD_CYCLE_OFF] = "off",
    };
    return words[r];
}

/* A PSD-1 unit on CAN (docs/reference/protocol_psd1.md; the mapping is ours, E0): the cycles as PDOs, control words and coefficients as
 * objects, all else by the parallel bus, object 2002h. */
#ifndef PSABENCH_BOARD_PSD1_BOARD_H
#define PSABENCH_BOARD_PSD1_BOARD_H

#include "board/node.h"
#include "board/psd1/psd1.h"

struct psd1_can {
    struct board_node node;
    struct psd1_request request; /* of objects UC1, UC2, CONTROL */
    bool busy;                   /* it is under way */
    uint32_t ticket;             /* of the SDO that waits for it */
};

extern const struct board_type psd1_board; /* the board as the bench knows it */
extern const struct board_can psd1_can;

#endif

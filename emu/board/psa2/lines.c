/* Names of a PSA-2's lines, pairs and events. */
#include "board/psa2/inside.h"

const struct board_line psa2_lines[PSA2_LINES] = {PSA2_LINE_ROWS};

const struct board_pair psa2_pairs[PSA2_PAIRS] = {
    {PSA2_LINE_INT, "Int_A", "Int_B"}, {PSA2_LINE_DATA, "Data_A", "Data_B"}, {PSA2_LINE_CLK, "CLK_A", "CLK_B"}};

const char *const psa2_events[PSA2_EVENTS] = {PSA2_EVENT_LIST(BOARD_EVENT_NAME)};

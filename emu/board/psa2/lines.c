/* Names of a PSA-2's lines and events. */
#include "board/psa2/inside.h"

const struct board_line psa2_lines[PSA2_LINES] = {PSA2_LINE_ROWS};

const char *const psa2_events[PSA2_EVENTS] = {PSA2_EVENT_LIST(BOARD_EVENT_NAME)};

/* Names of a PSA-2's lines and events. */
#include "board/psa2/psa2.h"

const struct board_line psa2_lines[PSA2_LINES] = {
    [PSA2_LINE_SYNC_A] = {"SYNC_A", false}, [PSA2_LINE_SCLK] = {"SClk", false},    [PSA2_LINE_DRD_A] = {"DRD_A", true},
    [PSA2_LINE_DIN] = {"DIn", false},       [PSA2_LINE_DOUTX] = {"DOutX", false},  [PSA2_LINE_DOUTY] = {"DOutY", false},
    [PSA2_LINE_DOUTZ] = {"DOutZ", false},   [PSA2_LINE_SYNC_T] = {"SYNC_T", true}, [PSA2_LINE_CST] = {"CST", true},
    [PSA2_LINE_DRD_T] = {"DRD_T", true},    [PSA2_LINE_DINT] = {"DInT", false},    [PSA2_LINE_DOUTT] = {"DOutT", false},
    [PSA2_LINE_RES] = {"Res", false},       [PSA2_LINE_DATA] = {"Data", false},    [PSA2_LINE_CLK] = {"CLK", false},
    [PSA2_LINE_INT] = {"Int", true},
};

const char *const psa2_events[PSA2_EVENTS] = {PSA2_EVENT_LIST(BOARD_EVENT_NAME)};

/* The command tables, one of each file commands_*.c, in the order of help. */
#include "control/commands.h"

// clang-format off
const struct control_table *const control_tables[] = {
    &commands_bench, &commands_head, &commands_table, &commands_chamber, &commands_supply, &commands_platform,
    &commands_watch, &commands_probe, &commands_fault, &commands_snapshot, &commands_bus, NULL};
// clang-format on
const struct control_table *const control_truth_tables[] = {&commands_truth, NULL};

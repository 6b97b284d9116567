"""All lines of a board: each that has work moves, none is at a level for too short a time."""

from __future__ import annotations

from psabench.conform.capture.log import Capture
from psabench.conform.capture.pulses import all_move, bus_moves, none_is_too_short
from psabench.conform.plan import check
from psabench.conform.proves import row_for

MOVES = ("PSD1-SIG-02", "PMKA-SIG-03", "PIK-SIG-02", "GYRO-SIG-02")
SHORT = ("PSA2-SIG-18", "PSD1-SIG-03", "PMKA-SIG-04", "PIK-SIG-03", "PIK-SIG-04", "GYRO-SIG-03")


@check("stream", "PSD1-SIG-02", "PMKA-SIG-03", "PIK-SIG-02", needs={"pins"}, on_recording="")
def lines_of_a_reading_move(e: Capture) -> str:
    """Count edges of the lines that readings want."""
    return all_move(e, row_for(e, *MOVES))


@check("run", "GYRO-SIG-02", needs={"line"}, on_recording="")
def lines_of_a_run_move(e: Capture) -> str:
    """Count edges of the lines that a run of three positions wants."""
    return all_move(e, row_for(e, *MOVES))


@check("power_on", "PSD1-SIG-02", needs={"pins"}, on_recording="")
def lines_of_the_set_up_move(e: Capture) -> str:
    """Count edges of the lines that the set-up after Res wants."""
    return all_move(e, row_for(e, *MOVES), "_setup_count")


@check("strobes", "PSD1-SIG-02", "PMKA-SIG-03", needs={"pins", "bus"}, on_recording="")
def lines_of_a_cycle_move(e: Capture) -> str:
    """Look for edges of the lines of the bus that cycles want."""
    return bus_moves(e)


@check("stream", "PSA2-SIG-18", "PSD1-SIG-03", "PMKA-SIG-04", "PIK-SIG-03", "PIK-SIG-04", needs={"pins"})
def no_stay_of_a_line_is_too_short(e: Capture) -> str:
    """Measure how long each line stays at each level."""
    return none_is_too_short(e, row_for(e, *SHORT))


@check("run", "GYRO-SIG-03", needs={"line"})
def no_stay_of_a_line_of_a_run_is_too_short(e: Capture) -> str:
    """Measure how long each line stays at each level."""
    return none_is_too_short(e, row_for(e, *SHORT))

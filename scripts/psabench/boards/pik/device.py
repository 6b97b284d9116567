"""A PIK unit (PIK-5, PIK-6) over CAN: its pulse counters. Written from docs/reference/protocol_pik.md."""

from __future__ import annotations

from psabench.boards.readings import ReadingLayout
from psabench.boards.unit import BusUnit


class Pik(BusUnit):
    """One unit on the bus."""

    board = "pik"
    title = "PIK"
    layout = ReadingLayout(
        board="pik", messages=("PIK_COUNTS", "PIK_TOTALS", "PIK_TOTAL_Z"), counter="SEQ", stamp="TSTAMP"
    )

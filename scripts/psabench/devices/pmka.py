"""A PMKA unit over CAN: the codes of its integrators. Written from docs/protocol_pmka.md."""

from __future__ import annotations

from psabench.readings import ReadingLayout
from psabench.unit import BusUnit


class Pmka(BusUnit):
    """One unit on the bus."""

    board = "pmka"
    title = "PMKA"
    layout = ReadingLayout(board="pmka", messages=("PMKA_CODES", "PMKA_STATE"), counter="SEQ")

"""A TOY over CAN. Written from docs/reference/protocol_toy.md."""

from __future__ import annotations

from psabench.boards.readings import ReadingLayout
from psabench.boards.unit import BusUnit


class Toy(BusUnit):
    """One unit on the bus."""

    board = "toy"
    title = "TOY"
    layout = ReadingLayout(board="toy", messages=("TOY_SAMPLE",), counter="SEQ")

"""TOY as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import Beat, Board

LINES = ("FRAME", "CLK", "DATA")

BOARD = Board(
    name="toy",
    device="Toy",
    lines=LINES,
    port_lines=LINES,
    beat=Beat(rows={"TOY-CAN-02": "period_us"}, line="FRAME", level=0, message="TOY_SAMPLE", counter="SEQ"),
)

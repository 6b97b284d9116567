"""The satellite receiver as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import Beat, Board

LINES = ("PPS", "SOL", "TXD")

BOARD = Board(
    name="receiver",
    device="Receiver",
    lines=LINES,
    port_lines=LINES,
    beat=Beat(rows={"RECEIVER-CAN-02": "period_us"}, line="SOL", level=1, message="RECEIVER_TIME", counter="SEQ"),
    has_inputs=False,
    schedule_s=3.0,
)

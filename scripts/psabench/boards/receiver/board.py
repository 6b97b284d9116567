"""The satellite receiver as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import Beat, Board
from psabench.boards.session import GREEN, PURPLE, Decoder, Session, Stack, period_stack

LINES = ("PPS", "SOL", "TXD")

SESSION = Session(
    stacks=(
        Stack("Serial port", GREEN, (Decoder("uart", {"format": "ascii"}),), {"RX": "TXD"}),
        period_stack("Solutions", PURPLE, "SOL"),
    ),
    from_ns=119_000_000,
    scale="5e-05",
    comment="Opens on the first messages; the lines carry\nthe names of docs/boards/receiver.md.",
    gtk_from_ns=99_000_000,
    gtk_cursor_ns=120_000_000,
    groups={"Time": "PPS SOL", "Serial port": "TXD"},
)

BOARD = Board(
    name="receiver",
    device="Receiver",
    lines=LINES,
    port_lines=LINES,
    beat=Beat(rows={"RECEIVER-CAN-02": "period_us"}, line="SOL", level=1, message="RECEIVER_TIME", counter="SEQ"),
    has_inputs=False,
    schedule_s=3.0,
    session=SESSION,
)

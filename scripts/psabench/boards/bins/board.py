"""БИНС as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import Beat, Board
from psabench.boards.psa2.board import BOARD as PSA2_BOARD
from psabench.boards.psa2.board import SESSION as PSA2_SESSION
from psabench.boards.session import GREEN, Session, period_stack

SESSION = Session(
    stacks=(period_stack("Readings", GREEN, "TICK"),),
    from_ns=195_000_000,
    scale="2e-04",
    comment="Opens on the first readings; the lines carry\nthe names of docs/boards/bins.md.",
    gtk_from_ns=195_000_000,
    gtk_cursor_ns=200_000_000,
    groups={
        "Gyros": "TICK",
        **PSA2_SESSION.groups,
    },
)

BOARD = Board(
    name="bins",
    device="Bins",
    lines=(*PSA2_BOARD.lines, "TICK"),
    port_lines=("TICK", "Int", "Data", "CLK"),
    beat=Beat(
        rows={"BINS-CAN-02": "period_us"},
        line="TICK",
        level=1,
        message="BINS_GYRO_Z",
        counter="SEQ",
        stamp=("BINS_ACCEL_Z", "TSTAMP"),
    ),
    on_table=True,
    session=SESSION,
)

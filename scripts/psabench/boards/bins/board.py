"""БИНС as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import Beat, Board
from psabench.boards.session import GREEN, Session, period_stack

PSA2_LINES = tuple("SYNC_A SClk DRD_A DIn DOutX DOutY DOutZ SYNC_T CST DRD_T DInT DOutT Res Data CLK Int".split())

SESSION = Session(
    stacks=(period_stack("Readings", GREEN, "TICK"),),
    from_ns=195_000_000,
    scale="2e-04",
    comment="Opens on the first readings; the lines carry\nthe names of docs/boards/bins.md.",
    gtk_from_ns=195_000_000,
    gtk_cursor_ns=200_000_000,
    groups={
        "Gyros": "TICK",
        "Accelerometers": "SYNC_A SClk DRD_A DIn DOutX DOutY DOutZ",
        "Temperatures": "SYNC_T CST DRD_T DInT DOutT",
        "To the computer": "Res Int Data CLK",
    },
)

BOARD = Board(
    name="bins",
    device="Bins",
    lines=(*PSA2_LINES, "TICK"),
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

"""The gyro unit as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import Beat, Board, Setting
from psabench.boards.objects import GyroObjects
from psabench.boards.session import GREEN, Session, period_stack

LINES = ("STEP", "READY", "SLEW", "SETTLE", "WINDOW", "FAULT")

SESSION = Session(
    stacks=(period_stack("Steps", GREEN, "STEP"),),
    from_ns=195_000_000,
    scale="2e-04",
    comment="Opens on the first steps; the lines carry\nthe names of docs/boards/gyro.md.",
    gtk_from_ns=195_000_000,
    gtk_cursor_ns=200_000_000,
    groups={"Control loops": "STEP READY FAULT", "Gyrocompassing": "SLEW SETTLE WINDOW"},
)

BOARD = Board(
    name="gyro",
    device="Gyro",
    schedule_s=70.0,
    lines=LINES,
    port_lines=LINES,
    beat=Beat(rows={"GYRO-CAN-02": "period_us"}, line="STEP", level=1, message="GYRO_ANGLES", counter="STEP"),
    setting=Setting(index=GyroObjects.RUN, sub=1, value=bytes([2])),
    has_inputs=False,
    on_platform=True,  # it counts its seconds by its steps: no clock to be off
    session=SESSION,
)

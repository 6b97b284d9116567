"""The gyro unit as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import Beat, Board, Setting
from psabench.boards.objects import GyroObjects

LINES = ("STEP", "READY", "SLEW", "SETTLE", "WINDOW", "FAULT")

BOARD = Board(
    name="gyro",
    device="Gyro",
    lines=LINES,
    port_lines=LINES,
    beat=Beat(rows={"GYRO-CAN-02": "period_us"}, line="STEP", level=1, message="GYRO_ANGLES", counter="STEP"),
    setting=Setting(index=GyroObjects.RUN, sub=1, value=bytes([2])),
    has_inputs=False,  # it is on a platform; it counts its seconds by its steps: no clock to be off
)

"""A PSD-1 unit over CAN: the words of its read-out cycle, the cycles of its bus. Written from docs/protocol_psd1.md."""

from __future__ import annotations

from psabench.readings import ReadingLayout
from psabench.unit import BusUnit


class Psd1(BusUnit):
    """One unit on the bus.

    unit.stream(100)["X"]      # words of converter X
    unit.bus_read(3)           # a read cycle at address 3
    unit.also("PSD1_TIME")     # from now on readings have their instants: PSD1_GYRO, PSD1_RATE likewise
    """

    board = "psd1"
    title = "PSD-1"
    layout = ReadingLayout(board="psd1", messages=("PSD1_CYCLE",), counter="CNT", stamp="TSTAMP", overrun="OVERRUN")

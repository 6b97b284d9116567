"""A PSD-1 unit over CAN: words of its read-out cycle, cycles of its bus (docs/reference/protocol_psd1.md)."""

from __future__ import annotations

import numpy as np

from psabench.boards.readings import ReadingLayout, Readings
from psabench.boards.unit import BusUnit
from psabench.link.signals import Floats

FULL_SCALE_V = 10.0  # of the profiles: AIN2 of an AD7712, gain 1
OFFSET_BINARY = 0x8000  # the word of 0 V


def volts(words: Readings, full_scale_v: float = FULL_SCALE_V) -> Floats:
    """Voltages at the inputs X, Y, Z, shape (n, 3); full_scale_v: where the scenario has another input or converter."""
    codes = np.stack([words[axis] for axis in "XYZ"], axis=1)
    return np.asarray((codes - OFFSET_BINARY) * (full_scale_v / OFFSET_BINARY))


class Psd1(BusUnit):
    """One unit on the bus.

    unit.stream(100)["X"]      # words of converter X, LSB
    volts(unit.stream(100))    # (100, 3), V
    unit.bus_read(3)           # a read cycle at address 3
    unit.also("PSD1_TIME")     # from now on readings have their instants: the same for PSD1_GYRO, PSD1_RATE
    """

    board = "psd1"
    title = "PSD-1"
    layout = ReadingLayout(board="psd1", messages=("PSD1_CYCLE",), counter="CNT", stamp="TSTAMP", overrun="OVERRUN")

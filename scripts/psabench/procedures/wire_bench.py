"""The bench of the procedures over the wire: the board over CAN, the dividing head over SCPI."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from psabench.boards.psa2.device import SETTLE_PERIODS, Psa2
from psabench.estimate.face import Face
from psabench.instruments import Head
from psabench.procedures.command_line.offered import G_MPS2


class WireHead:
    """Moves and clock of a `procedures.head_bench.HeadBench`: units on one bus, and the head that turns them."""

    def __init__(self, units: Sequence[Psa2], head: Head, *, g_mps2: float) -> None:
        self.g_mps2 = g_mps2
        self._host = units[0].host
        self._head = head
        for unit in units:
            unit.wait_ready()
        self._period_s = max(1.0 / unit.data_hz for unit in units)
        self._settled_at_s = self.t_s

    @property
    def t_s(self) -> float:
        return self._host.clock.now_s()

    def turn(self, angle_deg: float) -> float:
        """Head to angle_deg; the time it takes to get there passes. Returns its scale, deg."""
        return self._rested(self._head.turn(angle_deg))

    def mount(self, face: Face) -> None:
        """Put the units on the head's mount with this face."""
        self._rested(self._head.mount(face))

    def _rested(self, scale_deg: float) -> float:
        """The head has come to rest just now: the filters settle from here."""
        self._settled_at_s = self.t_s + SETTLE_PERIODS * self._period_s
        return scale_deg

    def wait(self, dwell_s: float) -> None:
        if dwell_s > 0.0:
            self._host.advance(dwell_s)

    def wait_settled(self) -> None:
        """Until the filters have settled since the head's last move."""
        self.wait(self._settled_at_s - self.t_s)


class WireBench(WireHead):
    """A `procedures.head_bench.HeadBench` of a unit and the head that it is mounted on.

    average: settled samples in one reading, from the stream of 24-bit codes; 0: one whole 32-bit conversion word by
    SDO, for boards whose profile reads 32 bits. The known gain of the converters' filter is taken out of the readings.
    """

    def __init__(self, unit: Psa2, head: Head, *, average: int = 1, g_mps2: float = G_MPS2) -> None:
        super().__init__([unit], head, g_mps2=g_mps2)
        self._unit = unit
        self._average = average
        self.filter_gain = unit.filter_gain

    def read(self, axis: str, readings: int) -> npt.NDArray[np.float64]:
        """Settled readings, each the mean of `average` samples (or one whole word), volts at the load."""
        self.wait_settled()
        return self._read_v(axis, readings) / self.filter_gain

    def _read_v(self, axis: str, readings: int) -> npt.NDArray[np.float64]:
        if self._average:
            u_v = self._unit.stream(readings * self._average).axis(axis)
            return np.asarray(u_v.reshape(readings, self._average).mean(axis=1), dtype=np.float64)
        return np.array([self._word(axis) for _ in range(readings)])

    def _word(self, axis: str) -> float:
        self.wait(self._period_s)  # the next conversion
        return self._unit.words_v()["xyz".index(axis)]

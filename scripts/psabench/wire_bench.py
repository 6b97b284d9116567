"""The bench of the procedures over the wire: the board over CAN, the dividing head over the control socket."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from psabench.control import Control
from psabench.device import SETTLE_PERIODS, Psa2
from psabench.face import Face

G_MPS2 = 9.80665  # standard gravity (CGPM 1901); the site's own value is the user's to give


class WireBench:
    """A `psabench.bench.Bench`.

    average: settled samples in one reading, from the stream of 24-bit codes; 0: one whole 32-bit conversion word by
    SDO, for boards whose profile reads 32 bits.
    """

    def __init__(self, unit: Psa2, control: Control, *, average: int = 1, g_mps2: float = G_MPS2) -> None:
        self.g_mps2 = g_mps2
        self._unit = unit
        self._control = control
        self._average = average
        unit.wait_ready()
        self._period_s = 1.0 / unit.data_hz
        self._settle_s = SETTLE_PERIODS * self._period_s
        self._settled_at_s = self.t_s

    @property
    def t_s(self) -> float:
        return self._unit.host.clock.now_s()

    def turn(self, angle_deg: float) -> float:
        """Head to angle_deg; the time it takes to get there passes."""
        moved = self._control.call("head.turn", angle_deg=angle_deg).result
        return self._rest(float(moved["rest_in_s"]))

    def mount(self, face: Face) -> None:
        """Put the unit on the head's mount with this face."""
        moved = self._control.call("head.mount", face=face.value).result
        self._rest(float(moved["rest_in_s"]))

    def _rest(self, rest_in_s: float) -> float:
        """Wait until the head stands still; its scale, deg."""
        while rest_in_s > 0.0:
            self.wait(rest_in_s)
            rest_in_s = float(self._control.call("head.read").result["rest_in_s"])
        self._settled_at_s = self.t_s + self._settle_s
        return float(self._control.call("head.read").result["angle_deg"])

    def wait(self, dwell_s: float) -> None:
        if dwell_s > 0.0:
            self._unit.host.advance(dwell_s)

    def read(self, axis: str, readings: int) -> npt.NDArray[np.float64]:
        """Settled readings, each the mean of `average` samples (or one whole word)."""
        self.wait(self._settled_at_s - self.t_s)
        if self._average:
            u_v = self._unit.stream(readings * self._average).axis(axis)
            return np.asarray(u_v.reshape(readings, self._average).mean(axis=1), dtype=np.float64)
        return np.array([self._word(axis) for _ in range(readings)])

    def _word(self, axis: str) -> float:
        self.wait(self._period_s)  # the next conversion
        return self._unit.words_v()["xyz".index(axis)]

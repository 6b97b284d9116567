"""An inertial unit over CAN: raw increments of angle and velocity (docs/reference/protocol_bins.md).

unit = bench.board(Bins)
unit.wait_ready()
got = increments_of(unit.stream(6000), unit.weights())
got.dtheta_rad          # (n, 3), of each interval
got.dv_mps              # (n, 3)
got.end_s               # (n,), when each interval ended, the unit's clock
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np

from psabench.boards.objects import BinsObjects as OD
from psabench.boards.readings import ReadingLayout, ReadingReader, Readings
from psabench.boards.unit import TPDO_OFF, BusUnit, tpdos_of
from psabench.link.signals import Floats, Ints

RAD_PER_ARCSEC = np.pi / 648_000
NAV_MESSAGES = ("BINS_NAV_PLACE", "BINS_NAV_SPEED", "BINS_NAV_TURN", "BINS_NAV_RATE")
MESSAGES = ("BINS_GYRO_XY", "BINS_GYRO_Z", "BINS_ACCEL_XY", "BINS_ACCEL_Z")


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """What a count and a code are, nominally; and by how much the accelerometers' interval is older."""

    gyro_rad: float
    accel_mps: float
    age_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitIncrements:
    """n readings in SI, axes of the instrument; errors of the sensors are in them."""

    end_s: Floats  # (n,) end of the interval of dtheta, the unit's clock, unwrapped
    dtheta_rad: Floats  # (n, 3)
    dv_mps: Floats  # (n, 3)
    seq: Ints  # (n,) numbers of the readings: a step other than 1 is a loss
    whole: np.ndarray  # (n,) bool: settled, complete, of one period, within the range


def increments_of(readings: Readings, weights: Weights) -> UnitIncrements:
    """Readings as the unit sends them, in SI."""
    whole = (readings["SETTLED"] == 1) & (readings["CLIP"] + readings["INCOMPLETE"] + readings["STRETCHED"] == 0)
    return UnitIncrements(
        end_s=readings.t_sample_s,
        dtheta_rad=np.stack([readings[f"G{axis}"] for axis in "XYZ"], axis=1) * weights.gyro_rad,
        dv_mps=(np.stack([readings[f"A{axis}"] for axis in "XYZ"], axis=1) + readings["WORDS"][:, None] / 2)
        * weights.accel_mps,
        seq=np.asarray(readings["SEQ"], np.int64),
        whole=whole,
    )


class NavState(enum.IntEnum):
    """Object 2211h:2."""

    OFF = 0
    ALIGNING = 1
    NAVIGATING = 2
    FAILED = 3


class Bins(BusUnit):
    """One unit on the bus."""

    board = "bins"
    title = "BINS"
    layout = ReadingLayout(board="bins", messages=MESSAGES, counter="SEQ", stamp="TSTAMP", overrun="INCOMPLETE")

    def weights(self) -> Weights:
        """Objects 2220h and 2221h."""
        return Weights(
            gyro_rad=float(self.node.read(OD.WEIGHTS, 1)) * 1e-6 * RAD_PER_ARCSEC,
            accel_mps=float(self.node.read(OD.WEIGHTS, 2)) * 1e-9,
            age_s=float(self.node.read(OD.TIMING, 4)) * 1e-9,
        )

    def navigate(
        self, lat_deg: float, lon_deg: float, h_m: float, alignment_s: int, *, increments: bool = False
    ) -> ReadingReader:
        """Align at rest, then navigate from this place: what the unit gives out comes to the reader returned.

        increments: whether they are sent as well. Raises DeviceError before the first reading.
        """
        start = (round(lat_deg * 1e7), round(lon_deg * 1e7), round(h_m * 1e3), alignment_s)
        for sub, value in enumerate(start, start=1):
            self.node.write(OD.NAV_START, sub, value)
        self.node.write(OD.NAV_MODE, 1, 1)
        for name in MESSAGES:
            self._switch(name, on=increments)
        for name in NAV_MESSAGES:
            self._switch(name, on=True)
        layout = ReadingLayout(board=self.board, messages=NAV_MESSAGES, counter="NSEQ", stamp="NTIME")
        outputs = ReadingReader(layout, self.node.node_id)
        self.host.listeners.append(outputs.on_message, outputs.ids)
        return outputs

    def navigation(self) -> NavState:
        """What the unit's own navigation does."""
        return NavState(int(self.node.read(OD.NAV_MODE, 2)))

    def _switch(self, message: str, *, on: bool) -> None:
        index = tpdos_of(self.node)[message]
        bits = int(self.node.read(index, 1)) & ~TPDO_OFF
        self.node.write(index, 1, bits if on else bits | TPDO_OFF)

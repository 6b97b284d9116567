"""Readings of a PSA-2 as MAVLink messages: HIGHRES_IMU and our exact PSABENCH_ACCEL, at rates of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from psabench.boards.psa2.frames import Frames
from psabench.link.signals import Floats
from psabench.mavlink.dialect import mavlink

CODES = 2**23 / 10.0  # a volt at the load, nominal
IMU, ACCEL = 105, 54100  # message numbers
ACCEL_FIELDS = 7  # of HIGHRES_IMU.fields_updated
SETTLED, CLIP = 1, 2  # PSABENCH_STATUS
AXES = "xyz"


@dataclass(slots=True, kw_only=True)
class Scale:
    """From volts to acceleration: a = (u - zero) / factor, in local g. The sign is the board's: +g along gravity."""

    zero_v: Floats = field(default_factory=lambda: np.full(3, 2.5))
    v_per_g: Floats = field(default_factory=lambda: np.ones(3))
    g_mps2: float = 9.80665
    calibrated: bool = False

    def accel_mps2(self, u_v: Floats) -> Floats:
        """(n, 3) m/s² of (n, 3) volts."""
        return np.asarray((u_v - self.zero_v) / self.v_per_g * self.g_mps2)


@dataclass(slots=True)
class Rate:
    """How often a message goes out, in the time of its readings."""

    interval_s: float | None  # None: never; 0: each reading
    _next_s: float = -np.inf

    def due(self, t_s: float) -> bool:
        """On a grid, so that the rate is kept on average; after a pause a new grid begins."""
        if self.interval_s is None or (t_s < self._next_s and t_s > self._next_s - 10 * self.interval_s - 1.0):
            return False
        following_s = self._next_s + self.interval_s
        self._next_s = following_s if t_s < following_s < t_s + self.interval_s else t_s + self.interval_s
        return True


def hz(rate_hz: float) -> float | None:
    """Interval of a rate; 0 Hz: never."""
    return 1.0 / rate_hz if rate_hz > 0 else None


class Samples:
    """Sends what readings come to. `latest` of each kind is kept for clients that ask."""

    def __init__(self, send: Callable[[Any], None], scale: Scale, *, imu_hz: float, codes_hz: float | None) -> None:
        """codes_hz: None for each reading."""
        self.scale = scale
        self.rates = {IMU: Rate(hz(imu_hz)), ACCEL: Rate(0.0 if codes_hz is None else hz(codes_hz))}
        self.latest: dict[int, Any] = {}
        self.count = 0
        self.time_us = 0
        self._send = send

    def take(self, frames: Frames) -> None:
        """All readings of these frames, in order."""
        if not len(frames):
            return
        accel_mps2 = self.scale.accel_mps2(frames.u_v)
        codes = np.rint(frames.u_v * CODES).astype(int)
        for i in range(len(frames)):
            t_s = float(frames.t_rx_s[i])
            self.time_us = max(0, round(t_s * 1e6))
            if self.rates[ACCEL].due(t_s):
                self._out(ACCEL, self._accel(frames, i, codes[i].tolist(), accel_mps2[i].tolist()))
            if self.rates[IMU].due(t_s):
                self._out(IMU, self._imu(accel_mps2[i].tolist()))
            self.count += 1

    def _out(self, number: int, message: Any) -> None:
        self.latest[number] = message
        self._send(message)

    def _imu(self, accel_mps2: list[float]) -> Any:
        """Specific force, as autopilots have it: -g on an axis that points down."""
        x, y, z = (-a for a in accel_mps2)
        return mavlink().MAVLink_highres_imu_message(
            self.time_us, x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, ACCEL_FIELDS
        )

    def _accel(self, f: Frames, i: int, code: list[int], accel_mps2: list[float]) -> Any:
        status = SETTLED * bool(f.settled[i]) | CLIP * bool(f.clipped[i])
        return mavlink().MAVLink_psabench_accel_message(
            self.time_us,
            f.u_v[i].tolist(),
            accel_mps2,
            code,
            self.count & 0xFFFFFFFF,
            int(f.temp_code[i]),
            int(f.temp_channel[i]),
            status,
            int(self.scale.calibrated),
        )

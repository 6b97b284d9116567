"""The receiver's time of week on the clock of the increments.

Solutions say their time by the receiver's clock; when their last byte had come is known by the increments to within the
look at the port. Two states, offset and difference of rates, follow these arrivals; what passes from the instant of a
solution to its arrival is in the offset, and the host takes `latency_s` off. All limits are ours (E0).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

WEEK_S = 604_800.0


@dataclass(frozen=True, kw_only=True)
class ClockLimits:
    """E0."""

    latency_s: float = 0.03  # from a solution's instant to its last byte: computing, 92 bytes at 115200 bit/s
    rate_sd: float = 100e-6  # of the difference of two crystals
    rate_walk_rts: float = 1e-8  # of that difference: 1e-8 after 1 s
    floor_s: float = 0.003  # of an arrival: scheduling, the reading's own period
    sigmas: float = 5.0
    slack_s: float = 0.05  # that an arrival may be off besides: a program that was not scheduled
    jump_solutions: int = 5  # in a row that agree with none before: the receiver's time has jumped


@dataclass
class ReceiverClock:
    """x = (offset at the last solution, rate); increments' time = time of week + offset."""

    limits: ClockLimits = field(default_factory=ClockLimits)
    jumps: int = 0
    backwards: int = 0  # solutions not later than the one before
    stray: int = 0  # that came at another time than their own says
    _x: np.ndarray = field(default_factory=lambda: np.zeros(2))
    _p: np.ndarray = field(default_factory=lambda: np.zeros((2, 2)))
    _last_s: float | None = None  # time of week, unwrapped
    _stray_row: int = 0  # such solutions in a row that advance
    _stray_s: float = -math.inf  # time of week of the last of them

    def take(self, tow_s: float, arrived_s: float, width_s: float) -> float | None:
        """When the solution is of, by the increments. None: its time cannot be used.

        arrived_s: middle of the interval of the increments' clock in which its last byte came; width_s: its length.
        """
        at_s = self._unwrapped(tow_s)
        if self._last_s is None:
            self._begin(at_s, arrived_s, width_s)
            return self._time_of(at_s)
        if at_s <= self._last_s:
            self.backwards += 1
            return self._reject(tow_s, arrived_s, width_s)
        self._predict(at_s - self._last_s)
        self._last_s = at_s
        if not self._update(arrived_s - at_s, width_s):
            self.stray += 1
            return self._reject(tow_s, arrived_s, width_s)
        self._stray_row, self._stray_s = 0, -math.inf
        return self._time_of(at_s)

    @property
    def rate_ppm(self) -> float:
        """By how much the increments' clock is faster than the receiver's."""
        return float(self._x[1]) * 1e6

    @property
    def rate_sd_ppm(self) -> float:
        return math.sqrt(self._p[1, 1]) * 1e6

    def _unwrapped(self, tow_s: float) -> float:
        """Past the end of the week."""
        if self._last_s is None:
            return tow_s
        weeks = round((self._last_s - tow_s) / WEEK_S)
        return tow_s + weeks * WEEK_S

    def _time_of(self, at_s: float) -> float:
        return at_s + float(self._x[0]) - self.limits.latency_s

    def _begin(self, at_s: float, arrived_s: float, width_s: float) -> None:
        self._last_s, self._stray_row, self._stray_s = at_s, 0, -math.inf
        self._x = np.array([arrived_s - at_s, 0.0])
        self._p = np.diag([self._variance(width_s), self.limits.rate_sd**2])

    def _reject(self, tow_s: float, arrived_s: float, width_s: float) -> float | None:
        """After a row of them the receiver's time is believed as it is now: it has jumped. A frozen one is not."""
        self._stray_row = self._stray_row + 1 if tow_s > self._stray_s else 0
        self._stray_s = tow_s
        if self._stray_row < self.limits.jump_solutions:
            return None
        self.jumps += 1
        self._begin(tow_s, arrived_s, width_s)
        return None

    def _variance(self, width_s: float) -> float:
        return self.limits.floor_s**2 + width_s**2 / 12.0

    def _predict(self, dt_s: float) -> None:
        phi = np.array([[1.0, dt_s], [0.0, 1.0]])
        walk = self.limits.rate_walk_rts**2
        noise = walk * np.array([[dt_s**3 / 3.0, dt_s**2 / 2.0], [dt_s**2 / 2.0, dt_s]])
        self._x, self._p = phi @ self._x, phi @ self._p @ phi.T + noise

    def _update(self, offset_s: float, width_s: float) -> bool:
        """Whether the arrival agrees."""
        off, variance = offset_s - float(self._x[0]), float(self._p[0, 0]) + self._variance(width_s)
        if abs(off) > self.limits.sigmas * math.sqrt(variance) + self.limits.slack_s:
            return False
        gain = self._p[:, 0] / variance
        self._x = self._x + gain * off
        self._p = self._p - np.outer(gain, self._p[0])
        return True

"""When a unit is at rest, by its own increments and its speed: then it measures zero velocity."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from psabench.link.signals import Floats


@dataclass(frozen=True, kw_only=True)
class StopLimits:
    """E0. Sway in wind of 0.05 deg by 2.5 s turns by up to 0.13 deg/s."""

    speed_mps: float = 0.5  # of the hybrid solution
    rate_radps: float = 0.005  # on average over a second
    change_mps2: float = 0.05  # of the mean force, from one second to the next
    seconds: int = 2  # in a row


@dataclass
class StopDetector:
    """Fed second by second, from rest."""

    limits: StopLimits = field(default_factory=StopLimits)
    _before: Floats | None = None
    _quiet: int | None = None  # seconds; None: none was seen

    def take(self, dtheta_rad: Floats, dv_mps: Floats, sample_s: float, speed_mps: float) -> bool:
        """Whether the unit is at rest at the end of these increments, (n, 3) each."""
        whole_s = len(dtheta_rad) * sample_s
        rate, force = dtheta_rad.sum(axis=0) / whole_s, dv_mps.sum(axis=0) / whole_s
        still = self._before is None or bool(np.abs(force - self._before).max() < self.limits.change_mps2)
        still = still and bool(np.abs(rate).max() < self.limits.rate_radps) and speed_mps < self.limits.speed_mps
        self._before = force
        quiet = self.limits.seconds if self._quiet is None else self._quiet
        self._quiet = quiet + 1 if still else 0
        return self._quiet >= self.limits.seconds

"""A unit of three quartz accelerometers on a dividing head in a chamber, in memory: what a thermal run asks of a bench.

The zero is that of `quartz_units`, a second writing of the article's law; lags by steps of a second. Nothing is shared
with the emulator or the estimators.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from psabench.estimate.face import Face
from psabench.thermal.bench import Sample
from psabench.thermal.schedule import Position
from quartz_units import QuartzUnit

UNITS = (
    QuartzUnit(zero=100.0, hump=-300.0, centre_c=10.0, width_k=57.0, slope_per_k=0.1),
    QuartzUnit(zero=-80.0, hump=400.0, centre_c=6.0, width_k=55.0, slope_per_k=-0.2),
    QuartzUnit(zero=60.0, hump=-150.0, centre_c=16.0, width_k=60.0, slope_per_k=0.0),
)
GRAVITY = {Face.DIRECT: (0, 1), Face.SIDE: (0, 2)}  # axes in the plane of turning: along -sin, -cos of the angle


@dataclass(kw_only=True)
class FakeThermalBench:
    """Lags of a tenth of the article's, so that a sweep is short. Faults are fields."""

    start_c: float = 25.0
    case_tau_s: float = 18.0
    element_tau_s: float = 36.0
    scale_v_per_g: float = 1.19
    scale_ppm_per_k: float = 20.0
    base_arcsec: float = 5.0  # of each axis towards the next one
    noise_v: float = 2e-7  # of a recording
    head_arcsec: float = 2.0  # rms, which the scale shows
    rate_part: float = 1.0  # of its ramp that the chamber makes
    readout_k: float = 0.0
    stuck_deg: float | None = None  # where the head stays
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(1))
    t_s: float = 0.0

    def __post_init__(self) -> None:
        self.air_c = self.case_c = self.element_c = self.target_c = self.start_c
        self.ramp = 1.0
        self._angle_deg, self._face = 0.0, Face.DIRECT

    def wait_until(self, t_s: float) -> None:
        while self.t_s < t_s - 1e-9:
            step_s = min(1.0, t_s - self.t_s)
            way = self.ramp * self.rate_part / 60.0 * step_s
            self.air_c += float(np.clip(self.target_c - self.air_c, -way, way))
            self.case_c += (self.air_c - self.case_c) * (1.0 - np.exp(-step_s / self.case_tau_s))
            self.element_c += (self.case_c - self.element_c) * (1.0 - np.exp(-step_s / self.element_tau_s))
            self.t_s += step_s

    def set_chamber(self, temp_degc: float, ramp_k_per_min: float) -> None:
        self.target_c, self.ramp = temp_degc, ramp_k_per_min

    def chamber_degc(self) -> float:
        return self.air_c + self.readout_k

    def turn(self, position: Position) -> float:
        self._face = position.face
        self._angle_deg = position.set_deg + self.head_arcsec / 3600.0 * self.rng.standard_normal()
        if self.stuck_deg is not None:
            self._angle_deg = self.stuck_deg
        return self._angle_deg

    def record(self, seconds: float) -> Sample:
        made = Sample(
            t_s=self.t_s + seconds / 2.0,
            u_v=self.true_v() + self.noise_v * self.rng.standard_normal(3),
            sd_v=np.full(3, self.noise_v),
            temps_degc=np.array([self.element_c] * 3 + [self.case_c]),
        )
        self.wait_until(self.t_s + seconds)
        return made

    def gravity_g(self) -> np.ndarray:
        """On the axes of the unit."""
        a = np.zeros(3)
        along, across = GRAVITY[self._face]
        a[along], a[across] = -np.sin(np.radians(self._angle_deg)), -np.cos(np.radians(self._angle_deg))
        return a

    def true_v(self) -> np.ndarray:
        """Volts at the loads, here and now."""
        a = self.gravity_g()
        base = np.radians(self.base_arcsec / 3600.0)
        zero_g = np.array([float(u.zero_ug(np.array(self.element_c))) for u in UNITS]) * 1e-6
        zero_g += 1e-6 * (self.case_c - self.element_c)  # 1 ug/K of gradient
        scale = self.scale_v_per_g * (1.0 + self.scale_ppm_per_k * 1e-6 * (self.element_c - 30.0))
        return np.asarray(scale * (a + base * np.roll(a, -1) + zero_g))

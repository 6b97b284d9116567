"""The heading indicator in three modes over one flight: as its prototype works, and as the article makes it.

magnetic: aligned by the induction sensor and the declination on its setter, and slaved to them in flight. half-compass:
aligned the same way, then by the gyroscope alone, with the Earth's rate of the latitude on its panel. self-orienting:
gyrocompassing and its own drift, then the hold. docs/procedures/heading_modes.md
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from psabench.errors import expected
from psabench.estimate.angles import wrapped
from psabench.native import nav
from psabench.native.nav import DEGPH, EARTH_RADIUS_M
from psabench.procedures import gyrocompass, heading_hold
from psabench.procedures.gyrocompass_params import GyrocompassParams
from psabench.procedures.head_bench import Progress, Silent
from psabench.procedures.heading_hold import HoldParams
from psabench.procedures.platform_bench import Compensation, Floats, PlatformBench
from psabench.procedures.result import option

NAME = "heading-modes"
MAGNETIC, HALF_COMPASS, SELF_ORIENTING = MODES = ("magnetic", "half-compass", "self-orienting")
LEVEL_S = 60.0
ALIGN_LOOK_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeParams:
    """The flight, what the crew does, and the prototype's figures; all of them but the 4 h are ours (E0)."""

    hours: float = option(4.0, "h", "time of the flight")
    speed_kmh: float = option(500.0, "km/h", "ground speed, to the north")
    accel_mps2: float = option(2.0, "m/s2", "acceleration of the take-off")
    latitude_deg: float = option(50.0, "deg", "latitude of the runway")
    look_s: float = option(60.0, "s", "interval between two readings of the heading, and of the slaving")
    fix_s: float = option(1800.0, "s", "interval between two settings of the latitude panel and the declination setter")
    panel_step_deg: float = option(1.0, "deg", "division of the latitude panel; 0: none")
    setter_step_deg: float = option(1.0, "deg", "division of the declination setter; 0: none")
    declination_deg: float = option(8.0, "deg", "declination on the chart at the runway")
    declination_slope: float = option(0.3, "", "its change on the chart, degrees per degree of latitude")
    align_s: float = option(10.0, "s", "averaging of the magnetic heading in the alignment")
    slave_s: float = option(300.0, "s", "time constant of the slaving")
    slave_limit_dpm: float = option(1.5, "deg/min", "largest rate of the slaving")
    drift1_degph: float = option(25.0, "deg/h", "drift about x that the workshop compensated")
    drift2_degph: float = option(25.0, "deg/h", "drift about z that the workshop compensated")

    def __post_init__(self) -> None:
        for name in ("hours", "speed_kmh", "look_s", "fix_s", "align_s", "slave_s", "accel_mps2"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(expected("a number above 0", getattr(self, name), name))
        for name in ("panel_step_deg", "setter_step_deg", "slave_limit_dpm"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(expected("a number from 0 on", getattr(self, name), name))
        if not (self.latitude_deg >= -80.0 and self.farthest_deg <= 80.0):
            raise ValueError(expected("a flight within -80 to 80 deg of latitude", f"{self.farthest_deg:.1f}", NAME))

    @property
    def speed_mps(self) -> float:
        return self.speed_kmh / 3.6

    @property
    def looks_s(self) -> Floats:
        """Instants of the readings since the flight began, the first at its beginning."""
        return np.asarray(np.arange(round(self.hours * 3600.0 / self.look_s) + 1) * self.look_s, dtype=np.float64)

    @property
    def align_looks(self) -> int:
        return max(1, round(self.align_s / ALIGN_LOOK_S))

    @property
    def farthest_deg(self) -> float:
        return float(self.latitudes_deg(np.array([self.hours * 3600.0]))[0])

    def latitudes_deg(self, t_s: Floats) -> Floats:
        """Where the vehicle is: it gathers speed, then flies along a meridian."""
        ramp_s = self.speed_mps / self.accel_mps2
        way_m = np.where(
            t_s < ramp_s, 0.5 * self.accel_mps2 * np.minimum(t_s, ramp_s) ** 2, self.speed_mps * (t_s - 0.5 * ramp_s)
        )
        return np.asarray(self.latitude_deg + np.degrees(way_m / EARTH_RADIUS_M))

    def panel_deg(self, t_s: Floats) -> Floats:
        """Latitude on the panel: that of the middle of its interval, on a division."""
        return _on_division(self.latitudes_deg(self._middle_s(t_s)), self.panel_step_deg)

    def setter_deg(self, t_s: Floats) -> Floats:
        """Declination on the setter, in the same way."""
        north_deg = self.latitudes_deg(self._middle_s(t_s)) - self.latitude_deg
        return _on_division(self.declination_deg + self.declination_slope * north_deg, self.setter_step_deg)

    def _middle_s(self, t_s: Floats) -> Floats:
        return np.asarray((np.floor(t_s / self.fix_s) + 0.5) * self.fix_s)


def _on_division(x: Floats, step: float) -> Floats:
    return np.asarray(np.round(x / step) * step if step else x)


class ModeBench(PlatformBench, Protocol):
    """A platform with an induction sensor beside it."""

    def encoder_rad(self) -> float:
        """Of the outer gimbal, now."""
        ...

    def magnetic_rad(self) -> float:
        """Heading by the induction sensor, now. Raises LinkError where none is fitted."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """What a mode showed."""

    mode: str
    ready_s: float  # from power to the heading
    t_s: Floats  # since the flight began
    heading_rad: Floats
    doubts: tuple[str, ...] = ()


def slaved_rad(correction_rad: float, error_rad: float, p: ModeParams, dt_s: float) -> float:
    """The correction of the gyroscope's heading after dt_s, with the error of the heading that was shown."""
    limit_rad = math.radians(p.slave_limit_dpm) / 60.0 * dt_s
    step_rad = error_rad * -math.expm1(-dt_s / p.slave_s)
    return correction_rad + max(-limit_rad, min(limit_rad, step_rad))


def fly_mode(
    bench: ModeBench,
    mode: str,
    p: ModeParams,
    compass: GyrocompassParams,
    *,
    progress: Progress | None = None,
    depart: Callable[[], None] = lambda: None,
    watch: Callable[[], None] = lambda: None,
) -> Flown:
    """One mode from power-on to the end of the flight.

    compass: of the self-orienting mode. depart: sets the vehicle in motion; watch: called after each reading.
    """
    if mode not in MODES:
        raise ValueError(expected(", ".join(MODES), repr(mode), "mode"))
    if mode == SELF_ORIENTING:
        return _self_orienting(bench, p, compass, progress or Silent(), depart, watch)
    return _by_magnetic(bench, mode, p, depart, watch)


def _self_orienting(
    bench: ModeBench,
    p: ModeParams,
    compass: GyrocompassParams,
    progress: Progress,
    depart: Callable[[], None],
    watch: Callable[[], None],
) -> Flown:
    start = gyrocompass.estimate(gyrocompass.measure(bench, compass, progress), compass)
    ready_s = bench.t_s
    hold = HoldParams(hours=p.hours, look_s=p.fix_s / 6.0, speed_kmh=p.speed_kmh, track_deg=0.0)
    held = heading_hold.hold(bench, start, hold, progress, watch=lambda _: watch(), depart=depart).held
    return Flown(
        mode=SELF_ORIENTING,
        ready_s=ready_s,
        t_s=np.array([h.t_s for h in held]),
        heading_rad=np.array([h.heading_rad for h in held]),
        doubts=(*start.doubts, *dict.fromkeys(words for h in held for words in h.faults)),
    )


def align_heading(bench: ModeBench, p: ModeParams) -> float:
    """Heading by the induction sensor and the setter: the mean direction over the averaging time, rad."""
    east = north = 0.0
    for _ in range(p.align_looks):
        bench.wait(ALIGN_LOOK_S)
        shown_rad = bench.magnetic_rad()
        east, north = east + math.sin(shown_rad), north + math.cos(shown_rad)
    return wrapped(math.atan2(east, north) + math.radians(float(p.setter_deg(np.zeros(1))[0])))


def _by_magnetic(
    bench: ModeBench, mode: str, p: ModeParams, depart: Callable[[], None], watch: Callable[[], None]
) -> Flown:
    """Of the vehicle's tilt the prototype knows nothing: alpha is the gimbal's angle less the heading."""
    bench.prepare(latitude_rad=math.radians(float(p.panel_deg(np.zeros(1))[0])), m1_per_s=1.0, m2_per_s=2.0)
    bench.level(LEVEL_S)
    heading_rad = align_heading(bench, p)
    ready_s = bench.t_s
    azimuth_rad = wrapped(bench.encoder_rad() - heading_rad)
    drifts = {"drift1_radps": p.drift1_degph * DEGPH, "drift2_radps": p.drift2_degph * DEGPH}
    bench.navigate(Compensation(azimuth_rad=azimuth_rad, **drifts))
    begun_s, correction_rad, shown = bench.t_s, 0.0, []
    depart()
    for t_s in p.looks_s:
        bench.wait(begun_s + float(t_s) - bench.t_s)
        gyro_rad = nav.heading(azimuth_rad, bench.encoder_rad())
        if mode == MAGNETIC and t_s:
            error_rad = wrapped(_by_sensor(bench, p, float(t_s)) - gyro_rad - correction_rad)
            correction_rad = slaved_rad(correction_rad, error_rad, p, p.look_s)
        shown.append(wrapped(gyro_rad + correction_rad))
        watch()
        panel_rad = math.radians(float(p.panel_deg(np.array([t_s]))[0]))
        bench.moved(latitude_rad=panel_rad, speed_mps=0.0, track_rad=0.0)
    return Flown(mode=mode, ready_s=ready_s, t_s=p.looks_s, heading_rad=np.array(shown))


def _by_sensor(bench: ModeBench, p: ModeParams, t_s: float) -> float:
    return bench.magnetic_rad() + math.radians(float(p.setter_deg(np.array([t_s]))[0]))

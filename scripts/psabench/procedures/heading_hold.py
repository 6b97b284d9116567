"""Heading hold: after gyrocompassing the platform navigates by its gyroscope alone, drifts compensated, for hours.

`hold` starts navigation from a `GyrocompassResult` and looks at the instrument from time to time. How the error grows,
and which drift has to be compensated: docs/procedures/gyrocompass.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from psabench.budget.gum import combined_u, expanded_u
from psabench.errors import LinkError, expected
from psabench.estimate.angles import wrapped
from psabench.estimate.uncertainty import Component
from psabench.native import nav
from psabench.native.nav import EARTH_RADIUS_M, LATITUDE_LIMIT_RAD
from psabench.procedures.gyrocompass import GyrocompassResult
from psabench.procedures.gyrocompass_fit import drift_variance
from psabench.procedures.gyrocompass_params import noise_of
from psabench.procedures.head_bench import Progress
from psabench.procedures.platform_bench import Compensation, Look, PlatformBench
from psabench.procedures.result import option

NAME = "heading-hold"

DRIFTS = ("torquer", "axis1", "none")
SDS = 5.0  # of what the hold is expected to be off by
PARKED_RAD = math.radians(0.2)  # beside them a parked vehicle's heading may wander so far: sway
DRIFT_ANGLE_RAD = math.radians(20.0)  # and a flying one's be so far from its track: wind
UNDER_WAY_S = 120.0  # after which it is on its track


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldParams:
    """Parameters of `heading-hold`, besides those of `gyrocompass`."""

    hours: float = option(4.0, "h", "time of the heading hold")
    look_s: float = option(300.0, "s", "interval between two readings of the heading")
    compensate: str = option(
        "torquer", "", f"drift of the azimuth axis: {', '.join(DRIFTS)}; axis1 is the article's trap"
    )
    speed_kmh: float = option(0.0, "km/h", "ground speed; 0: parked")
    track_deg: float = option(90.0, "deg", "track of the flight")

    def __post_init__(self) -> None:
        if self.compensate not in DRIFTS:
            raise ValueError(expected(", ".join(DRIFTS), repr(self.compensate), "compensate"))
        if not 0.0 < self.look_s <= self.hours * 3600.0:
            raise ValueError(expected(f"0 to hours, {self.hours:g} h", self.look_s, "look_s"))
        if self.speed_kmh < 0.0:
            raise ValueError(expected("0 or more", self.speed_kmh, "speed_kmh"))

    @property
    def speed_mps(self) -> float:
        return self.speed_kmh / 3.6

    @property
    def track_rad(self) -> float:
        return math.radians(self.track_deg)

    @property
    def looks(self) -> int:
        return max(1, round(self.hours * 3600.0 / self.look_s))


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """The heading at an instant of the hold."""

    t_s: float  # since navigation began
    heading_rad: float
    budget: tuple[Component, ...]  # of what it is off by, rad
    faults: tuple[str, ...]

    @property
    def sd_rad(self) -> float:
        """Combined standard uncertainty."""
        return combined_u(self.budget)

    @property
    def u_rad(self) -> float:
        """Expanded uncertainty: half a turn at most."""
        return min(expanded_u(self.budget), math.pi)


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldResult:
    """A hold with what it started from."""

    params: HoldParams
    start: GyrocompassResult
    drift2_radps: float  # that was compensated
    held: tuple[Held, ...]  # the first at its beginning

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons not to trust the heading at the end."""
        return (
            *self.start.doubts,
            *dict.fromkeys(words for h in self.held for words in h.faults),
            *self._wandered,
            *self._off_track,
        )

    @property
    def _wandered(self) -> tuple[str, ...]:
        """A parked vehicle does not turn: its heading may move by what the drift leaves, no more."""
        if self.params.speed_mps or self.params.compensate != "torquer":
            return ()
        for h in self.held[1:]:
            moved_rad = wrapped(h.heading_rad - self.held[0].heading_rad)
            if abs(moved_rad) > SDS * _turn_sd_rad(self.start, h.t_s) + PARKED_RAD:
                return (
                    f"the heading moved by {math.degrees(moved_rad):.2f} deg in {h.t_s:.0f} s of standing, more "
                    "than the drift that was left: the vehicle turned, or azimuth torquer or angle sensor failed",
                )
        return ()

    @property
    def _off_track(self) -> tuple[str, ...]:
        """The heading of a flying vehicle is its track but for the wind."""
        under_way = [h for h in self.held[1:] if h.t_s >= UNDER_WAY_S] if self.params.speed_mps else []
        for h in under_way:
            off_rad = wrapped(h.heading_rad - self.params.track_rad)
            if abs(off_rad) > SDS * h.sd_rad + DRIFT_ANGLE_RAD:
                return (
                    f"the heading is {math.degrees(off_rad):.0f} deg from the track after {h.t_s:.0f} s, more than the "
                    "drift that was left and wind: the angle sensor is stuck, or the heading was wrong from the start",
                )
        return ()


def hold(
    bench: PlatformBench,
    start: GyrocompassResult,
    p: HoldParams,
    progress: Progress,
    *,
    watch: Callable[[Held], None] = lambda _: None,
    depart: Callable[[], None] = lambda: None,
) -> HoldResult:
    """Navigate from the heading that was found. watch: gets each look as it comes; depart: sets the vehicle in motion.

    Raises LinkError where the platform fails.
    """
    first = bench.look()
    if first.faults:
        raise LinkError(f"{NAME}: navigation did not begin: {'; '.join(first.faults)}")
    azimuth_rad = _alpha(start, first)
    drift1_radps, latitude_rad = start.drift1.level_radps, start.params.latitude_rad
    drift2_radps = {"torquer": start.drift2.level_radps, "axis1": drift1_radps, "none": 0.0}[p.compensate]
    _tell(bench, p, latitude_rad)
    bench.navigate(Compensation(azimuth_rad=azimuth_rad, drift1_radps=drift1_radps, drift2_radps=drift2_radps))
    begun_s = bench.t_s
    held: list[Held] = []

    def look() -> None:
        level = bool(p.speed_mps and held)
        held.append(_held(bench.look(), azimuth_rad, begun_s, start, level))
        watch(held[-1])

    look()
    if p.speed_mps:
        depart()
    with progress.step("keeping heading", p.looks) as done:
        for k in range(p.looks):
            bench.wait(begun_s + (k + 1) * p.look_s - bench.t_s)
            look()
            latitude_rad = _moved(latitude_rad, p)
            _tell(bench, p, latitude_rad)
            done()
    return HoldResult(params=p, start=start, drift2_radps=drift2_radps, held=tuple(held))


def _alpha(start: GyrocompassResult, look: Look) -> float:
    """alpha of the levelled platform now, from the heading found and the encoder."""
    a = start.attitude
    return nav.alpha(psi_rad=start.heading_rad, q_rad=look.encoder_rad, pitch_rad=a.pitch_rad, roll_rad=a.roll_rad)


def _held(look: Look, azimuth_rad: float, begun_s: float, start: GyrocompassResult, level: bool) -> Held:
    """Heading of a vehicle that is parked as it stood, or flies level."""
    a = start.attitude
    pitch, roll = (0.0, 0.0) if level else (a.pitch_rad, a.roll_rad)
    t_s = look.t_s - begun_s
    return Held(
        t_s=t_s,
        heading_rad=nav.heading(azimuth_rad, look.encoder_rad, pitch_rad=pitch, roll_rad=roll),
        budget=hold_budget(start, t_s),
        faults=look.faults,
    )


def hold_budget(start: GyrocompassResult, t_s: float) -> tuple[Component, ...]:
    """Of a heading t_s after navigation began, rad: heading and drift as they were found, and the drift afterwards."""
    heading = (replace(c, u=math.radians(c.u)) for c in start.get("heading_deg").budget)
    constant = (replace(c, name=f"{c.name} in ω_d2", u=c.u * t_s) for c in start.drift2.constant)
    return (*heading, Component(name="drift", u=_turn_sd_rad(start, t_s)), *constant)


def _turn_sd_rad(start: GyrocompassResult, t_s: float) -> float:
    """What the drift that is left turns the platform by: the error of its mean over the windows, and what the random
    drift does after them. A hold begins as the last window ends.
    """
    wandered = drift_variance(start.drift2, noise_of(start.params, 0.0), t_s)
    return t_s * math.hypot(start.drift2.sd_radps, math.sqrt(wandered))


def _tell(bench: PlatformBench, p: HoldParams, latitude_rad: float) -> None:
    """Of the middle of the next leg: between two looks the controller goes on with what it has."""
    middle = _moved(latitude_rad, p, 0.5)
    bench.moved(latitude_rad=middle, speed_mps=p.speed_mps, track_rad=p.track_rad)


def _moved(latitude_rad: float, p: HoldParams, part: float = 1.0) -> float:
    """Latitude after that part of a leg, over a sphere."""
    new = latitude_rad + part * p.look_s * p.speed_mps * math.cos(p.track_rad) / EARTH_RADIUS_M
    return max(-LATITUDE_LIMIT_RAD, min(LATITUDE_LIMIT_RAD, new))

"""What the gyrocompass procedures may ask of a bench with a gyro-stabilised platform, and what they get.

A procedure is written against `PlatformBench`; it then runs on a gyro unit over CAN (`wire_platform`) and on the
platform in memory of the tests. Angles in rad, rates in rad/s; frames and signs as in docs/procedures/gyrocompass.md:
alpha about the vertical, counter-clockwise seen from above, beta about the axis of suspension, gamma about the
longitudinal axis, q of the outer gimbal.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from psabench.errors import expected

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A run of positions, and how each is gone through."""

    angles_deg: tuple[float, ...]  # of the gimbal, in the order of measurement
    repeat: int = 1
    window_s: float = 10.0
    settle_s: float = 10.0
    slew_dps: float = 9.0
    settle_limit_s: float = 30.0
    freeze: bool = False  # no azimuth servo in a window

    @property
    def sequence_deg(self) -> tuple[float, ...]:
        """All positions of the run."""
        return self.angles_deg * self.repeat


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """One window as the wire told it, a row of each array a step of the controller."""

    number: int  # of the run, from 0
    set_rad: float  # the gimbal angle that was asked for
    t_mid_s: float
    beta_rad: Floats  # (n,) of the level sensors
    gamma_rad: Floats
    u1_radps: Floats  # (n,) asked of the torquers: levelling
    u2_radps: Floats  # azimuth
    encoder_rad: Floats
    turned_rad: Floats  # by the torquers about the vertical since the run began, drifts and Earth not taken off
    missed: int  # readings lost since the run began, up to its end
    step_s: float  # of the controller: a reading each
    m1_per_s: float  # of the levelling loop
    latitude_rad: float  # that the controller was reported
    lost: int = 0  # frames or readings missing in it
    saturated: bool = False
    level_lost: bool = False
    encoder_fault: bool = False
    not_settled: bool = False

    def __post_init__(self) -> None:
        if not len(self.beta_rad):
            raise ValueError(expected("readings in the window", "none"))

    @property
    def length_s(self) -> float:
        return len(self.beta_rad) * self.step_s

    @property
    def mean_beta_rad(self) -> float:
        return float(self.beta_rad.mean())

    @property
    def mean_gamma_rad(self) -> float:
        return float(self.gamma_rad.mean())

    @property
    def mean_encoder_rad(self) -> float:
        """Of an angle that may pass half a turn: within one turn of the first."""
        return float(np.unwrap(self.encoder_rad).mean())

    @property
    def levelling_radps(self) -> Floats:
        """S of each step: what levelling asks of the torquer, without the compensation of gamma, eq. (8)."""
        return np.asarray(-self.m1_per_s * self.beta_rad)

    @property
    def faults(self) -> tuple[str, ...]:
        """Why nothing may be concluded from it, in words; (): it is good."""
        found = (
            (self.lost > 0, f"{self.lost} frames or readings were lost in it"),
            (self.level_lost, "the level sensors were silent or lost a frame"),
            (self.encoder_fault, "the angle sensor did not follow the torquer: it is stuck"),
            (self.not_settled, "the platform had not settled before it"),
            (self.saturated, "a torquer was at its limit"),
        )
        return tuple(words for there, words in found if there)


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """What the instrument shows at an instant of the hold."""

    t_s: float
    encoder_rad: float
    heading_rad: float  # as the unit itself has it, of a level vehicle
    faults: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Compensation:
    """What navigation is given, once it is known."""

    azimuth_rad: float  # alpha of the platform at this instant
    drift1_radps: float
    drift2_radps: float


class PlatformBench(Protocol):
    """A platform on a vehicle, with its controller. Raises LinkError where it fails, BadInput where it cannot do it."""

    @property
    def t_s(self) -> float:
        """Bench time, s: simulated or wall, monotonic."""
        ...

    def prepare(self, *, latitude_rad: float, m1_per_s: float, m2_per_s: float) -> None:
        """Settings of the loops; no compensation."""
        ...

    def level(self, timeout_s: float) -> None:
        """Level the platform. Raises LinkError when it has not settled within timeout_s."""
        ...

    def measure(self, table: Table, done: Callable[[Window], None]) -> Sequence[Window]:
        """Go through the positions; `done` gets each window when it is over.

        Raises LinkError when the run ends before its last window.
        """
        ...

    def calibrate(self, length_s: float, settle_s: float) -> Window:
        """One window where the platform is."""
        ...

    def navigate(self, c: Compensation) -> None:
        """Keep heading by the gyroscope alone from now on."""
        ...

    def moved(self, *, latitude_rad: float, speed_mps: float, track_rad: float) -> None:
        """Tell the controller where the vehicle is and how it moves."""
        ...

    def look(self) -> Look:
        """At the instrument."""
        ...

    def wait(self, dwell_s: float) -> None:
        """Let the bench's time pass."""
        ...

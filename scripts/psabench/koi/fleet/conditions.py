"""What goes wrong with the receiver in a flight: each is a row of the table of harm. All sizes are E0.

A condition that begins and ends does so on the ground in one half of the flights and in the air in the other, drawn.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from psabench.koi.fleet.routes import Journey

USUAL = "clean"


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """Nothing but what is set is wrong."""

    title: str
    lasts_s: float = 0.0  # of outage, ramp and step; 0: all the flight
    outage: bool = False
    ramp_mps: float = 0.0  # position and velocity leave the truth together, by this speed
    step_m: float = 0.0  # in position alone
    late_s: float = 0.0  # more than the delay that the receiver has; below zero: early
    lever_m: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the antenna, ahead, right, down; the host knows of none
    slow_mps: float = 0.0  # further slow error of the velocity
    slow_s: float = 60.0


CONDITIONS: Mapping[str, Condition] = {
    USUAL: Condition(title="none"),
    "outage": Condition(title="no solution for 5 min", lasts_s=300.0, outage=True),
    "spoof": Condition(title="ramp of 2 m/s for 5 min", lasts_s=300.0, ramp_mps=2.0),
    "slow-spoof": Condition(title="ramp of 0.3 m/s for 5 min", lasts_s=300.0, ramp_mps=0.3),
    "jump": Condition(title="step of 100 m for 5 min", lasts_s=300.0, step_m=100.0),
    "late": Condition(title="all solutions 0.5 s later", late_s=0.5),
    "early": Condition(title="all solutions 0.5 s earlier", late_s=-0.5),
    "lever": Condition(title="lever arm of 5 m ahead, 2 m up", lever_m=(5.0, 0.0, -2.0)),
    "slow-velocity": Condition(title="velocity off by 0.1 m/s, 60 s", slow_mps=0.1, slow_s=60.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Episode:
    """When a condition holds, and whereto it points."""

    begin_s: float
    end_s: float
    azimuth_rad: float


def draw_episode(c: Condition, j: Journey, parked_s: float, rng: np.random.Generator) -> Episode:
    """Of a flight. The same number of draws for each condition."""
    on_ground, at, azimuth_rad = rng.random() < 0.5, rng.random(), rng.uniform(0.0, 2.0 * math.pi)
    if not c.lasts_s:
        return Episode(begin_s=0.0, end_s=math.inf, azimuth_rad=azimuth_rad)
    low, high = (parked_s, j.run_s - c.lasts_s / 2.0) if on_ground else (j.take_off_s, j.seconds - c.lasts_s)
    begin_s = low + at * max(0.0, high - low)
    return Episode(begin_s=begin_s, end_s=begin_s + c.lasts_s, azimuth_rad=azimuth_rad)

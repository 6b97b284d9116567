"""Attitudes and rates of the table, and what is recorded in each. Pure.

The table has three axes: the outer one is vertical and turns, the two inside it put each axis of the gyro along the
vertical, up and down. So the acceleration is constant in every dwell, and only the horizontal part of the Earth's rate
turns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from psabench.link.signals import Floats
from psabench.mems_gyro.params import MemsGyroParams

# Angles of the middle and the inner axis, deg: the case's x, y, z down and up.
ATTITUDES = ((-90.0, 0.0), (90.0, 0.0), (0.0, 90.0), (0.0, -90.0), (0.0, 0.0), (0.0, 180.0))
LEVELS = (0.1, 0.25, 0.5, 0.75, 1.0)  # of the range, about the input axis
ACROSS = 0.5  # of the range, about the two others


@dataclass(frozen=True, slots=True, kw_only=True)
class Dwell:
    """The output at one attitude and one rate."""

    middle_deg: float
    inner_deg: float
    heading_deg: float  # of the outer axis at the start
    rate_dps: float  # as the table's angle and clock say
    t_s: float  # start
    duration_s: float
    blocks_v: Floats  # means of equal parts, at the load
    recording: bool = False  # of the noise, at rest

    @property
    def at_rest(self) -> bool:
        return abs(self.rate_dps) < 1e-3

    @property
    def u_v(self) -> float:
        return float(self.blocks_v.mean())


def rates_dps(p: MemsGyroParams, attitude: int) -> list[float]:
    """Both directions of each, rests before and after; along the input axis all levels."""
    levels = LEVELS if attitude // 2 == p.channel else (ACROSS,)
    return [0.0, *(sign * level * p.range_dps for level in levels for sign in (1.0, -1.0)), 0.0]


def plan_steps(p: MemsGyroParams) -> Iterator[tuple[float, float, list[float]]]:
    """Middle and inner angle, rates: every second series in the other order, so that a drift is no asymmetry."""
    for series in range(p.series):
        order = range(len(ATTITUDES)) if series % 2 == 0 else reversed(range(len(ATTITUDES)))
        for k in order:
            rates = rates_dps(p, k)
            yield (*ATTITUDES[k], rates if series % 2 == 0 else rates[::-1])


def parts_of(p: MemsGyroParams) -> int:
    """Dwells of the series."""
    return sum(len(rates) for *_, rates in plan_steps(p))

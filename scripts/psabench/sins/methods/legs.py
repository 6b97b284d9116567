"""A plan of rotations as the methods take it: what the table does while the samples of each leg come."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from psabench.errors import BadInput, expected
from psabench.native.nav import EARTH_RADPS, Floats
from psabench.sins.plan import RotationPlan

WHOLE = 1e-6  # of a turn that a leg of whole turns may lack
LEAST_DWELL_S = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """A turn at a constant rate, or a dwell."""

    rows: slice  # of the increments
    begin_s: float
    end_s: float
    axis: int  # of the instrument that lies on the table's axis, from 0
    angle_rad: float

    @property
    def is_dwell(self) -> bool:
        """Does the table stand?"""
        return self.angle_rad == 0.0 and self.end_s - self.begin_s >= LEAST_DWELL_S

    @property
    def whole_turns(self) -> int:
        """Signed; 0: a part of a turn, or more than whole ones."""
        turns = self.angle_rad / math.tau
        return round(turns) if round(turns) and abs(turns - round(turns)) < WHOLE else 0


def legs_of(plan: RotationPlan, dt_s: float) -> list[Leg]:
    """In their order. Raises BadInput where a leg ends between two samples."""
    legs, begin_s = [], 0.0
    for k, turn in enumerate(plan.turns):
        end_s = begin_s + turn.duration_s
        first, last = begin_s / dt_s, end_s / dt_s
        if abs(last - round(last)) > 1e-6:
            raise BadInput(expected("a leg of whole samples", f"{turn.duration_s:g} s of {dt_s:g} s", f"turns[{k}]"))
        legs.append(
            Leg(
                rows=slice(round(first), round(last)),
                begin_s=begin_s,
                end_s=end_s,
                axis=int(np.argmax(np.abs(turn.axis_b))),
                angle_rad=turn.rate_radps * turn.duration_s,
            )
        )
        begin_s = end_s
    return legs


def earth_rate_n(latitude_rad: float) -> Floats:
    """East, north, up; rad/s."""
    return EARTH_RADPS * np.array([0.0, math.cos(latitude_rad), math.sin(latitude_rad)])

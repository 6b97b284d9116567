"""A plan of rotations as data: turns about axes of the instrument, on a table whose axis lies at an azimuth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from psabench.errors import BadInput, expected
from psabench.named_yaml import checked_number, read_named
from psabench.native.nav import Floats
from psabench.native.sins import DEG, Turn

NAMED = ("article", "two_rates", "secondary", "secondary_reversing", "six_positions")  # of proto/rotation_plans
AXES: Mapping[str, tuple[float, float, float]] = {
    "z1": (1.0, 0.0, 0.0),
    "z2": (0.0, 1.0, 0.0),
    "z3": (0.0, 0.0, 1.0),
}
KEYS = {"axis", "rate_degps", "for_s", "remount"}
MOST_DEGPS, MOST_S, MOST_TURNS = 1000.0, 86400.0, 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class RotationPlan:
    """At the start z1 lies on the table's horizontal axis and z3 is vertical: up here, down on a table of ours."""

    name: str
    axis_azimuth_deg: float  # from north, clockwise
    turns: tuple[Turn, ...]

    @property
    def duration_s(self) -> float:
        """Of all turns; a remounting takes no time of the filter."""
        return sum(t.duration_s for t in self.turns if not t.remount)

    @property
    def start_c_nb(self) -> Floats:
        """Attitude at the start; n is east, north, up."""
        a = self.axis_azimuth_deg * DEG
        z1 = np.array([math.sin(a), math.cos(a), 0.0])
        return np.column_stack([z1, np.cross([0.0, 0.0, 1.0], z1), [0.0, 0.0, 1.0]])

    @property
    def axis_from_east_deg(self) -> float:
        """Angle of the table's axis from the east-west line, 0 to 90."""
        return abs(90.0 - self.axis_azimuth_deg % 180.0)

    def with_azimuth(self, azimuth_deg: float) -> RotationPlan:
        """The same turns on a table of another azimuth."""
        return RotationPlan(name=self.name, axis_azimuth_deg=azimuth_deg, turns=self.turns)


def read_plan(name: str) -> RotationPlan:
    """Of this name (NAMED) or a YAML file. Raises BadInput with the file and the key."""
    found, path = read_named(name, NAMED, "rotation_plans", "--plan", "a plan of rotations")
    return plan_of_dict(found, str(path), path.stem)


def plan_of_dict(found: object, where: str, name: str = "") -> RotationPlan:
    """Raises BadInput for what is no plan."""
    if not isinstance(found, dict) or set(found) - {"axis_azimuth_deg", "turns"} or "turns" not in found:
        got = sorted(map(str, found)) if isinstance(found, dict) else found
        raise BadInput(expected("axis_azimuth_deg and turns", got, where))
    turns = found["turns"]
    if not isinstance(turns, list) or not 1 <= len(turns) <= MOST_TURNS:
        raise BadInput(expected(f"a list of 1 to {MOST_TURNS}", turns, f"{where}: turns"))
    return RotationPlan(
        name=name,
        axis_azimuth_deg=checked_number(
            found.get("axis_azimuth_deg", 0.0), -360.0, 360.0, f"{where}: axis_azimuth_deg"
        ),
        turns=tuple(_turn_of_dict(t, f"{where}: turns[{k}]") for k, t in enumerate(turns)),
    )


def _turn_of_dict(found: Any, where: str) -> Turn:
    if not isinstance(found, dict) or set(found) - KEYS or not {"axis", "rate_degps", "for_s"} <= set(found):
        raise BadInput(expected("axis, rate_degps, for_s and optionally remount", found, where))
    if not isinstance(found["axis"], str) or found["axis"] not in AXES:
        raise BadInput(expected(", ".join(AXES), found["axis"], f"{where}: axis"))
    if not isinstance(found.get("remount", False), bool):
        raise BadInput(expected("true or false", found["remount"], f"{where}: remount"))
    return Turn(
        axis_b=AXES[found["axis"]],
        rate_radps=checked_number(found["rate_degps"], -MOST_DEGPS, MOST_DEGPS, f"{where}: rate_degps") * DEG,
        duration_s=checked_number(found["for_s"], 0.0, MOST_S, f"{where}: for_s"),
        remount=found.get("remount", False),
    )


def rates_of(turns: Sequence[Turn]) -> set[float]:
    """Magnitudes of the rates of long turns, in deg/s: re-orientations do not count."""
    return {round(abs(t.rate_radps) / DEG, 6) for t in turns if abs(t.rate_radps) * t.duration_s > math.pi}

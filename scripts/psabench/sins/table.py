"""A table of one to three axes under a plan of rotations: which axis makes which turn, the attitude from its angles.

Axis 1 is the outermost and horizontal, its azimuth known; then axis 2, then axis 3. At angles of zero the unit's x lies
along axis 1, y along axis 2, z along axis 3, which points down (docs/instruments.md).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from psabench.errors import BadInput, expected
from psabench.native.nav import Floats
from psabench.native.sins import Turn

PARALLEL = math.cos(math.radians(2.0))  # of a turn's axis and the table's
AXES = 3


def attitudes(azimuth_rad: float, angles_rad: Floats) -> Floats:
    """C_nb, (n, 3, 3), of angles (n, 3) of the axes; n is east, north, up."""
    to_enu = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # from north, east, down
    to_table = to_enu @ Rotation.from_euler("z", azimuth_rad).as_matrix()
    return np.asarray(to_table @ Rotation.from_euler("XYZ", angles_rad).as_matrix())


def axis_directions(axis_2_rad: float, axis_3_rad: float) -> Floats:
    """Rows: the table's axes 1, 2, 3 in the unit's axes b; they depend on the angles of the inner axes."""
    c2, s2 = math.cos(axis_2_rad), math.sin(axis_2_rad)
    c3, s3 = math.cos(axis_3_rad), math.sin(axis_3_rad)
    return np.array([[c2 * c3, -c2 * s3, s2], [s3, c3, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """A turn of a plan as a command to one axis of the table; rate 0: a rest."""

    axis: int  # from 1
    rate_dps: float
    duration_s: float

    @property
    def angle_deg(self) -> float:
        return self.rate_dps * self.duration_s


def moves_of(turns: Sequence[Turn], axes: int) -> Iterator[Move]:
    """Raises BadInput for a turn that no axis can make, with its number from 1."""
    at_rad = np.zeros(AXES)
    for number, turn in enumerate(turns, start=1):
        if turn.remount:
            raise BadInput(expected("turns of the table", "remount", f"plan: turn {number}"))
        move = _move_of(turn, at_rad, axes, number)
        at_rad[move.axis - 1] += math.radians(move.angle_deg)
        yield move


def _move_of(turn: Turn, at_rad: Floats, axes: int, number: int) -> Move:
    along = axis_directions(at_rad[1], at_rad[2])[:axes] @ turn.axis_b
    best = int(np.argmax(np.abs(along)))
    if abs(along[best]) < PARALLEL:
        names = ", ".join(str(a + 1) for a in range(axes))
        raise BadInput(
            expected(f"an axis that lies along axis {names} of the table", turn.axis_b, f"plan: turn {number}")
        )
    rate_dps = math.degrees(turn.rate_radps) * math.copysign(1.0, along[best])
    return Move(axis=best + 1, rate_dps=rate_dps, duration_s=turn.duration_s)

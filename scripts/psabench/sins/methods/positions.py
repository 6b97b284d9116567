"""The classical method: six positions on a levelled table, whole turns there and back about each axis.

Each dwell gives the mean outputs where the table says what they should be: f = S' g, w = S' u, with S the table's
angles. Each leg of whole turns gives the sum of the angular increments where the table says how far it turned. Both
are linear in the errors; the table's level, azimuth and angles are taken for true, and the mounting of the unit on the
table is in the result, until it goes into the gauge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psabench.errors import BadInput, expected
from psabench.native.nav import Floats
from psabench.native.sins import Gauge, Params, to_gauge
from psabench.sins.increments import Increments
from psabench.sins.methods.legs import Leg

LEAST_POSITIONS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class TableSide:
    """What the table says: no more is known of the truth."""

    gravity_n_mps2: Floats  # specific force at rest, east north up
    earth_n_radps: Floats
    t_s: Floats  # (m,) of the angles
    c_st: Floats  # (m, 3, 3) platform to n
    angle_sd_rad: float  # of a reading
    gyro_noise_radps_rts: float

    def near(self, t_s: float) -> Floats:
        """The reading nearest to an instant."""
        return np.asarray(self.c_st[int(np.argmin(np.abs(self.t_s - t_s)))])

    def mean(self, begin_s: float, end_s: float) -> Floats:
        """Mean of the readings while the table is still: a rotation but for the square of their noise."""
        chosen = (self.t_s > begin_s) & (self.t_s < end_s)
        return np.asarray(self.c_st[chosen].mean(axis=0))


def calibrate_by_positions(data: Increments, legs: Sequence[Leg], side: TableSide, *, turns: bool = True) -> Params:
    """Errors of both triads; turns=False: of the six positions alone, gyros against the Earth's rate.

    Raises BadInput for a plan that lacks positions or turns."""
    dwells = [leg for leg in legs if leg.is_dwell]
    rounds = [leg for leg in legs if leg.whole_turns] if turns else []
    if len(dwells) < LEAST_POSITIONS or (turns and {leg.axis for leg in rounds} != {0, 1, 2}):
        got = f"{len(dwells)} dwells, turns about {len({leg.axis for leg in rounds})} axes"
        raise BadInput(expected("six dwells and whole turns about each axis", got, "plan"))
    forces = [_dwell_row(data.dv_mps, side.gravity_n_mps2, leg, side) for leg in dwells]
    angles = [_dwell_row(data.dtheta_rad, side.earth_n_radps, leg, side) for leg in dwells]
    angles += [_turn_row(data.dtheta_rad, leg, side) for leg in rounds]
    df, gamma = _solve_errors(forces)
    nu, theta = _solve_errors(angles)
    found, _ = to_gauge(Gauge.ARTICLE, Params(nu_radps=nu, theta=theta, df_mps2=df, gamma=gamma))
    return found


@dataclass(frozen=True, slots=True)
class _Row:
    """Integrals over a leg, in the platform's axes."""

    seconds: float
    due: Floats
    got: Floats
    noise_s: float  # of so many seconds


def _dwell_row(increments: Floats, vector_n: Floats, leg: Leg, side: TableSide) -> _Row:
    seconds = leg.end_s - leg.begin_s
    due = side.mean(leg.begin_s, leg.end_s).T @ vector_n
    return _Row(seconds, due * seconds, increments[leg.rows].sum(axis=0), seconds)


def _turn_row(dtheta_rad: Floats, leg: Leg, side: TableSide) -> _Row:
    """Whole turns by the plan, the rest by the angles at both ends; the Earth's rate across the axis averages out."""
    axis = np.eye(3)[leg.axis]
    seconds, start, end = leg.end_s - leg.begin_s, side.near(leg.begin_s), side.near(leg.end_s)
    back = start.T @ end
    rest = 0.5 * np.array([back[2, 1] - back[1, 2], back[0, 2] - back[2, 0], back[1, 0] - back[0, 1]])
    earth = axis * (axis @ start.T @ side.earth_n_radps)
    due = axis * leg.whole_turns * 2.0 * np.pi + rest + earth * seconds
    as_long_s = seconds + 2.0 * (side.angle_sd_rad / side.gyro_noise_radps_rts) ** 2
    return _Row(seconds, due, dtheta_rad[leg.rows].sum(axis=0), as_long_s)


def _solve_errors(rows: Sequence[_Row]) -> tuple[Floats, Floats]:
    """Zero and matrix of got - due = zero t + matrix due: least squares, each row with its noise."""
    weight = 1.0 / np.sqrt([r.noise_s for r in rows])
    regressors = np.array([[r.seconds, *r.due] for r in rows]) * weight[:, None]
    differences = np.array([r.got - r.due for r in rows]) * weight[:, None]
    scale = np.linalg.norm(regressors, axis=0)
    solved, *_ = np.linalg.lstsq(regressors / scale, differences, rcond=None)
    solved /= scale[:, None]
    return solved[0], solved[1:].T

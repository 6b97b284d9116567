"""Increments of an inertial unit: what a strapdown integration and a calibration take, whatever the file was.

An increment is the integral over one interval of the rate in inertial space, rad, or of the specific force, m/s, in
the unit's axes. Intervals have one length; `Increments.of` checks the time stamps and says which row breaks it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected

Floats = npt.NDArray[np.float64]

JITTER = 0.3  # of an interval that stamps may stray from the grid: what CAN and a scheduler do
STRAY = 1.0  # of an interval, from an even grid between the first and the last
LEAST, MOST_S = 2, 1.0  # intervals; an interval


@dataclass(frozen=True, slots=True, kw_only=True)
class Increments:
    """n intervals, one behind the other."""

    end_s: Floats  # (n,) end of each interval, on a grid of dt_s
    dt_s: float
    dtheta_rad: Floats  # (n, 3)
    dv_mps: Floats  # (n, 3)

    def __len__(self) -> int:
        return len(self.end_s)

    @staticmethod
    def of(end_s: Floats, dtheta_rad: Floats, dv_mps: Floats, *, where: object = "") -> Increments:
        """From stamped rows, (n,), (n, 3), (n, 3); the interval is the mean step.

        Raises BadInput: a number that is not finite, time that stands still or goes back, a gap. Rows count from 1.
        """
        rows = np.column_stack([end_s, dtheta_rad, dv_mps])
        _check_finite(rows, where)
        if len(rows) < LEAST:
            raise BadInput(expected(f"{LEAST} intervals or more", len(rows), where))
        step = np.diff(end_s)
        _check_order(end_s, step, where)
        grid_s = float(end_s[-1] - end_s[0]) / (len(end_s) - 1)
        _check_gaps(end_s, step, float(np.median(step)), where)
        if not 0.0 < grid_s <= MOST_S:
            raise BadInput(expected(f"an interval above 0, up to {MOST_S:g} s", f"{grid_s:g}", where))
        return Increments(
            end_s=end_s[0] + grid_s * np.arange(len(end_s)),
            dt_s=grid_s,
            dtheta_rad=np.ascontiguousarray(dtheta_rad, np.float64),
            dv_mps=np.ascontiguousarray(dv_mps, np.float64),
        )

    def part(self, first: int, last: int) -> Increments:
        """Rows first up to last - 1."""
        s = slice(first, last)
        return Increments(end_s=self.end_s[s], dt_s=self.dt_s, dtheta_rad=self.dtheta_rad[s], dv_mps=self.dv_mps[s])


def _check_finite(rows: Floats, where: object) -> None:
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(bad):
        value = rows[bad[0]][~np.isfinite(rows[bad[0]])][0]
        raise BadInput(expected("finite numbers", f"{value} in row {bad[0] + 1} of {len(rows)}", where))


def _check_order(end_s: Floats, step: Floats, where: object) -> None:
    bad = np.flatnonzero(step <= 0.0)
    if len(bad):
        i = int(bad[0]) + 1
        what = "a repeated row" if step[i - 1] == 0.0 else "time that goes back"
        got = f"{what} in row {i + 1}: {end_s[i]:.6f} s after {end_s[i - 1]:.6f} s"
        raise BadInput(expected("time stamps that ascend", got, where))


def _check_gaps(end_s: Floats, step: Floats, grid_s: float, where: object) -> None:
    """Two rows in a row that stray by less than JITTER each can have a step of one and twice JITTER."""
    bad = np.flatnonzero(np.abs(step / grid_s - 1.0) > 2 * JITTER)
    if len(bad):
        i = int(bad[0]) + 1
        got = f"{step[i - 1]:.6f} s before row {i + 1}, {end_s[i]:.6f} s ({len(bad)} such steps)"
        raise BadInput(expected(f"intervals of {grid_s:.6f} s", got, where))
    even_s = np.linspace(end_s[0], end_s[-1], len(end_s))
    off = np.abs(end_s - even_s)
    if off.max() > STRAY * grid_s:
        i = int(off.argmax())
        got = f"row {i + 1} {off[i]:.6f} s off an even grid of {len(end_s)} rows"
        raise BadInput(expected(f"stamps within {STRAY * grid_s:.6f} s of their grid", got, where))

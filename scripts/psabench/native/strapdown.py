"""Strapdown integration over the ellipsoid: strapdown.h of libpsabench-nav (docs/procedures/strapdown.md), from Python.

Frame n is east, north, up; b the unit's axes; `C_nb` takes coordinates in b to coordinates in n. SI units, rad.
Increments are integrals over one interval of the rate in inertial space and of the specific force, in b.
"""

from __future__ import annotations

import ctypes as c
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected
from psabench.native.nav import Status
from psabench.native.navlib import StrapdownStruct, library

Floats = npt.NDArray[np.float64]
ROW = 15  # doubles of a state: place, velocity, C_nb


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """What is known at one instant (struct nav_state)."""

    lat_rad: float
    lon_rad: float
    h_m: float
    v_n_mps: Floats  # (3,)
    C_nb: Floats  # (3, 3)

    @staticmethod
    def of(row: Floats) -> State:
        """From one row of a path, (15,)."""
        lat_rad, lon_rad, h_m = (float(x) for x in row[:3])
        velocity, matrix = row[3:6].copy(), row[6:].reshape(3, 3).copy()
        return State(lat_rad=lat_rad, lon_rad=lon_rad, h_m=h_m, v_n_mps=velocity, C_nb=matrix)

    def row(self) -> Floats:
        place = (self.lat_rad, self.lon_rad, self.h_m)
        return np.concatenate([place, np.ravel(self.v_n_mps), np.ravel(self.C_nb)])


class Strapdown:
    """An integration that goes on from call to call. `height_fixed`: the horizontal channel alone."""

    def __init__(self, at: State, *, height_fixed: bool = False) -> None:
        self._at = StrapdownStruct(vertical=int(height_fixed))
        self._at.at[:] = list(at.row())

    @property
    def state(self) -> State:
        return State.of(np.array(self._at.at))

    def advance(self, dtheta_rad: Floats, dv_mps: Floats, dt_s: float) -> Floats:
        """The states after each of n intervals, (n, 15), from increments (n, 3) twice: rows of doubles are not copied.

        Raises BadInput with the number of the interval; then nothing has moved.
        """
        a, v = (np.ascontiguousarray(x, np.float64) for x in (dtheta_rad, dv_mps))
        if a.ndim != 2 or a.shape[1] != 3 or a.shape != v.shape:
            raise BadInput(expected("increments of shapes (n, 3) and (n, 3)", f"{a.shape} and {v.shape}", "strapdown"))
        if not 0.0 < dt_s <= 1.0:
            raise BadInput(expected("an interval above 0, up to 1 s", dt_s, "strapdown"))
        path, done = np.empty((len(a), ROW)), c.c_int64()
        at = (c.byref(self._at), a.ctypes.data, v.ctypes.data, len(a), dt_s, path.ctypes.data, c.byref(done))
        status = library().integrate(*at)
        if status:
            i = done.value
            what, got = self._why(status, np.hstack([a[i : i + 1], v[i : i + 1]]))
            raise BadInput(expected(what, got, f"strapdown: interval {i} of {len(a)}"))
        return path

    def _why(self, status: int, interval: Floats) -> tuple[str, object]:
        numbers = np.append(np.array(self._at.at), interval)
        if status == Status.NOT_FINITE:
            return "finite numbers", numbers[~np.isfinite(numbers)][:1]
        return "a latitude within 89.9 deg", "one beyond it"


def gravity_mps2(lat_rad: float, h_m: float) -> float:
    """On the ellipsoid and near it: Somigliana's, linear in height."""
    return float(library().gravity_mps2(lat_rad, h_m))


def radii_m(lat_rad: float, h_m: float) -> tuple[float, float]:
    """Radii of curvature plus height: of the meridian, of the prime vertical."""
    meridian, vertical = c.c_double(), c.c_double()
    library().radii_m(lat_rad, h_m, c.byref(meridian), c.byref(vertical))
    return meridian.value, vertical.value


def dcm(heading_rad: float, pitch_rad: float, roll_rad: float) -> Floats:
    """C_nb, (3, 3), of a unit with axes right, forward, up. Heading clockwise from north, nose up, right wing down."""
    out = np.empty((3, 3))
    library().dcm(heading_rad, pitch_rad, roll_rad, out.ctypes.data)
    return out


def angles_rad(C_nb: Floats) -> tuple[float, float, float]:
    """Heading, pitch and roll of C_nb, (3, 3)."""
    out = [c.c_double() for _ in range(3)]
    library().dcm_angles(np.ascontiguousarray(C_nb, np.float64).ctypes.data, *(c.byref(x) for x in out))
    heading, pitch, roll = (x.value for x in out)
    return heading, pitch, roll

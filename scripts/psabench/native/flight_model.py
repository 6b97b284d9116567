"""An aircraft's flight without a unit, through libpsabench (docs/procedures/flight.md): truth for campaigns and tests.

Frames: `n` north, east, down in C_nb; b the aircraft's, ahead, right, down; names with `enu` are east, north, up.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected
from psabench.native.clib import FlightJobStruct, library

Floats = npt.NDArray[np.float64]
Leg = Mapping[str, float]  # a kind with its value, and its parameters, as in a scenario
STATE = 29  # PSABENCH_FLIGHT_STATE
KINDS = 10  # of legs: the first so many keys


@dataclass(frozen=True, kw_only=True)
class States:
    """Of n instants, a row each."""

    lat_rad: Floats
    lon_rad: Floats
    h_m: Floats
    v_enu_mps: Floats
    a_enu_mps2: Floats  # time derivatives of v_enu_mps
    heading_rad: Floats
    pitch_rad: Floats
    roll_rad: Floats
    C_nb: Floats  # (n, 3, 3)
    f_b_mps2: Floats
    w_ib_b_radps: Floats
    baro_m: Floats
    g_mps2: Floats  # of the ellipsoid


class Flight:
    """Parked at the place with this heading, then leg after leg. Raises BadInput for legs that cannot be flown."""

    def __init__(
        self,
        legs: Sequence[Leg],
        *,
        place_deg_m: tuple[float, float, float] = (55.7, 37.5, 150.0),
        heading_deg: float = 0.0,
        jerk_mps3: float = 4.0,
        roll_rate_dps: float = 8.0,
        angle_of_attack_deg: float = 4.0,
        baro: tuple[float, float, float, float] = (0.5, 0.0, 0.0, 0.0),
    ) -> None:
        """place_deg_m: latitude, longitude, height; baro: lag, s, scale, ppm, offset, m, drift, m/h."""
        self.handle: int | None = None
        self._free = library().flight_free  # at the interpreter's end modules are gone before objects
        rows = np.array([_leg_row(number, leg) for number, leg in enumerate(legs)])
        job = FlightJobStruct(size=c.sizeof(FlightJobStruct), legs=len(legs), leg=rows.ctypes.data)
        job.place[:], job.baro[:] = place_deg_m, baro
        job.plan[:] = heading_deg, jerk_mps3, roll_rate_dps, angle_of_attack_deg
        why = c.create_string_buffer(256)
        self.handle = library().flight_new(c.byref(job), why, len(why))
        if not self.handle:
            reason = why.value.decode()
            raise BadInput(f"flight: {reason}")
        starts = [int(library().flight_leg_ns(self.handle, i)) for i in range(len(legs) + 1)]
        self.leg_ns, self.end_ns = starts[:-1], starts[-1]

    def __del__(self) -> None:
        if self.handle:
            self._free(self.handle)

    def states(self, t_ns: npt.NDArray[np.int64]) -> States:
        """At all these instants since the beginning."""
        times = np.ascontiguousarray(t_ns, dtype=np.int64)
        out = np.empty((times.size, STATE))
        status = library().flight_states(
            self.handle, _pointer_to(times, c.c_int64), times.size, _pointer_to(out, c.c_double)
        )
        if status < 0:
            raise BadInput(expected("times of 0 or more", times.min(initial=0), "flight"))
        return States(
            lat_rad=out[:, 0],
            lon_rad=out[:, 1],
            h_m=out[:, 2],
            v_enu_mps=out[:, 3:6],
            a_enu_mps2=out[:, 6:9],
            heading_rad=out[:, 9],
            pitch_rad=out[:, 10],
            roll_rad=out[:, 11],
            C_nb=out[:, 12:21].reshape(-1, 3, 3),
            f_b_mps2=out[:, 21:24],
            w_ib_b_radps=out[:, 24:27],
            baro_m=out[:, 27],
            g_mps2=out[:, 28],
        )

    def increments(self, from_ns: int, dt_ns: int, n: int) -> tuple[Floats, Floats]:
        """Integrals of the rate, rad, and the specific force, m/s, over n intervals, (n, 3) each."""
        out = np.empty((n, 6))
        status = library().flight_increments(self.handle, from_ns, dt_ns, n, _pointer_to(out, c.c_double))
        if status < 0:
            got = f"{n} of {dt_ns} ns from {from_ns} ns"
            raise BadInput(expected("intervals of 1 ns to 10 s from 0 on", got, "flight"))
        return out[:, :3], out[:, 3:]


def _pointer_to(a: npt.NDArray[Any], kind: Any) -> Any:
    return a.ctypes.data_as(c.POINTER(kind))


@cache
def leg_keys() -> tuple[str, ...]:
    """Kinds, then parameters."""
    keys = list[str]()
    while (key := library().flight_key(len(keys))) is not None:
        keys.append(key.decode())
    return tuple(keys)


def _leg_row(number: int, leg: Leg) -> list[float]:
    kinds, params = leg_keys()[:KINDS], leg_keys()[KINDS:]
    found = [kind for kind in kinds if kind in leg]
    if len(found) != 1:
        raise BadInput(expected(f"one of {', '.join(kinds)}", ", ".join(found) or "none", f"flight: legs[{number}]"))
    if unknown := [key for key in leg if key not in leg_keys()]:
        raise BadInput(expected(", ".join(params), unknown[0], f"flight: legs[{number}]"))
    return [float(kinds.index(found[0])), float(leg[found[0]]), *(float(leg.get(p, np.nan)) for p in params)]

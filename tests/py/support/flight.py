"""emu/phys/flight through ctypes: an aircraft by its list of legs, SI units, radians, nanoseconds."""

from __future__ import annotations

import ctypes
import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[3]
Array = NDArray[np.float64]
KINDS = (
    "park_s",
    "taxi_m",
    "stop_s",
    "turn_deg",
    "takeoff_mps",
    "climb_m",
    "descend_m",
    "fly_s",
    "snake_s",
    "land_mps",
)
PARAMS = (
    "speed_mps",
    "accel_mps2",
    "rate_mps",
    "bank_deg",
    "radius_m",
    "amplitude_deg",
    "period_s",
    "roll_deg",
    "roll_s",
    "pitch_deg",
    "pitch_s",
)
Leg = dict[str, float]


def build(where: Path) -> ctypes.CDLL:
    """Compile emu/phys/flight with the bridge into a library of its own and load it."""
    out = where / "flight.so"
    sources = [ROOT / "tests/py/support/flight_bridge.c", ROOT / "emu/base/detmath.c"]
    sources += [ROOT / f"emu/phys/motion/{name}.c" for name in ("earth", "pose")]
    sources += sorted((ROOT / "emu/phys/flight").glob("*.c"))
    flags = ["-std=c11", "-O2", "-ffp-contract=off", "-shared", "-fPIC", f"-I{ROOT / 'emu'}"]
    subprocess.run([os.environ.get("CC", "cc"), *flags, "-o", str(out), *map(str, sources), "-lm"], check=True)
    lib = ctypes.CDLL(str(out))
    lib.bridge_flight.restype = ctypes.c_void_p
    lib.bridge_flight_end_ns.restype = lib.bridge_flight_leg_ns.restype = ctypes.c_int64
    return lib


@dataclass(frozen=True, kw_only=True)
class States:
    """Of n instants: n is north-east-down in C_nb, velocities and accelerations are east, north, up."""

    lat_rad: Array
    lon_rad: Array
    h_m: Array
    v_enu_mps: Array
    a_enu_mps2: Array
    heading_rad: Array
    pitch_rad: Array
    roll_rad: Array
    C_nb: Array
    f_b_mps2: Array
    w_ib_b_radps: Array
    baro_m: Array
    g_mps2: Array


class CannotFly(Exception):
    """What the plan's error says."""


def _doubles(values: Sequence[float] | Array) -> ctypes.Array[ctypes.c_double]:
    flat = np.asarray(values, dtype=np.float64).ravel()
    return (ctypes.c_double * max(1, flat.size))(*flat.tolist())


def _row(leg: Leg) -> list[float]:
    kind = next(k for k in KINDS if k in leg)
    return [KINDS.index(kind), leg[kind], *(leg.get(p, float("nan")) for p in PARAMS)]


class Flight:
    """Parked at the place with this heading, then leg after leg."""

    def __init__(
        self,
        lib: ctypes.CDLL,
        legs: Sequence[Leg],
        *,
        place: tuple[float, float, float] = (55.7, 37.5, 150.0),
        heading_deg: float = 0.0,
        jerk_mps3: float = 4.0,
        roll_rate_dps: float = 8.0,
        angle_of_attack_deg: float = 4.0,
        baro: tuple[float, float, float, float] = (0.5, 0.0, 0.0, 0.0),
    ) -> None:
        self.lib = lib
        why = ctypes.create_string_buffer(256)
        where = _doubles([np.radians(place[0]), np.radians(place[1]), place[2]])
        plan = _doubles([heading_deg, jerk_mps3, roll_rate_dps, angle_of_attack_deg])
        rows = _doubles(np.array([_row(leg) for leg in legs]))
        found = lib.bridge_flight(where, plan, _doubles(baro), len(legs), rows, why, ctypes.c_size_t(256))
        self.handle = ctypes.c_void_p(found)
        if not found:
            raise CannotFly(why.value.decode())
        self.end_ns: int = lib.bridge_flight_end_ns(self.handle)
        self.leg_ns: list[int] = [lib.bridge_flight_leg_ns(self.handle, i) for i in range(len(legs))]

    def __del__(self) -> None:
        self.lib.bridge_flight_free(self.handle)

    def states(self, t_ns: NDArray[np.int64]) -> States:
        """At all these instants."""
        times = np.ascontiguousarray(t_ns, dtype=np.int64)
        out = np.empty((times.size, 29))
        self.lib.bridge_flight_states(
            self.handle,
            times.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)),
            ctypes.c_uint(times.size),
            out.ctypes.data_as(ctypes.POINTER(ctypes.c_double)),
        )
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

    def increments(self, from_ns: int, dt_ns: int, n: int) -> tuple[Array, Array]:
        """Integrals of the rate and the specific force over n intervals, (n, 3) each: rad, m/s."""
        out = np.empty((n, 6))
        self.lib.bridge_flight_increments(
            self.handle,
            ctypes.c_int64(from_ns),
            ctypes.c_int64(dt_ns),
            ctypes.c_uint(n),
            out.ctypes.data_as(ctypes.POINTER(ctypes.c_double)),
        )
        return out[:, :3], out[:, 3:]

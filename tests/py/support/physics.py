"""emu/phys through ctypes, for tests that hold it against models of their own: SI units, radians, seconds."""

from __future__ import annotations

import ctypes
import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[3]
Array = NDArray[np.float64]
HEAD, TABLE, FIXED = 0, 1, 2
DOUBLES = ctypes.POINTER(ctypes.c_double)
LAB = ctypes.c_void_p
T_NS = ctypes.c_int64

# name: result, arguments
SIGNATURES: dict[str, tuple[object, list[object]]] = {
    "gravity": (ctypes.c_double, [ctypes.c_double] * 2),
    "lab": (LAB, [DOUBLES, ctypes.c_uint, DOUBLES, DOUBLES, ctypes.c_double, ctypes.c_uint64]),
    "lab_free": (None, [LAB]),
    "g": (ctypes.c_double, [LAB]),
    "position": (ctypes.c_int, [LAB, ctypes.c_uint, ctypes.c_double, ctypes.c_double, T_NS]),
    "rate": (ctypes.c_int, [LAB, ctypes.c_uint, ctypes.c_double, T_NS]),
    "sine": (ctypes.c_int, [LAB, ctypes.c_uint, ctypes.c_double, ctypes.c_double, T_NS]),
    "profile": (ctypes.c_int, [LAB, ctypes.c_uint, DOUBLES, DOUBLES, ctypes.c_uint, T_NS]),
    "axis": (None, [LAB, ctypes.c_uint, T_NS, DOUBLES]),
    "readout_deg": (ctypes.c_double, [LAB, ctypes.c_uint, T_NS]),
    "attitude": (None, [LAB, T_NS, DOUBLES]),
    "head": (None, [LAB, ctypes.c_double, ctypes.c_int, T_NS]),
    "kinematics": (None, [LAB, DOUBLES, DOUBLES, T_NS, DOUBLES]),
    "accelerometer": (ctypes.c_double, [LAB, DOUBLES, DOUBLES, ctypes.c_double, DOUBLES, T_NS]),
    "gyro": (LAB, [DOUBLES, ctypes.c_double, ctypes.c_uint64]),
    "gyro_free": (None, [LAB]),
    "gyro_true_v": (ctypes.c_double, [LAB, DOUBLES, DOUBLES, ctypes.c_double]),
    "gyro_block": (None, [LAB, LAB, DOUBLES, T_NS, T_NS, ctypes.c_uint, DOUBLES]),
    "oven": (LAB, [ctypes.c_double] * 5),
    "oven_free": (None, [LAB]),
    "oven_set": (ctypes.c_int, [LAB, ctypes.c_double, T_NS]),
    "oven_ramp": (ctypes.c_int, [LAB, ctypes.c_double, T_NS]),
    "oven_degc": (None, [LAB, T_NS, DOUBLES]),
    "supply": (LAB, [ctypes.c_double]),
    "supply_free": (None, [LAB]),
    "supply_set": (ctypes.c_int, [LAB, ctypes.c_double, T_NS]),
    "supply_ripple": (ctypes.c_int, [LAB, ctypes.c_double, ctypes.c_double, T_NS]),
    "supply_dip": (ctypes.c_int, [LAB, ctypes.c_double, T_NS, T_NS]),
    "supply_volts": (ctypes.c_double, [LAB, T_NS]),
    "supply_next": (T_NS, [LAB, ctypes.c_int, T_NS]),
    "noise": (None, [DOUBLES, ctypes.c_uint64, T_NS, ctypes.c_uint, DOUBLES]),
    "slow": (None, [DOUBLES, ctypes.c_uint64, T_NS, ctypes.c_uint, DOUBLES]),
}


def build(where: Path) -> ctypes.CDLL:
    """Compile emu/phys with the bridge into a library of its own and load it."""
    out = where / "physics.so"
    base = (ROOT / f"emu/base/{name}.c" for name in ("detmath", "draws", "lanes", "rng"))
    sources = [ROOT / "tests/py/support/phys_bridge.c", *base]
    sources += sorted((ROOT / "emu/phys").rglob("*.c"))
    flags = ["-std=c11", "-O2", "-ffp-contract=off", "-shared", "-fPIC", f"-I{ROOT / 'emu'}"]
    subprocess.run([os.environ.get("CC", "cc"), *flags, "-o", str(out), *map(str, sources), "-lm"], check=True)
    lib = ctypes.CDLL(str(out))
    for name, (result, arguments) in SIGNATURES.items():
        function = getattr(lib, f"bridge_{name}")
        function.restype, function.argtypes = result, arguments
    return lib


def doubles(values: Sequence[float] | Array) -> ctypes.Array[ctypes.c_double]:
    """A C array of the numbers."""
    flat = np.asarray(values, dtype=np.float64).ravel()
    return (ctypes.c_double * max(1, flat.size))(*flat.tolist())


def ns(t_s: float) -> int:
    """Seconds to nanoseconds."""
    return round(t_s * 1e9)


class Lab:
    """A laboratory with a table of `axes` rows as in phys_bridge.c; latitude None: the Earth stands still."""

    def __init__(
        self,
        lib: ctypes.CDLL,
        *,
        g_mps2: float = 9.81,
        latitude_rad: float | None = None,
        height_m: float = 0.0,
        azimuth_rad: float = 0.0,
        axes: Sequence[Sequence[float]] = (),
        tilt_arcsec: tuple[float, float] = (0.0, 0.0),
        turn_s: float = 0.0,
        seed: int = 1,
    ) -> None:
        placed = latitude_rad is not None
        site = [g_mps2, latitude_rad or 0.0, height_m, azimuth_rad, 1.0 if placed else 0.0]
        rows = [list(row) + [0.0] * (11 - len(row)) for row in axes]
        self.lib = lib
        self.lab = lib.bridge_lab(doubles(site), len(rows), doubles(np.ravel(rows)), doubles(tilt_arcsec), turn_s, seed)
        self.g_mps2: float = lib.bridge_g(self.lab)

    def __del__(self) -> None:
        self.lib.bridge_lab_free(self.lab)

    def axis(self, axis: int, t_s: float) -> Array:
        """Angle, rate, acceleration of an axis: rad, rad/s, rad/s^2."""
        out = (ctypes.c_double * 3)()
        self.lib.bridge_axis(self.lab, axis, ns(t_s), out)
        return np.array(out)

    def attitude(self, t_s: float) -> Array:
        """C_nt."""
        out = (ctypes.c_double * 9)()
        self.lib.bridge_attitude(self.lab, ns(t_s), out)
        return np.array(out).reshape(3, 3)

    def kinematics(
        self,
        on: int,
        t_s: float,
        *,
        lever_m: Sequence[float] = (0, 0, 0),
        askew_rad: Sequence[float] = (0, 0, 0),
        at_m: Sequence[float] = (0, 0, 0),
    ) -> tuple[Array, Array]:
        """Specific force, m/s^2, and inertial rate, rad/s, in the case's axes."""
        out = (ctypes.c_double * 6)()
        self.lib.bridge_kinematics(self.lab, doubles([on, *lever_m, *askew_rad]), doubles(at_m), ns(t_s), out)
        return np.array(out[:3]), np.array(out[3:])

    def accelerometer_v(self, on: int, t_s: float, u0_v: float, k: Sequence[float]) -> float:
        """Volts of a sensor with the zero u0_v and k, V per m/s^2, in the centre."""
        seat = doubles([on, 0, 0, 0, 0, 0, 0])
        out: float = self.lib.bridge_accelerometer(self.lab, seat, doubles([0, 0, 0]), u0_v, doubles(k), ns(t_s))
        return out

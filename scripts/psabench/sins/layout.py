"""What the columns of a file of increments are, as data: a layout in YAML (docs/procedures/sins_data.md).

gyro: [wx, wy, wz]          # names of columns; in a file of raw numbers: their places from 1
gyro_unit: deg/s            # rad, deg, arcsec: increments; rad/s, deg/s, deg/h: rates
accel: [ax, ay, az]
accel_unit: m/s2            # m/s: increments; m/s2, g, ug: specific force
time: t                     # where it has one
time_unit: s
interval_s: 0.01            # in place of the time column, or instead of the median of its steps
axes: "+x +y +z"            # the unit's x, y, z (right, forward, up) from the file's
format: float32             # float32, float64: little-endian rows; else by the file's ending
columns: 7                  # of a row of raw numbers
topic: /imu                 # of an MCAP file
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected
from psabench.named_yaml import read_yaml
from psabench.procedures.command_line.offered import G_MPS2

Floats = npt.NDArray[np.float64]

DEG = np.pi / 180.0
# Unit: factor to rad or m/s, and whether it is of a rate, which an interval makes an increment.
GYRO_UNITS: Mapping[str, tuple[float, bool]] = {
    "rad": (1.0, False),
    "deg": (DEG, False),
    "arcsec": (DEG / 3600.0, False),
    "rad/s": (1.0, True),
    "deg/s": (DEG, True),
    "deg/h": (DEG / 3600.0, True),
}
ACCEL_UNITS: Mapping[str, tuple[float, bool]] = {
    "m/s": (1.0, False),
    "m/s2": (1.0, True),
    "g": (G_MPS2, True),
    "ug": (G_MPS2 * 1e-6, True),
}
TIME_UNITS: Mapping[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
RAW = ("float32", "float64")
MOST_COLUMNS = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Of a file of increments."""

    gyro: tuple[str | int, ...] = ("dtheta_x_rad", "dtheta_y_rad", "dtheta_z_rad")
    gyro_unit: str = "rad"
    accel: tuple[str | int, ...] = ("dv_x_mps", "dv_y_mps", "dv_z_mps")
    accel_unit: str = "m/s"
    time: str | int | None = "t_s"
    time_unit: str = "s"
    interval_s: float | None = None
    axes: str = "+x +y +z"
    format: str | None = None
    columns: int = 7
    topic: str = "/imu"

    def __post_init__(self) -> None:
        for name in ("gyro", "accel"):
            if len(set(getattr(self, name))) != 3:
                raise ValueError(expected("three columns", list(getattr(self, name)), name))
        _check_among(self.gyro_unit, GYRO_UNITS, "gyro_unit")
        _check_among(self.accel_unit, ACCEL_UNITS, "accel_unit")
        _check_among(self.time_unit, TIME_UNITS, "time_unit")
        if self.time is None and self.interval_s is None:
            raise ValueError(expected("time, interval_s or both", "neither", "layout"))
        if self.interval_s is not None and not 0.0 < self.interval_s <= 1.0:
            raise ValueError(expected("above 0, up to 1 s", self.interval_s, "interval_s"))
        turn(self.axes)
        self._check_raw()

    def _check_raw(self) -> None:
        if self.format is not None and self.format not in RAW:
            raise ValueError(expected(f"{' or '.join(RAW)}, or none: by the file's ending", self.format, "format"))
        if not 6 <= self.columns <= MOST_COLUMNS:
            raise ValueError(expected(f"6 to {MOST_COLUMNS}", self.columns, "columns"))
        if self.format is None:
            return
        for name in self.names():
            if not isinstance(name, int) or not 1 <= name <= self.columns:
                raise ValueError(expected(f"places of columns, 1 to {self.columns}", name, f"layout of {self.format}"))

    def names(self) -> list[str | int]:
        """Columns that are read: gyro, accel, then time where there is one."""
        return [*self.gyro, *self.accel, *([] if self.time is None else [self.time])]


def _check_among(value: str, known: Mapping[str, Any], name: str) -> None:
    if not isinstance(value, str) or value not in known:
        raise ValueError(expected(", ".join(known), value, name))


def turn(axes: str) -> Floats:
    """(3, 3): what takes the file's axes to the unit's. Raises ValueError."""
    found = re.fullmatch(r"\s*([+-]?[xyz])[\s,]*([+-]?[xyz])[\s,]*([+-]?[xyz])\s*", axes)
    matrix = np.zeros((3, 3))
    for row, name in enumerate(found.groups() if found else ()):
        matrix[row, "xyz".index(name[-1])] = -1.0 if name[0] == "-" else 1.0
    if round(float(np.linalg.det(matrix))) != 1:
        raise ValueError(expected("three axes that make a right-handed frame, such as +y -x +z", axes, "axes"))
    return matrix


def read_layout(path: Path) -> Layout:
    """Raises BadInput with the file and the key."""
    found = read_yaml(path, "a layout")
    try:
        return layout_of(found)
    except (TypeError, ValueError) as e:
        raise BadInput(f"{path}: {e}") from e


def layout_of(found: object) -> Layout:
    """Of a mapping. Raises ValueError, TypeError."""
    if not isinstance(found, Mapping):
        raise ValueError(expected("keys and values", found, "layout"))
    unknown = [str(k) for k in found if k not in Layout.__dataclass_fields__]
    if unknown:
        raise ValueError(expected(", ".join(Layout.__dataclass_fields__), unknown[0], "layout"))
    fields = dict(found)
    for name in ("gyro", "accel"):
        given = fields.get(name, [])
        if not isinstance(given, list) or not all(isinstance(x, str | int) for x in given):
            raise ValueError(expected("a list of three columns", given, name))
        if name in fields:
            fields[name] = tuple(given)
    for name, kind in (("columns", int), ("axes", str), ("topic", str), ("interval_s", (int, float, type(None)))):
        if name in fields and (not isinstance(fields[name], kind) or isinstance(fields[name], bool)):
            raise ValueError(expected("a number" if name in ("columns", "interval_s") else "text", fields[name], name))
    return Layout(**fields)

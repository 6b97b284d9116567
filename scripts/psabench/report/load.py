"""`psabench.load(folder)`: what a run left on disk, as NumPy arrays with their units.

    run = psabench.load("build/run")
    run["turns-quiet"]["u_v"]            # (n,) float64
    run["turns-quiet"].units["u_v"]      # "V"
    run.result["sections"]               # result.json
    run.provenance["seed"]

A series is a CSV file with names of columns in its first line, as a procedure writes it, or `psabench decode`. The
unit of a column is the end of its name.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected, input_error
from psabench.report.diff import FILES, read_result
from psabench.report.provenance import KEY

# What follows the first underscore that makes the rest of a name one of these.
UNITS: Mapping[str, str] = {
    "v_per_g2": "V/g²",
    "v_per_g": "V/g",
    "v_per_s": "V/s",
    "s": "s",
    "ns": "ns",
    "v": "V",
    "vs": "V s",
    "a": "A",
    "hz": "Hz",
    "deg": "deg",
    "degph": "deg/h",
    "arcmin": "′",
    "rad": "rad",
    "radps": "rad/s",
    "mps": "m/s",
    "mps2": "m/s²",
    "degc": "°C",
    "degC": "°C",  # of a DBC, as the columns of `psabench decode` for other boards than PSA-2
    "LSB": "LSB",
    "counts": "counts",
    "pulses": "pulses",
    "g": "g",
    "deg/h": "deg/h",
    "V": "V",
}

Array = npt.NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """Columns of one length, by name."""

    path: Path
    arrays: Mapping[str, Array]  # (n,) int64, float64, or text
    units: Mapping[str, str]  # by name; "": a number or text

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.arrays)

    def __len__(self) -> int:
        return len(next(iter(self.arrays.values())))

    def __getitem__(self, name: str) -> Array:
        """A column. Raises KeyError with the names there are."""
        if name not in self.arrays:
            raise KeyError(expected(", ".join(self.arrays), name, self.path))
        return self.arrays[name]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunData:
    """What a folder holds; `result` and `provenance` are empty when the run was interrupted."""

    path: Path
    series: Mapping[str, Series]  # by the file's name without its ending
    result: Mapping[str, Any]
    provenance: Mapping[str, Any]

    def __getitem__(self, name: str) -> Series:
        """A series. Raises KeyError with the names there are."""
        if name not in self.series:
            raise KeyError(expected(", ".join(self.series) or "a folder with series", name, self.path))
        return self.series[name]


def load_run(path: str | Path) -> RunData:
    """A folder of a report, or one CSV file. Raises BadInput with file and line for what cannot be read."""
    path = Path(path)
    if not path.exists():
        raise BadInput(expected("a folder of a report or a CSV file", "no such file", path))
    files = [path] if path.is_file() else sorted(p for p in path.glob("*.csv") if not p.name.endswith(".calls.csv"))
    done = path.is_dir() and any((path / name).is_file() for name in FILES)
    if not files and not done:
        raise BadInput(expected(f"{' or '.join(FILES)} or series (.csv)", "none", path))
    result = read_result(path) if done else {}
    series = {p.stem: read_series(p) for p in files}
    return RunData(path=path, series=series, result=result, provenance=result.get(KEY, {}))


def read_series(path: Path) -> Series:
    """A CSV file with names in its first line; a last row cut short by a crash is left out. Raises BadInput."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as e:
        raise input_error(path, "a series in CSV", e) from e
    rows = list(csv.reader(text[: text.rfind("\n") + 1].splitlines()))
    names = rows[0] if rows else []
    if not names or len(set(names)) != len(names) or not all(n and not _is_number(n) for n in names):
        raise BadInput(expected("names of columns", ",".join(names) or "none", f"{path}:1"))
    for line, row in enumerate(rows[1:], start=2):
        if len(row) != len(names):
            raise BadInput(expected(f"{len(names)} columns", len(row), f"{path}:{line}"))
    columns = zip(*rows[1:], strict=True) if rows[1:] else [()] * len(names)
    arrays = {name: _typed_array(column) for name, column in zip(names, columns, strict=True)}
    return Series(path=path, arrays=arrays, units={name: unit_of_column(name) for name in names})


def unit_of_column(name: str) -> str:
    """The unit at the end of a column's name; "": it is a number or text."""
    parts = name.split("_")
    ends = ("_".join(parts[k:]) for k in range(1, len(parts)))
    return next((UNITS[end] for end in ends if end in UNITS), "")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _typed_array(column: Sequence[str]) -> Array:
    """Whole numbers, numbers, or text."""
    for kind in (np.int64, np.float64):
        try:
            return np.array([kind(x) for x in column], dtype=kind)
        except ValueError:
            continue
    return np.array(column, dtype=np.str_)

"""Files of increments by ending: one table of what reads their columns; `read_increments` makes SI of them."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from psabench.errors import BadInput, check_there, expected, input_error
from psabench.link.own import output_text
from psabench.sins.increments import Floats, Increments
from psabench.sins.layout import ACCEL_UNITS, GYRO_UNITS, TIME_UNITS, Layout, turn

MOST_ROWS = 50_000_000  # 139 h at 100 Hz: more than fits
CHILD = "psabench.sins.mf4_columns"


def read_increments(path: Path, layout: Layout | None = None) -> Increments:
    """Raises BadInput with the file, and the row or the column."""
    given = layout or Layout()
    check_there(path, "increments of a unit")
    if not path.is_file():
        raise BadInput(expected("increments of a unit", "a device or a pipe", path))
    read = _read_raw if given.format else READERS.get(path.suffix.lower())
    if read is None:
        raise BadInput(
            expected(f"an ending of {' '.join(READERS)}, or a layout with format", path.suffix or "none", path)
        )
    try:
        columns = read(path, given)
    except OSError as e:
        raise input_error(path, "increments of a unit", e) from e
    return _in_si(columns, given, path)


def _in_si(columns: Floats, layout: Layout, path: Path) -> Increments:
    """columns: (n, 6 or 7), as the layout names them.

    An interval that is given counts instead of that of the stamps, whose order and gaps are looked at all the same.
    """
    if len(columns) == 0:
        raise BadInput(expected("rows of numbers", "none", path))
    given_s: Floats = (layout.interval_s or 1.0) * np.arange(1, len(columns) + 1, dtype=np.float64)
    end_s: Floats = given_s if layout.time is None else columns[:, 6] * TIME_UNITS[layout.time_unit]
    raw = Increments.of(end_s, columns[:, :3], columns[:, 3:6], where=path)
    dt_s = layout.interval_s or raw.dt_s
    gyro, gyro_rate = GYRO_UNITS[layout.gyro_unit]
    accel, accel_rate = ACCEL_UNITS[layout.accel_unit]
    to_unit = turn(layout.axes).T
    return Increments(
        end_s=given_s if layout.interval_s else raw.end_s,
        dt_s=dt_s,
        dtheta_rad=raw.dtheta_rad @ to_unit * (gyro * (dt_s if gyro_rate else 1.0)),
        dv_mps=raw.dv_mps @ to_unit * (accel * (dt_s if accel_rate else 1.0)),
    )


def _read_raw(path: Path, layout: Layout) -> Floats:
    row = np.dtype("<f4" if layout.format == "float32" else "<f8").itemsize * layout.columns
    size = path.stat().st_size
    if size % row or size == 0:
        raise BadInput(
            expected(f"whole rows of {layout.columns} {layout.format}, {row} bytes each", f"{size} bytes", path)
        )
    if size // row > MOST_ROWS:
        raise BadInput(expected(f"{MOST_ROWS} rows at most", size // row, path))
    numbers = np.fromfile(path, "<f4" if layout.format == "float32" else "<f8").reshape(-1, layout.columns)
    return numbers[:, [int(name) - 1 for name in layout.names()]].astype(np.float64)


def _places(names: Sequence[str | int], there: Sequence[str], path: Path) -> list[int]:
    missing = [str(n) for n in names if n not in there]
    if missing:
        raise BadInput(
            expected(f"columns {', '.join(map(str, names))}", f"no {missing[0]} among {', '.join(there)[:200]}", path)
        )
    return [there.index(str(n)) for n in names]


def _csv_rows(file: Iterable[str], path: Path) -> Iterator[list[str]]:
    """Raises BadInput for what is no CSV, such as a field longer than 128 KiB."""
    reader = csv.reader(file)
    try:
        yield from reader
    except csv.Error as e:
        raise BadInput(expected("CSV", e, f"{path}: line {reader.line_num}")) from e


def _read_csv(path: Path, layout: Layout) -> Floats:
    """A head of names, then numbers; what begins with # is passed over."""
    found: list[list[float]] = []
    places: list[int] | None = None
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        for number, row in enumerate(_csv_rows(file, path), start=1):
            if not row or row[0].startswith("#"):
                continue
            if places is None:
                places = _places(layout.names(), [name.strip() for name in row], path)
                continue
            try:
                found.append([float(row[i]) for i in places])
            except (ValueError, IndexError) as e:
                raise BadInput(expected("numbers", ",".join(row)[:80], f"{path}: line {number}")) from e
    return np.array(found, np.float64).reshape(len(found), len(layout.names()))


def _read_mcap(path: Path, layout: Layout) -> Floats:
    """Messages of one topic in JSON; a name with points goes into an object: angular_velocity.x."""
    from psabench.logs.mcap_log import json_messages

    found = []
    for number, message in enumerate(json_messages(path, layout.topic), start=1):
        try:
            found.append([_member(message, str(name)) for name in layout.names()])
        except ValueError as e:
            raise BadInput(f"{path}: message {number}: {e}") from e
    if not found:
        raise BadInput(expected(f"messages of topic {layout.topic} in JSON", "none", path))
    return np.array(found, np.float64)


def _member(message: object, name: str) -> float:
    for key in name.split("."):
        if not isinstance(message, Mapping) or key not in message:
            raise ValueError(expected(f"a member {name}", "none"))
        message = message[key]
    if isinstance(message, bool) or not isinstance(message, int | float):
        raise ValueError(expected(f"a number for {name}", repr(message)))
    return float(message)


def _read_mf4(path: Path, layout: Layout) -> Floats:
    """Channels of one group, by asammdf in a process of its own with bounds of memory and time."""
    from psabench.conform.sources import mf4

    if not mf4.asammdf_is_there():
        raise BadInput(expected("asammdf (pip install asammdf)", "none", path))
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "columns.npy"
        done = subprocess.run(
            [sys.executable, "-P", "-W", "ignore", "-m", CHILD, str(path), str(out), json.dumps(layout.names())],
            env=os.environ | mf4.ONE_THREAD | {"TMPDIR": scratch, "PYTHONPATH": mf4.search_path()},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
        )
        if done.returncode:
            said = done.stderr.decode(errors="replace").splitlines()
            raise BadInput(expected("an MF4 file", said[-1][:200] if said else f"status {done.returncode}", path))
        return np.asarray(np.load(out, allow_pickle=False), np.float64)


def write_csv(path: Path, data: Increments) -> None:
    """As `read_increments` reads it without a layout, to the last digit. Raises BadInput, OutputError."""
    default = Layout()
    with output_text(path) as file:
        file.write(",".join(map(str, [default.time, *default.gyro, *default.accel])) + "\n")
        for t_s, *row in np.column_stack([data.end_s, data.dtheta_rad, data.dv_mps]).tolist():
            file.write(",".join([f"{t_s:.9f}", *map(repr, row)]) + "\n")


READERS: Mapping[str, Callable[[Path, Layout], Floats]] = {
    ".csv": _read_csv,
    ".mcap": _read_mcap,
    ".mf4": _read_mf4,
}

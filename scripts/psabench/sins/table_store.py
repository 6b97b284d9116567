"""What a table run recorded, as files that `sins-calibration --data` reads (docs/procedures/sins_calibration.md)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from psabench.errors import BadInput, expected, input_error, output_error
from psabench.link.own import output_text, replace_file
from psabench.sins.increments import Increments
from psabench.sins.table import AXES
from psabench.sins.table_run import TableData

INCREMENTS, LAYOUT, ANGLES = "increments.bin", "increments.yaml", "table_angles.csv"
HEAD = "t_s,axis1_deg,axis2_deg,axis3_deg"
LAYOUT_TEXT = """\
# increments.bin: little-endian float64, seven a row: end of the interval s, angle rad x3, velocity m/s x3.
format: float64
columns: 7
time: 1
gyro: [2, 3, 4]
accel: [5, 6, 7]
interval_s: {dt_s!r}
"""


def write_data(out: Path, data: TableData) -> None:
    """Increments as raw numbers with their layout, angles as CSV. Raises OutputError, BadInput."""
    i = data.increments
    end_s = i.dt_s * np.arange(1, len(i) + 1)
    try:
        (out / INCREMENTS).write_bytes(np.column_stack([end_s, i.dtheta_rad, i.dv_mps]).astype("<f8").tobytes())
    except OSError as e:
        raise output_error(out / INCREMENTS, e) from e
    replace_file(out / LAYOUT, LAYOUT_TEXT.format(dt_s=i.dt_s))
    with output_text(out / ANGLES) as file:
        file.write(f"{HEAD}\n")
        for t_s, *angles in np.column_stack([data.stand_s, data.stand_deg]).tolist():
            file.write(",".join([f"{t_s:.9f}", *(f"{a:.9f}" for a in angles)]) + "\n")


def read_angles(path: Path | None, increments: Increments) -> TableData:
    """Recorded increments with angles, or without (None). Raises BadInput with the line."""
    rows = np.empty((0, 1 + AXES)) if path is None else _read_rows(path)
    zero_s = increments.end_s[0] - increments.dt_s
    moved = np.diff(rows[:, 0])
    if len(moved) and not np.all(moved > 0.0):
        k = int(np.flatnonzero(moved <= 0.0)[0]) + 2
        raise BadInput(expected("times that ascend", f"{rows[k - 1, 0]:g} s in row {k}", path))
    return TableData(increments=increments, stand_s=rows[:, 0] - zero_s, stand_deg=rows[:, 1:])


def _read_rows(path: Path) -> np.ndarray:
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as e:
        raise input_error(path, "angles in CSV", e) from e
    found, started = [], False
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.startswith("#"):
            continue
        if not started:
            if line.strip() != HEAD:
                raise BadInput(expected(HEAD, line[:80], f"{path}: line {number}"))
            started = True
            continue
        found.append(_numbers(line, f"{path}: line {number}"))
    if not found:
        raise BadInput(expected("rows of angles", "none", path))
    return np.array(found)


def _numbers(line: str, where: str) -> list[float]:
    try:
        row = [float(x) for x in line.split(",")]
    except ValueError:
        row = []
    if len(row) != 1 + AXES or not np.isfinite(row).all():
        raise BadInput(expected(f"{1 + AXES} numbers", line[:80], where))
    return row

"""Outputs of a unit that navigates by itself on the bench's table: alignment at rest, a plan of rotations."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from psabench.bench import Bench
from psabench.boards.bins.device import Bins, NavState
from psabench.boards.readings import ReadingReader, Readings
from psabench.errors import DeviceError, expected
from psabench.sins.secondary.outputs import Outputs, Point, matrices_of
from psabench.sins.table import Move
from psabench.sins.table_drive import PlanDrive

REST_S = 1.0  # after the alignment's end, and after the last turn


def record_outputs(
    bench: Bench, moves: Sequence[Move], point: Point, alignment_s: int, advance: Callable[[], None]
) -> Iterator[Outputs]:
    """One run; advance: after each part of a move. Gives what the unit gave out, also of a run that is cut short.

    Raises DeviceError where the unit does not navigate.
    """
    unit, drive = bench.board(Bins), PlanDrive(bench, moves, advance)
    unit.wait_ready()
    drive.go_home()
    reader = unit.navigate(math.degrees(point.lat_rad), math.degrees(point.lon_rad), point.h_m, alignment_s)
    unit.start()
    bench.run_for(alignment_s + REST_S)
    if (state := unit.navigation()) is not NavState.NAVIGATING:
        raise DeviceError("navigation", 0, expected("navigating", state.name.lower(), "state after the alignment"))
    try:
        drive.make_all()
        bench.run_for(REST_S)
        unit.stop()
    except BaseException:  # Ctrl-C, too: hours on a table are kept
        if len(reader) > 1:
            yield outputs_of(reader.take())
        raise
    yield outputs_of(_whole_run(reader))


def _whole_run(reader: ReadingReader) -> Readings:
    got_all = reader.take()  # counts what is missing
    if reader.counters.lost or reader.counters.torn:
        got = f"{reader.counters.lost} missing, {reader.counters.torn} torn"
        raise DeviceError("navigation", 0, expected("outputs without a gap", got))
    return got_all


def outputs_of(readings: Readings) -> Outputs:
    """As the unit sends them, in SI; time counts from the first."""
    q = np.stack([readings[f"Q{k}"] for k in range(4)], axis=1)
    t_s = readings.t_sample_s - readings.t_sample_s[0]
    dt_s = float(t_s[-1]) / (len(t_s) - 1)
    return Outputs(
        t_s=dt_s * np.arange(len(t_s), dtype=np.float64),
        dt_s=dt_s,
        lat_rad=np.radians(readings["LAT"]),
        lon_rad=np.radians(readings["LON"]),
        v_mps=np.stack([readings["VE"], readings["VN"]], axis=1),
        c_nb=matrices_of(q / np.linalg.norm(q, axis=1)[:, None]),
        w_b_radps=np.radians(np.stack([readings[f"W{axis}"] for axis in "XYZ"], axis=1)),
    )

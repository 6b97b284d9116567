"""A plan of rotations on the bench: the table's moves and angles over SCPI, the unit's increments over CAN."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from psabench.bench import Bench
from psabench.boards.bins.device import Bins, Weights, increments_of
from psabench.errors import BenchError, DeviceError, InstrumentError, expected
from psabench.native.nav import Floats
from psabench.progress import Advance
from psabench.sins.correction import rows_later
from psabench.sins.increments import Increments
from psabench.sins.table import AXES, Move, attitudes

PART_S = 30.0  # of bench time between two looks at what has come
REST_S = 1.0  # before the first turn and after the last: the interval before, and the table's log
STEP_DEG = 180.0  # a turn of at most this is a position: it ends where it should
LOG_LATE_S = 0.2  # the readout's delay and more: a log ends this long ago
STAND_S = 0.1


class Follower(Protocol):
    """Looks on while a run goes."""

    def take(self, end_s: Floats, dtheta_rad: Floats, dv_mps: Floats) -> None: ...

    def follow(self, at_s: Floats, angles_deg: Floats) -> None: ...

    @property
    def words(self) -> str: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class TableData:
    """What a run has recorded, from angles of zero on. Times count from the beginning of the first interval."""

    increments: Increments
    stand_s: Floats  # (m,) instants of the table's angles; none: a coarse table
    stand_deg: Floats  # (m, 3)

    def stand(self, azimuth_rad: float) -> tuple[Floats, Floats] | None:
        """Instants and rotations C_st."""
        if not len(self.stand_s):
            return None
        return self.stand_s, attitudes(azimuth_rad, np.radians(self.stand_deg))


class TableRun:
    """One run of a plan. Raises BenchError with what was lost."""

    def __init__(self, bench: Bench, moves: Sequence[Move], advance: Advance, live: Follower | None = None) -> None:
        """advance: after each part of a move, of `parts_of`."""
        self._bench, self._moves, self._advance, self._live = bench, moves, advance, live
        self._unit = bench.board(Bins)
        self._weights: Weights | None = None
        self._taken: list[tuple[Floats, Floats, Floats]] = []
        self._stand: list[tuple[Floats, Floats]] = []
        self._axes = 0
        self._stand_wanted = False
        self._set_deg = [0.0] * AXES  # as commanded: a coarse table shows no angles
        self._logged_s = 0.0

    def measure(self, stand: bool) -> TableData:
        """Everything of the plan, in order."""
        self._stand_wanted = stand
        self._unit.wait_ready()
        self._weights = self._unit.weights()  # before the converters are set up they are others
        self._axes = table_axes(self._bench)
        for axis in range(1, self._axes + 1):
            self._bench.table.position(0.0, axis=axis)
        self._unit.frames.forget()
        self._unit.start()
        self._bench.run_for(REST_S)
        self._logged_s = self._bench.time_s
        for number, move in enumerate(self._moves, start=1):
            self._make(move, self._following(number))
            self._set_deg[move.axis - 1] += move.angle_deg
            self._collect()
        self._bench.run_for(REST_S)
        self._take()
        self._unit.stop()
        return self.data()

    def _following(self, number: int) -> Move | None:
        return self._moves[number] if number < len(self._moves) else None

    def _make(self, move: Move, following: Move | None) -> None:
        """Long turns end by their time, on a whole turn or not: what counts is what was measured."""
        table, angle = self._bench.table, move.angle_deg
        if move.rate_dps == 0.0:
            self._pass(move.duration_s)
        elif _is_position(move):
            table.position(self._set_deg[move.axis - 1] + angle, abs(move.rate_dps), axis=move.axis)
            self._look()
        else:
            table.rate(move.rate_dps, axis=move.axis)
            self._pass(move.duration_s)
            if following is None or following.axis != move.axis or following.rate_dps == 0.0:
                table.stop(axis=move.axis)

    def _pass(self, duration_s: float) -> None:
        parts = _parts(duration_s)
        for _ in range(parts):
            self._bench.run_for(duration_s / parts)
            self._look()

    def _look(self) -> None:
        self._collect()
        self._advance(self._live.words if self._live else "")

    def _collect(self) -> None:
        self._take()
        if self._stand_wanted:
            self._read_log()

    def _take(self) -> None:
        if self._weights is None:
            return
        got = increments_of(self._unit.frames.take(), self._weights)
        if not len(got.seq):
            return
        bad = np.flatnonzero(~got.whole)
        if len(bad):
            at_s = got.end_s[bad[0]]
            got_bad = f"{len(bad)} that are not, first at {at_s:.2f} s"
            raise DeviceError("increments", 0, expected("whole readings", got_bad))
        self._taken.append((got.end_s, got.dtheta_rad, got.dv_mps))
        if self._live:
            self._live.take(*self._taken[-1])

    def _read_log(self) -> None:
        """Of all axes since the log before, at instants of a grid."""
        last_s = self._bench.time_s - LOG_LATE_S
        first = int(np.ceil(self._logged_s / STAND_S))
        count = int(np.floor(last_s / STAND_S)) - first + 1
        if count <= 0:
            return
        at_s: Floats = STAND_S * np.arange(first, first + count, dtype=np.float64)
        angles = np.zeros((count, AXES))
        for axis in range(self._axes):
            angles[:, axis] = self._bench.table.log(at_s[0], STAND_S, count, axis=axis + 1)
        self._stand.append((at_s, angles))
        if self._live:
            self._live.follow(at_s, angles)
        self._logged_s = float(at_s[-1]) + STAND_S / 2

    def data(self) -> TableData:
        """What has been recorded so far. Raises BenchError where there is nothing."""
        self._take()
        if not self._taken or self._weights is None:
            raise BenchError(expected("readings of the unit", "none", "sins-calibration"))
        end_s, dtheta, dv = (np.concatenate([part[k] for part in self._taken]) for k in range(3))
        increments = self._of_one_interval(Increments.of(end_s, dtheta, dv, where="increments of the unit"))
        zero_s = increments.end_s[0] - increments.dt_s
        at_s = np.concatenate([s for s, _ in self._stand]) if self._stand else np.empty(0)
        angles = np.concatenate([a for _, a in self._stand]) if self._stand else np.empty((0, AXES))
        return TableData(increments=increments, stand_s=at_s - zero_s, stand_deg=angles)

    def _of_one_interval(self, i: Increments) -> Increments:
        """A unit that latches its gyros late says how old the velocity is (object 2221h:4): it is taken later."""
        assert self._weights is not None
        if self._weights.age_s == 0.0:
            return i
        lost = math.ceil(self._weights.age_s / i.dt_s)
        later = replace(i, dv_mps=rows_later(i.dv_mps, self._weights.age_s / i.dt_s))
        return later.part(0, len(i) - lost)


def _parts(duration_s: float) -> int:
    return max(1, round(duration_s / PART_S))


def parts_of(moves: Sequence[Move]) -> int:
    """How often a run of them reports."""
    return sum(1 if _is_position(m) else _parts(m.duration_s) for m in moves)


def _is_position(move: Move) -> bool:
    return move.rate_dps != 0.0 and abs(move.angle_deg) <= STEP_DEG


def table_axes(bench: Bench) -> int:
    """How many axes the table has: the first that it refuses ends the count."""
    for axis in range(1, AXES + 1):
        try:
            bench.table.read(axis=axis)
        except InstrumentError:
            return axis - 1
    return AXES

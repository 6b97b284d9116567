"""A plan of rotations on the bench: the table's angles over SCPI, the unit's increments over CAN."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from psabench.bench import Bench
from psabench.boards.bins.device import Bins, Weights, increments_of
from psabench.errors import BenchError, DeviceError, expected
from psabench.native.nav import Floats
from psabench.progress import Advance
from psabench.sins.correction import rows_later
from psabench.sins.increments import Increments
from psabench.sins.table import AXES, Move, attitudes
from psabench.sins.table_drive import PlanDrive

REST_S = 1.0  # before the first turn and after the last: the interval before, and the table's log
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
        """advance: after each part of a move, of `table_drive.parts_of`."""
        self._bench, self._advance, self._live = bench, advance, live
        self._drive = PlanDrive(bench, moves, self._look)
        self._unit = bench.board(Bins)
        self._weights: Weights | None = None
        self._taken: list[tuple[Floats, Floats, Floats]] = []
        self._stand: list[tuple[Floats, Floats]] = []
        self._axes = 0
        self._stand_wanted = False
        self._logged_s = 0.0

    def measure(self, stand: bool) -> TableData:
        """Everything of the plan, in order."""
        self._stand_wanted = stand
        self._unit.wait_ready()
        self._weights = self._unit.weights()  # before the converters are set up they are others
        self._axes = self._drive.go_home()
        self._unit.frames.forget()
        self._unit.start()
        self._bench.run_for(REST_S)
        self._logged_s = self._bench.time_s
        self._drive.make_all()
        self._collect()
        self._bench.run_for(REST_S)
        self._take()
        self._unit.stop()
        return self.data()

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

"""Readings of a unit on an even grid of 100 Hz, whatever was lost on the bus.

A reading's place on the grid is by its time stamp. What is missing is filled by a line between its neighbours: for
BRIDGE_S at most the flight is as good as whole; beyond it a doubt says so, beyond END_S the rest is not used.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from psabench.boards.bins.device import UnitIncrements
from psabench.errors import expected
from psabench.link.signals import Floats, Ints

SAMPLE_S = 0.01
SAMPLE_US, STAMP_US = 10_000, 1 << 32  # of the grid; where the time stamp wraps
BRIDGE_S = 0.2  # E0: at 20 deg/s^2 the line is off by 0.1 deg at its middle
END_S = 60.0  # E0
END_ROWS = round(END_S / SAMPLE_S)
RESTART = 10  # readings in a row at another time: the unit's clock has been set (E0)
MOST_RAD, MOST_MPS = 0.07, 2.0  # in a row: 400 deg/s, 200 m/s2; more is no motion of an aircraft (E0)
WHERE = "increments"


@dataclass(frozen=True, slots=True)
class GridRows:
    """Rows one behind the other; the first is number `first` of the flight, its interval ends (first + 1) SAMPLE_S."""

    first: int
    dtheta_rad: Floats  # (n, 3)
    dv_mps: Floats  # (n, 3)
    source: Ints  # (n,) which reading of the batch it is; -1: filled


@dataclass
class GridCounts:
    """What has been mended."""

    readings: int = 0
    filled: int = 0  # rows
    gaps: int = 0
    longest_s: float = 0.0
    not_whole: int = 0  # clipped, incomplete, stretched, unsettled
    impossible: int = 0  # beyond MOST_RAD, MOST_MPS
    repeated: int = 0
    backwards: int = 0
    doubts: list[str] = field(default_factory=list)  # why the flight has no weight

    def as_dict(self) -> dict[str, object]:
        """For result.json."""
        names = ("readings", "filled", "gaps", "longest_s", "not_whole", "impossible", "repeated", "backwards")
        return {name: getattr(self, name) for name in names}


@dataclass
class IncrementGrid:
    """Takes readings in the order in which they came."""

    counts: GridCounts = field(default_factory=GridCounts)
    ended: bool = False  # after END_S without readings
    begin_us: int | None = None  # by the unit's clock, where the first interval begins
    _next: int = 0  # number of the next row
    _last_us: int | None = None  # time stamp of the last row
    _last: tuple[Floats, Floats] = field(default_factory=lambda: (np.zeros(3), np.zeros(3)))
    _rx_s: float = 0.0  # when its reading came
    _astray: int = 0  # readings in a row at a time that cannot be

    @property
    def now_s(self) -> float:
        """End of the last row."""
        return self._next * SAMPLE_S

    def take(self, got: UnitIncrements, t_rx_s: Floats) -> GridRows:
        """Rows of these readings and of what is missing before them. t_rx_s: (n,) when they came, by the transport."""
        if self.ended or not len(got.seq):
            return _no_rows(self._next)
        self.counts.readings += len(got.seq)
        stamps_us = np.round(got.end_s * 1e6).astype(np.int64) % STAMP_US
        possible = (np.abs(got.dtheta_rad) <= MOST_RAD).all(axis=1) & (np.abs(got.dv_mps) <= MOST_MPS).all(axis=1)
        usable = got.whole & possible
        if self._is_even(stamps_us, usable):
            steps = np.ones(len(stamps_us), np.int64)
        else:
            self.counts.not_whole += int((~got.whole).sum())
            self.counts.impossible += int((got.whole & ~possible).sum())
            found = [self._place(*x) for x in zip(stamps_us.tolist(), usable.tolist(), t_rx_s.tolist(), strict=True)]
            steps = np.array(found, np.int64)
        kept = np.flatnonzero(steps)
        if not len(kept):
            return _no_rows(self._next)
        if self.begin_us is None:
            self.begin_us = int(stamps_us[kept[0]]) - SAMPLE_US
        self._last_us, self._rx_s = int(stamps_us[kept[-1]]), float(t_rx_s[kept[-1]])
        return self._make_rows(kept, steps[kept], got)

    def _is_even(self, stamps_us: Ints, usable: np.ndarray) -> bool:
        """Nothing is missing: the usual case."""
        before = stamps_us[0] - SAMPLE_US if self._last_us is None else self._last_us
        steps = np.diff(stamps_us, prepend=before) % STAMP_US
        return bool(usable.all() and (np.abs(steps - SAMPLE_US) <= SAMPLE_US // 10).all())

    def _place(self, stamp_us: int, usable: bool, t_rx_s: float) -> int:
        """Rows from the last one to this reading; 0: it is not used."""
        if self.ended or not usable:
            return 0
        steps = 1 if self._last_us is None else self._steps_to(stamp_us, self._last_us, t_rx_s)
        if steps:
            self._note_gap((steps - 1) * SAMPLE_S)
            self._last_us, self._rx_s, self._astray = stamp_us, t_rx_s, 0
        return steps

    def _steps_to(self, stamp_us: int, last_us: int, t_rx_s: float) -> int:
        ahead_us = (stamp_us - last_us + STAMP_US // 2) % STAMP_US - STAMP_US // 2
        steps = round(ahead_us / SAMPLE_US)
        if 0 < steps <= END_ROWS:
            return steps
        self.counts.repeated += steps == 0
        self.counts.backwards += steps < 0
        self._astray += steps != 0
        if self._astray < RESTART:
            return 0
        what = f"{ahead_us * 1e-6:+.2f} s from one reading to the next"
        self._doubt("time stamps that ascend by 10 ms", what)
        since = round((t_rx_s - self._rx_s) / SAMPLE_S)
        self.ended = not 0 < since <= END_ROWS
        return 0 if self.ended else since

    def _note_gap(self, gap_s: float) -> None:
        if gap_s <= 0.0:
            return
        self.counts.gaps += 1
        self.counts.longest_s = max(self.counts.longest_s, gap_s)
        if gap_s > BRIDGE_S + SAMPLE_S / 2:
            self._doubt(f"gaps of at most {BRIDGE_S:g} s", f"one of {gap_s:.2f} s")

    def _doubt(self, what: str, got: str) -> None:
        self.counts.doubts.append(expected(what, f"{got} at about {self.now_s:.1f} s", WHERE))

    def _make_rows(self, kept: Ints, steps: Ints, got: UnitIncrements) -> GridRows:
        first, rows = self._next, np.cumsum(steps) - 1
        n = int(rows[-1]) + 1
        source = np.full(n, -1, np.int64)
        source[rows] = kept
        self._next += n
        self.counts.filled += n - len(rows)
        dtheta, dv = (
            values[kept] if n == len(rows) else _fill_rows(before, values[kept], rows)
            for before, values in zip(self._last, (got.dtheta_rad, got.dv_mps), strict=True)
        )
        self._last = dtheta[-1], dv[-1]
        return GridRows(first, dtheta, dv, source)


def _fill_rows(before: Floats, values: Floats, rows: Ints) -> Floats:
    """A line through the row before and the known ones."""
    known, at = np.concatenate([before[None], values]), np.concatenate([[-1], rows])
    return np.stack([np.interp(np.arange(rows[-1] + 1), at, known[:, i]) for i in range(3)], axis=1)


def _no_rows(first: int) -> GridRows:
    return GridRows(first, np.empty((0, 3)), np.empty((0, 3)), np.empty(0, np.int64))

"""Channels of a unit as envelopes: for each update and channel the lowest, highest and mean value since the last one.

A screen has some hundred columns, the board sends a thousand samples a second: the extremes of a column show a spike
that a decimated series would hide.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from psabench.boards.psa2.frames import Frames
from psabench.boards.readings import Readings
from psabench.boards.stream import FrameCounters
from psabench.errors import BenchError, expected
from psabench.link.signals import Floats, Ints
from psabench.panel.statistics import channel_statistics

BUCKET_S = 1 / 30  # of the bench's time; a longer span in one update is split
MOST_BUCKETS = 120  # in one update
KEPT = 1800  # buckets of a unit: 60 s of time that passes as real time does
SHOWN = 6  # channels of a unit in the list of all
RAW = 8192  # samples of a unit for histogram, Allan deviation and spectrum


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """n samples of some channels: t_s (n,), values (n, channels)."""

    t_s: Floats
    values: Floats
    names: tuple[str, ...]
    units: tuple[str, ...]


def samples_of(taken: Frames | Readings) -> Samples:
    """What a reader has taken, whatever the board."""
    if isinstance(taken, Frames):
        values = np.column_stack([taken.u_v, taken.temp_degc])
        return Samples(t_s=taken.t_rx_s, values=values, names=("x", "y", "z", "t"), units=("V", "V", "V", "degC"))
    names = tuple(taken.columns)
    values = np.column_stack([taken.columns[n] for n in names]) if names else np.empty((len(taken), 0))
    return Samples(t_s=taken.t_rx_s, values=values, names=names, units=tuple(taken.units[n] for n in names))


@dataclass(frozen=True, slots=True)
class Envelope:
    """One bucket: its last instant, and (lowest, highest, mean) of each channel; None: no value in it."""

    t_s: float
    bands: tuple[tuple[float, float, float] | None, ...]


def split_envelopes(s: Samples) -> list[Envelope]:
    """Samples in order of time, split into buckets of about BUCKET_S, MOST_BUCKETS at most."""
    n = len(s.t_s)
    if n == 0:
        return []
    span_s = float(s.t_s[-1] - s.t_s[0])
    parts = int(min(max(1.0, span_s / BUCKET_S), MOST_BUCKETS, n))
    edges = np.linspace(0, n, parts + 1).astype(int)
    bands = _bands_of(s.values, edges[:-1])
    return [Envelope(round(t_s, 6), row) for t_s, row in zip(s.t_s[edges[1:] - 1].tolist(), bands, strict=True)]


def _bands_of(values: Floats, starts: Ints) -> list[tuple[tuple[float, float, float] | None, ...]]:
    """The bands of all channels, (n, channels), in buckets that begin at these rows; all at once for fleets."""
    there = np.isfinite(values)
    count = np.add.reduceat(there, starts, axis=0, dtype=np.int64)
    low = np.minimum.reduceat(np.where(there, values, np.inf), starts, axis=0).tolist()
    high = np.maximum.reduceat(np.where(there, values, -np.inf), starts, axis=0).tolist()
    mean = (np.add.reduceat(np.where(there, values, 0.0), starts, axis=0) / np.maximum(count, 1)).tolist()
    rows = zip(count.tolist(), low, high, mean, strict=True)
    return [tuple((a, b, c) if k else None for k, a, b, c in zip(*row, strict=True)) for row in rows]


@dataclass(slots=True)
class Channels:
    """The history of one unit's channels."""

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    history: deque[Envelope] = field(default_factory=lambda: deque(maxlen=KEPT))
    count: int = 0
    _raw: deque[Samples] = field(default_factory=deque)
    _raw_count: int = 0

    def add(self, s: Samples) -> list[Envelope]:
        """New samples; returns their buckets."""
        if len(s.t_s) == 0:
            return []
        if s.names != self.names or (self.history and s.t_s[0] < self.history[-1].t_s):
            self._forget(s)
        new = split_envelopes(s)
        self.history.extend(new)
        self.count += len(s.t_s)
        self._keep_raw(s)
        return new

    def _forget(self, s: Samples) -> None:
        """Another form of frames, or a time that went back: the curves start again."""
        self.names, self.units, self.count = s.names, s.units, 0
        self.history.clear()
        self._raw.clear()
        self._raw_count = 0

    def _keep_raw(self, s: Samples) -> None:
        self._raw.append(s)
        self._raw_count += len(s.t_s)
        while self._raw_count - len(self._raw[0].t_s) >= RAW:
            self._raw_count -= len(self._raw.popleft().t_s)

    def latest(self, name: str) -> tuple[Floats, Floats]:
        """Times and values of the last RAW samples of a channel. Raises ValueError for a channel it has not."""
        k = self.names.index(name)
        if not self._raw:
            return np.empty(0), np.empty(0)
        t_s = np.concatenate([s.t_s for s in self._raw])[-RAW:]
        return t_s, np.concatenate([s.values[:, k] for s in self._raw])[-RAW:]

    def message(self, buckets: list[Envelope]) -> Mapping[str, Any]:
        """For the page: columns rather than rows, as uPlot takes them; nine digits are more than a pixel."""
        channels = range(len(self.names))
        bands = [[[_nine_digits(b.bands[k], i) for b in buckets] for i in range(3)] for k in channels]
        return {"t": [b.t_s for b in buckets], "bands": bands}


def _nine_digits(band: tuple[float, float, float] | None, i: int) -> float | None:
    return None if band is None else float(f"{band[i]:.9g}")


def unit_message(name: str, c: Channels, buckets: list[Envelope]) -> dict[str, Any]:
    """Buckets of a unit for the page."""
    return {"unit": name, "names": c.names, "units": c.units, **c.message(buckets)}


def channel_figures(c: Channels, channel: str) -> dict[str, Any]:
    """Statistics of one channel. Raises BenchError."""
    if not c.names:
        raise BenchError(expected("samples", "none yet", "statistics"))
    if channel not in c.names:
        raise BenchError(expected(", ".join(c.names), repr(channel[:40]), "channel"))
    return channel_statistics(*c.latest(channel), c.units[c.names.index(channel)])


def overview_row(name: str, title: str, c: Channels, counters: FrameCounters) -> dict[str, Any]:
    """A unit in the list of all: the latest values of its first channels, and what was lost."""
    last = c.history[-1].bands if c.history else ()
    shown = [
        [n, None if b is None else float(f"{b[2]:.7g}"), u] for n, b, u in zip(c.names, last, c.units, strict=False)
    ]
    head = {"name": name, "board": title, "samples": c.count, "lost": counters.lost}
    return head | {"torn": counters.torn, "stretches": counters.stretches, "last": shown[:SHOWN]}

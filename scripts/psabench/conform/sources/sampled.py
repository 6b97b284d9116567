"""Samples of channels, taken piece by piece, to edges: what the line port, bit-bang adapters and sigrok deliver."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from psabench.conform.sources.samples import GAP
from psabench.conform.sources.taken import BLOCK, NS, Bounds, LineTake
from psabench.errors import BadInput, expected
from psabench.link.lineport import SAMPLE_HZ
from psabench.link.signals import Ints
from psabench.link.vcd import MOST_EDGES, Wire

T = TypeVar("T", bound=np.generic)
Samples = npt.NDArray[np.uint64]


class Sampler:
    """Sample k is at k / sample_hz; an edge is at the first sample that shows it."""

    def __init__(self, names: Sequence[str], bits: Sequence[int], sample_hz: float, max_s: float) -> None:
        """bits: which bit of a sample each name is."""
        self.names, self.bits, self.sample_hz = names, bits, sample_hz
        self.most = max(1, int(min(max_s * sample_hz, 2.0**62)))
        self.samples = 0
        self.gaps: list[Ints] = []
        self.note = ""
        self._mask = np.uint64(sum({1 << b for b in bits}))
        self._first = self._last = np.uint64(0)
        self._at: list[Ints] = []
        self._word: list[Samples] = []
        self._edges = 0

    @property
    def full(self) -> bool:
        """No more is taken."""
        return bool(self.note)

    def feed(self, x: Samples, gaps: Ints | None = None) -> None:
        """Further samples, in pieces of any size; gaps: which of them come after a hole."""
        if len(x) > self.most - self.samples:
            x = x[: self.most - self.samples]
            self.note = f"judged to {self.most / self.sample_hz:g} s"
        if not len(x):
            return
        words = x & self._mask
        if not self.samples:
            self._first = self._last = words[0]
        at = np.flatnonzero(words != np.concatenate(([self._last], words[:-1])))
        if self._edges + len(at) > MOST_EDGES:
            at = at[: MOST_EDGES - self._edges]
            self.note = f"judged to its {MOST_EDGES} edges"
        self._at.append(at.astype(np.int64) + self.samples)
        self._word.append(words[at])
        if gaps is not None:
            self.gaps.append(gaps[gaps < len(x)] + self.samples)
        self._edges += len(at)
        self._last = words[-1]
        self.samples += len(x)

    def take(self) -> LineTake:
        """All that was fed."""
        at, words = _joined(self._at, np.int64), _joined(self._word, np.uint64)
        end_ns = self._ns(np.array([self.samples], np.int64))[0]
        return LineTake(
            channels={n: self._wire(at, words, b) for n, b in zip(self.names, self.bits, strict=True)},
            start_ns=0,
            end_ns=int(end_ns),
            resolution_ns=NS / self.sample_hz,
            gaps_ns=self._ns(_joined(self.gaps, np.int64)),
            note=self.note,
        )

    def _ns(self, sample: Ints) -> Ints:
        return np.rint(sample / self.sample_hz * NS).astype(np.int64)

    def _wire(self, at: Ints, words: Samples, bit: int) -> Wire:
        level = (words >> np.uint64(bit) & np.uint64(1)).astype(np.uint8)
        first = np.uint8(int(self._first) >> bit & 1)
        moved = level != np.concatenate(([first], level[:-1]))
        return Wire(
            np.concatenate(([np.int64(0)], self._ns(at[moved]))),
            np.concatenate(([first], level[moved])).astype(np.uint8),
        )


def _joined(parts: Sequence[npt.NDArray[T]], kind: type[T]) -> npt.NDArray[T]:
    return np.concatenate(parts) if parts else np.empty(0, kind)


def read_samples(path: Path, names: Sequence[str], bounds: Bounds) -> LineTake:
    """A capture of the line port: bit k of a byte is names[k], bit 7 a hole before it (docs/lineport.md)."""
    channels = [*names, *(f"D{k}" for k in range(7))]
    bits = [*range(len(names)), *range(7)]
    sampler = Sampler(channels, bits, bounds.line_hz or SAMPLE_HZ, bounds.max_s)
    with path.open("rb") as file:
        while not sampler.full and (data := file.read(BLOCK)):
            x = np.frombuffer(data, np.uint8)
            sampler.feed(x.astype(np.uint64), np.flatnonzero(x & GAP))
    if not sampler.samples:
        raise BadInput(expected("samples", "an empty file", path))
    return sampler.take()

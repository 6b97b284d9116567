"""How the zero of a sensor moves in a run, as the truth port says: for graders alone, no procedure sees it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from psabench.procedures.head_bench import Reading


class ZeroWatch:
    """`Watch(record=...)` that looks at the truth after each position."""

    def __init__(self, record: Callable[[Reading], None], now_s: Callable[[], float], moved_v: Callable[[], float]):
        """record: gets each reading first. now_s, moved_v: time of the bench, and how far the zero has moved, V."""
        self._record, self._now_s, self._moved_v = record, now_s, moved_v
        self._t_s: list[float] = []
        self._seen_v: list[float] = []

    def __call__(self, reading: Reading) -> None:
        self._record(reading)
        now_s = self._now_s()
        if not self._t_s or now_s > self._t_s[-1]:
            self._t_s.append(now_s)
            self._seen_v.append(self._moved_v())

    def moved_v(self, readings: Sequence[Reading]) -> tuple[float, ...]:
        """At each reading, on straight lines between the looks."""
        return tuple(np.interp([r.t_s for r in readings], self._t_s, self._seen_v).tolist())

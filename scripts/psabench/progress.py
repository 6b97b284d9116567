"""Progress of long work on stderr: a bar on a terminal, a line a step elsewhere; for programs what is known so far."""

from __future__ import annotations

import json
import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from shutil import get_terminal_size
from typing import Protocol, TextIO

BAR = 30  # characters
REDRAW_S = 0.1
INTERVALS = "PSABENCH_INTERVALS"  # names a file: a line of JSON each time when more is known


class Advance(Protocol):
    """Once per part done; note: what is known by now, in a few words."""

    def __call__(self, note: str = "") -> None: ...


class Known(Protocol):
    """An estimate as far as it is known."""

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def value(self) -> float: ...
    @property
    def ci_half(self) -> float: ...


Estimated = Callable[[int, Sequence[Known]], None]  # number of readings, what they say


def interval_log() -> Estimated | None:
    """Appends to the file that $PSABENCH_INTERVALS names; None: no one asks, and nothing need be computed.

    No instant is in a line: the same readings write the same bytes.
    """
    name = os.environ.get(INTERVALS)
    if not name:
        return None

    def write(readings: int, known: Sequence[Known]) -> None:
        rows = [{"name": e.name, "value": e.value, "half": e.ci_half, "unit": e.unit} for e in known if _is_finite(e)]
        with Path(name).open("a", encoding="utf-8") as file:
            file.write(json.dumps({"readings": readings, "estimates": rows}, ensure_ascii=False) + "\n")

    return write


def _is_finite(e: Known) -> bool:
    return math.isfinite(e.value) and math.isfinite(e.ci_half)


class Bar:
    """A `procedures.head_bench.Progress` for people."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._live = self._stream.isatty()

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Advance]:
        start_s = drawn_s = time.monotonic()
        done, said = 0, ""

        def advance(note: str = "") -> None:
            nonlocal done, drawn_s, said
            done, said = done + 1, note or said
            now_s = time.monotonic()
            if self._live and (now_s - drawn_s >= REDRAW_S or done == total):
                drawn_s = now_s
                self._draw(name, done, total, now_s - start_s, said)

        try:
            yield advance
        finally:
            if self._live:
                self._stream.write("\r\x1b[K")
            took_s = time.monotonic() - start_s
            self._stream.write(f"{name}: {done}/{total} in {took_s:.1f} s{said and f'; {said}'}\n")
            self._stream.flush()

    def _draw(self, name: str, done: int, total: int, took_s: float, said: str) -> None:
        """In one line of the terminal, as a longer one would be left behind by the next; the bar gives way to words."""
        columns = get_terminal_size().columns - 1
        words = f"{done}/{total}, {took_s * (total - done) / done:.0f} s left{said and f'; {said}'}"
        length = max(0, min(BAR, columns - len(name) - len(words) - 2))
        filled = length * done // total
        line = " ".join([name, *(["█" * filled + "·" * (length - filled)] if length else []), words])
        self._stream.write(f"\r{line[:columns]}\x1b[K")
        self._stream.flush()

"""Progress of long work on stderr: a bar on a terminal, a line a step elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from shutil import get_terminal_size
from typing import Protocol, TextIO

BAR = 30  # characters
REDRAW_S = 0.1


class Advance(Protocol):
    """Once per part done; note: what is known by now, in a few words."""

    def __call__(self, note: str = "") -> None: ...


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

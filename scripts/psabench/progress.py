"""Progress of long work on stderr: a bar on a terminal, a line a step elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

BAR = 30  # characters
REDRAW_S = 0.1


class Bar:
    """A `procedures.head_bench.Progress` for people."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._live = self._stream.isatty()

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Callable[[], None]]:
        start_s = drawn_s = time.monotonic()
        done = 0

        def advance() -> None:
            nonlocal done, drawn_s
            done += 1
            now_s = time.monotonic()
            if self._live and (now_s - drawn_s >= REDRAW_S or done == total):
                drawn_s = now_s
                self._draw(name, done, total, now_s - start_s)

        try:
            yield advance
        finally:
            if self._live:
                self._stream.write("\r\x1b[K")
            took_s = time.monotonic() - start_s
            self._stream.write(f"{name}: {done}/{total} in {took_s:.1f} s\n")
            self._stream.flush()

    def _draw(self, name: str, done: int, total: int, took_s: float) -> None:
        filled = BAR * done // total
        left_s = took_s * (total - done) / done
        bar = "█" * filled + "·" * (BAR - filled)
        self._stream.write(f"\r{name} {bar} {done}/{total}, {left_s:.0f} s left \x1b[K")
        self._stream.flush()

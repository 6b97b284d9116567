"""What pages ask for, on its way from the server's thread to the worker's; and the line that is being carried out."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from psabench.errors import BenchError

WAITING = 64  # requests; a page that asks for more is refused
SHOWN = 200  # characters of a line
# Answered while a line goes on, too: they neither move time nor say anything to the bench.
ASIDE = ("hello", "statistics", "converter", "scenarios", "scenario", "run", "stop", "window", "next")

Asked = tuple[int, dict[str, Any]]


class Stopped(BenchError):
    """A page has stopped the line."""


def _empty_queue() -> queue.Queue[Asked]:
    return queue.Queue(WAITING)


@dataclass(slots=True)
class Inbox:
    """put, greet, stop_line: from any thread; the rest in the worker's."""

    busy: str = ""  # the line that is being carried out
    _stopped: bool = False
    _in_order: queue.Queue[Asked] = field(default_factory=_empty_queue)
    _aside: queue.Queue[Asked] = field(default_factory=_empty_queue)
    _greetings: dict[int, None] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def put(self, number: int, request: dict[str, Any]) -> None:
        """A request of a page. Raises queue.Full."""
        (self._aside if request["do"] in ASIDE else self._in_order).put_nowait((number, request))

    def greet(self, number: int) -> None:
        """A page needs the whole state. One greeting per page is enough, so there is always room."""
        with self._lock:
            self._greetings[number] = None

    def stop_line(self) -> str:
        """End the line that is being carried out, between two slices of time; returns it, "": there is none."""
        with self._lock:
            self._stopped = bool(self.busy)
            return self.busy

    # ---- the worker's

    @property
    def is_empty(self) -> bool:
        return self._in_order.empty() and self._aside.empty() and not self._greetings

    def in_order(self) -> Iterator[Asked]:
        """Requests that have to wait for each other."""
        return _take_all(self._in_order)

    def aside(self) -> Iterator[Asked]:
        """The others, with the greetings."""
        with self._lock:
            numbers, self._greetings = list(self._greetings), {}
        yield from ((n, {"do": "hello"}) for n in numbers)
        yield from _take_all(self._aside)

    @contextmanager
    def doing(self, line: str) -> Iterator[None]:
        """While a line is being carried out it can be stopped."""
        self._set(line[:SHOWN])
        try:
            yield
        finally:
            self._set("")

    def _set(self, line: str) -> None:
        with self._lock:
            self.busy, self._stopped = line, False

    def check(self) -> None:
        """Raises Stopped when a page has stopped the line."""
        if self._stopped:
            raise Stopped(f"{self.busy}: stopped by a page")


def _take_all(q: queue.Queue[Asked]) -> Iterator[Asked]:
    for _ in range(WAITING):
        try:
            yield q.get_nowait()
        except queue.Empty:
            return

"""`psabench record`: all that is on the bus into a log file, the stream's health counted."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import can

from psabench.boards.devices import reader_of
from psabench.boards.stream import FrameCounters
from psabench.errors import BenchError, LinkError
from psabench.link.can_host import CanHost, Message, WallClock
from psabench.link.log_file import LogFile

LOOK_S = 0.2  # real time between looks whether Ctrl-C was pressed, and at the file


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """What went into the file, which is readable whatever ended the recording."""

    stored: int
    received: int
    first_s: float
    last_s: float
    counters: FrameCounters
    broken: str | None  # why the link ended, if it did
    unstored: BenchError | None  # why the file could not take all that was received


def record(
    bus: can.BusABC, path: Path, node: int, for_s: float | None, count: int | None, board: str = "psa2"
) -> Recorded:
    """Record until for_s of wall time or `count` messages have passed, or Ctrl-C, or the peer has gone.

    node, board: whose stream is counted.

    Call it on the main thread. The file is closed properly in every case, and holds just the messages that are counted
    as stored. Raises BadInput as LogFile does.
    """
    reader = reader_of(board, node)
    stamps: list[float] = []  # of the first and the last message
    received = 0
    with ctrl_c_noted() as pressed, CanHost(bus, WallClock()) as host:
        log = LogFile(path, {node: board})

        def keep(m: Message) -> None:
            nonlocal received
            received += 1
            log(m)
            stamps[1:] = [m.timestamp]
            reader.on_message(m)
            if len(reader) >= 4096:
                reader.take()

        host.listeners.append(keep)
        broken = None
        try:
            receive_until(host, for_s, count, lambda: pressed() or log.error is not None, log.check)
        except LinkError as e:
            broken = str(e)
        finally:
            stored = log.close()
        reader.take()
        return Recorded(
            stored=stored,
            received=received,
            first_s=stamps[0] if stamps else 0.0,
            last_s=stamps[-1] if stamps else 0.0,
            counters=reader.counters,
            broken=broken,
            unstored=log.error,
        )


@contextmanager
def ctrl_c_noted() -> Iterator[Callable[[], bool]]:
    """Ctrl-C is the usual way to end a recording, SIGTERM of a script: between two messages, never inside one."""
    pressed: list[int] = []
    before = {s: signal.signal(s, lambda number, _: pressed.append(number)) for s in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: bool(pressed)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def receive_until(
    host: CanHost, for_s: float | None, count: int | None, stop: Callable[[], bool], look: Callable[[], object]
) -> None:
    """Receive until it is over, with a look at the file every LOOK_S of real time."""
    deadline_s = None if for_s is None else host.clock.now_s() + for_s
    look_s = time.monotonic() + LOOK_S
    while not stop() and (count is None or host.received < count):
        left_s = LOOK_S if deadline_s is None else min(LOOK_S, deadline_s - host.clock.now_s())
        if left_s <= 0.0:
            return
        host.receive(left_s)
        if time.monotonic() >= look_s:
            look()
            look_s = time.monotonic() + LOOK_S

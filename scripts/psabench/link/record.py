"""`psabench record`: all that is on the bus into a file of python-can's own formats, the stream's health counted."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import can
from can.io.generic import MessageWriter
from can.io.logger import MESSAGE_WRITERS

from psabench.boards.devices import reader_of
from psabench.boards.psa2.frames import FrameCounters
from psabench.errors import BadInput, LinkError, expected
from psabench.link.can_host import CanHost, Message, WallClock

LOOK_S = 0.2  # real time between looks whether Ctrl-C was pressed
FORMATS = sorted(MESSAGE_WRITERS)  # by ending: .log candump, .blf and .asc Vector, .mf4 (with asammdf) ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """What went into the file, which is complete whatever ended the recording."""

    messages: int
    first_s: float
    last_s: float
    counters: FrameCounters
    broken: str | None  # why the link ended, if it did


def record(
    bus: can.BusABC, path: Path, node: int, for_s: float | None, count: int | None, board: str = "psa2"
) -> Recorded:
    """Record until for_s of wall time or `count` messages have passed, or Ctrl-C, or the peer has gone.

    node, board: whose stream is counted.

    Call it on the main thread. The file is closed properly in every case, and holds just the messages that are counted.
    Raises BadInput for an ending that python-can does not know.
    """
    if path.suffix not in FORMATS:
        raise BadInput(expected(f"an ending of {' '.join(FORMATS)}", path.suffix or "none", path))
    reader = reader_of(board, node)
    stamps: list[float] = []  # of the first and the last message
    messages = 0
    with _ctrl_c_noted() as pressed, CanHost(bus, WallClock()) as host, _writer(path) as log:

        def keep(m: Message) -> None:
            nonlocal messages
            log(m)
            messages += 1
            stamps[1:] = [m.timestamp]
            reader.on_message(m)
            if len(reader) >= 4096:
                reader.take()

        host.listeners.append(keep)
        broken = None
        try:
            _receive(host, for_s, count, pressed)
        except LinkError as e:
            broken = str(e)
        reader.take()
        first_s, last_s = (stamps[0], stamps[-1]) if stamps else (0.0, 0.0)
        return Recorded(messages=messages, first_s=first_s, last_s=last_s, counters=reader.counters, broken=broken)


@contextmanager
def _ctrl_c_noted() -> Iterator[Callable[[], bool]]:
    """Ctrl-C is the usual way to end a recording; it takes effect between two messages, never inside one."""
    pressed: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: pressed.append(number))
    try:
        yield lambda: bool(pressed)
    finally:
        signal.signal(signal.SIGINT, before)


def _writer(path: Path) -> MessageWriter:
    try:
        return can.Logger(str(path))
    except OSError as e:
        raise BadInput(f"{path}: {e.strerror}") from e


def _receive(host: CanHost, for_s: float | None, count: int | None, stop: Callable[[], bool]) -> None:
    deadline_s = None if for_s is None else host.clock.now_s() + for_s
    while not stop() and (count is None or host.received < count):
        left_s = LOOK_S if deadline_s is None else min(LOOK_S, deadline_s - host.clock.now_s())
        if left_s <= 0.0:
            return
        host.receive(left_s)

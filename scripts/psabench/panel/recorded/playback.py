"""A recording of the CAN bus that is played: frames come when the time that they had has come. Never all in memory.

The readers are the package's (psabench.logs), so what `psabench decode` reads is played. Time is 0 at the first frame.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from psabench.errors import BadInput, expected
from psabench.link.can_host import Message
from psabench.logs.formats import read_frames

SCANNED = 200_000  # frames that are looked at for the units and the length: some seconds
CHANNELS, IDS = 16, 4096  # buses and identifiers that are noted
TURN = 512  # frames between two looks at who waits

Taken = Callable[[str, Message], None]


@dataclass(slots=True)
class Scan:
    """The beginning of a recording, or all of it."""

    begin_s: float  # stamp of the first frame
    length_s: float
    whole: bool = True  # False: it goes on after that
    damage: str = ""  # what follows cannot be read, and why
    ids: dict[str, set[int]] = field(default_factory=dict)  # of data frames, by the name of the bus


def bus_of(m: Message) -> str:
    """What the log calls it; "can" where it names none."""
    return "can" if m.channel in (None, "") else str(m.channel)


def scan_log(path: Path, look: Callable[[float], None]) -> Scan:
    """Its units and its length, as far as SCANNED frames tell. Raises BadInput where there is no frame at all.

    look: called each TURN frames with the part of SCANNED that has been read; what it raises ends the reading.
    """
    found: Scan | None = None
    try:
        for count, m in enumerate(stamped_frames(path)):
            if count % TURN == TURN - 1:
                look(count / SCANNED)
            if found is None:
                found = Scan(begin_s=m.timestamp, length_s=0.0)
            if count >= SCANNED:
                found.whole = False
                break
            found.length_s = m.timestamp - found.begin_s
            _note_frame(found, m)
    except BadInput as e:
        if found is None:
            raise
        found.damage, found.whole = str(e), False
    if found is None:
        raise BadInput(expected("a frame", "none", path))
    return found


def _note_frame(found: Scan, m: Message) -> None:
    bus = bus_of(m)
    if bus not in found.ids and len(found.ids) >= CHANNELS:
        return
    ids = found.ids.setdefault(bus, set())
    if not (m.is_extended_id or m.is_error_frame or m.is_remote_frame) and len(ids) < IDS:
        ids.add(m.arbitration_id)


def stamped_frames(path: Path) -> Iterator[Message]:
    """Frames in the order of the file; a stamp that goes back, or is no number, is that of the frame before."""
    last_s = -math.inf
    for m in read_frames(path):
        if not m.timestamp >= last_s or not math.isfinite(m.timestamp):
            m.timestamp = last_s if math.isfinite(last_s) else 0.0
        last_s = m.timestamp
        yield m


class Player:
    """Plays a file from its beginning; going back reads it again."""

    def __init__(self, path: Path, begin_s: float, take: Taken) -> None:
        self._path, self._begin_s, self._take = path, begin_s, take
        self.between: Callable[[], None] = lambda: None
        self.rewind()

    def rewind(self) -> None:
        self.now_s = 0.0
        self.ended = ""  # why no more frames come: "end", or the damage
        self._frames = stamped_frames(self._path)
        self._next: Message | None = None

    def run_to(self, t_s: float, real_s: float = math.inf) -> None:
        """Hand on all frames up to that time, or the last; as far as real_s of real time lets it come.

        Calls `between`, which may end it.
        """
        count, deadline_s = 0, time.monotonic() + real_s
        while not self.ended and (m := self._peek()) is not None and m.timestamp <= t_s:
            self.now_s, self._next = max(self.now_s, m.timestamp), None
            self._take(bus_of(m), m)
            count += 1
            if count % TURN == 0:
                self.between()
                if time.monotonic() > deadline_s:
                    return
        if not self.ended:
            self.now_s = max(self.now_s, t_s)
        self.between()

    def _peek(self) -> Message | None:
        """The next frame, in time since the first; None at the end."""
        if self._next is None:
            try:
                self._next = next(self._frames, None)
            except BadInput as e:
                self.ended = str(e)
                return None
            if self._next is None:
                self.ended = "end"
                return None
            self._next.timestamp -= self._begin_s
        return self._next

"""What is counted of a unit's stream, and where its counter begins again: the same for all boards.

A counter tells what is missing between two samples of one stretch of the stream. The first sample that comes begins a
stretch, and so does the first one after

- NMT start, where NMT stop, pre-operational or a reset came before it; a start of a stream that runs changes nothing;
- the boot-up message, after which the board counts from 0;
- `forget` of the reader.

What was sent between two stretches is not known: it counts neither as received nor as lost, and
`FrameCounters.stretches` says how many there were. So a sample that is lost just before a stop, or just after a start,
is in no counter. NMT and boot-up: CiA 301, 7.2.8.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from psabench.link.can_host import NMT, Message
from psabench.link.signals import Ints

BOOT_UP = 0x700  # and the node
START, ENDS = 0x01, (0x02, 0x80, 0x81, 0x82)  # NMT commands; stop, pre-operational, reset node, reset communication


@dataclass(slots=True, kw_only=True)
class FrameCounters:
    """What was wrong with the stream since it was opened."""

    frames: int = 0
    lost: int = 0  # gaps in the counter within a stretch (in the fast form of a PSA-2, toggles that did not toggle)
    torn: int = 0  # an incomplete sample, or a frame of the wrong length; the gap that it leaves is `lost`, too
    overruns: int = 0  # the board says that it lost a conversion
    stretches: int = 0  # beginnings of the counter: what was sent between two of them is not known


class NodeState:
    """Whether the stream of a node goes on, by the NMT commands and boot-up messages on its bus."""

    def __init__(self, node_id: int) -> None:
        self._node, self._boot_up = node_id, BOOT_UP + node_id
        self._ended = False
        self.ids = (NMT, self._boot_up)

    def begins(self, m: Message) -> bool:
        """Take a message of `ids`: whether the next sample is the first of a stretch."""
        data = bytes(m.data)
        if m.arbitration_id == self._boot_up:  # or a heartbeat
            return data == b"\0"
        if len(data) != 2 or data[1] not in (0, self._node):
            return False
        starts = self._ended and data[0] == START
        self._ended = data[0] in ENDS or (self._ended and not starts)
        return starts


def missing_counts(counter: Ints, bits: int, before: int | None) -> int:
    """How many numbers of a wrapping counter that rises by one are missing; before: its last one, if it is known.

    A number that comes twice is a repeated frame, not a lost one.
    """
    steps = np.diff(counter if before is None else np.concatenate([[before], counter])) % (1 << bits)
    return int((steps - 1).clip(min=0).sum())


def by_stretch(count: int, marks: Sequence[int]) -> Iterator[tuple[bool, slice]]:
    """Places of so many samples, those between two marks together; whether a stretch begins with them.

    Where it begins without any, the next sample that comes is its first.
    """
    for k, (begin, end) in enumerate(pairwise([0, *marks, count])):
        yield k > 0, slice(begin, end)

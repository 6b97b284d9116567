"""What a reader took from a file, and the bounds within which every reader keeps.

Whatever the bytes of a file are, a reader ends in `BadInput` with the file and the place, or in a take whose `note`
says where it stopped and why. What came before the damage is checked.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from psabench.conform.capture.log import CanFrame
from psabench.conform.defaults import MAX_S
from psabench.link.signals import Ints
from psabench.link.vcd import Wire

NS = 1e9
MOST_FRAMES = 2_000_000  # of one log: 0.5 GB
MOST_CHANNELS = 64
MOST_BYTES = 4 << 30  # of a file, unpacked
BLOCK = 1 << 22  # bytes looked at together


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """How much of a file is checked. line_hz None: the file says it, or edges are as exact as its unit."""

    max_s: float = MAX_S
    line_hz: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CanTake:
    """Frames of a log in its order; note: where and why it ended before its end, "" where it did not."""

    frames: tuple[CanFrame, ...]
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class LineTake:
    """Channels by the names that the file gives them. resolution_ns: how early an edge may have been."""

    channels: Mapping[str, Wire]
    start_ns: int
    end_ns: int
    resolution_ns: float
    gaps_ns: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    note: str = ""

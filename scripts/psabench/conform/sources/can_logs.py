"""Logs of a CAN bus, every format that psabench.logs.formats lists."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can

from psabench.conform.capture.log import CanFrame
from psabench.conform.sources.mf4 import candump_of
from psabench.conform.sources.taken import MOST_FRAMES, Bounds, CanTake
from psabench.errors import BadInput, expected
from psabench.logs.formats import READABLE, reader_of

ENDINGS = tuple(READABLE)
EPOCH_S = 1e6  # stamps beyond are of a calendar: they are reported from the first one on
MOST_S = 1e11  # of a stamp


def read_can(path: Path, bounds: Bounds) -> CanTake:
    """Raises BadInput for a log without a frame, OSError."""
    messages, trouble = _messages(path, bounds)
    frames: list[CanFrame] = []
    note = ""
    try:
        for m in messages:
            if not math.isfinite(m.timestamp) or abs(m.timestamp) > MOST_S:
                note = f"message {len(frames) + 1} has the time stamp {m.timestamp}"
                break
            if frames and m.timestamp - frames[0].t_s > bounds.max_s:
                note, trouble = f"judged to {bounds.max_s:g} s", ""
                break
            if len(frames) >= MOST_FRAMES:
                note, trouble = f"judged to its {MOST_FRAMES} frames", ""
                break
            frames.append(CanFrame.of(m, float(m.timestamp)))
    except BadInput as e:
        note = str(e).removeprefix(f"{path}: ")
    note = note or trouble
    if not frames:
        raise BadInput(f"{path}: {note}" if note else expected("CAN frames", "none", path))
    return CanTake(frames=_from_begin(frames), note=note)


def _messages(path: Path, bounds: Bounds) -> tuple[Iterator[can.Message], str]:
    """What the reader of this ending finds, and what is known to be wrong with the file."""
    if path.suffix.lower() != ".mf4":
        return reader_of(path)(path), ""
    try:
        log, trouble = candump_of(path, bounds.max_s, MOST_FRAMES)
    except ValueError as e:
        raise BadInput(f"{path}: {e}") from e
    reader: Any = can.CanutilsLogReader
    return iter(reader(io.TextIOWrapper(log, encoding="utf-8", errors="replace"))), trouble


def _from_begin(frames: list[CanFrame]) -> tuple[CanFrame, ...]:
    """Stamps of a calendar have too few digits left for microseconds: they are counted from the first frame on."""
    zero_s = frames[0].t_s if abs(frames[0].t_s) > EPOCH_S else 0.0
    if not zero_s:
        return tuple(frames)
    return tuple(f._replace(t_s=f.t_s - zero_s) for f in frames)

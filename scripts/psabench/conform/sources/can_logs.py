"""Logs of a CAN bus, every format that psabench.logs.formats lists: by python-can's readers, and our own.

Readers of our own are bounded themselves. What python-can reads is made safe first.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import can
from can.io.player import MESSAGE_READERS

from psabench.conform.capture.log import CanFrame
from psabench.conform.sources.blf import safe_blf
from psabench.conform.sources.mf4 import candump_of
from psabench.conform.sources.taken import BLOCK, MOST_FRAMES, Bounds, CanTake
from psabench.errors import BadInput, expected
from psabench.logs.formats import READABLE, READERS, reader_of

TEXT = (".log", ".asc", ".trc", ".csv")
ENDINGS = tuple(READABLE)
MOST_LINE = 1 << 16  # characters of a line of a text log
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
    except OSError:
        raise
    except BadInput as e:  # a reader of our own
        note = str(e).removeprefix(f"{path}: ")
    except Exception as e:  # python-can's readers raise whatever their parsing comes to; no byte of a file may end us
        note = (
            f"message {len(frames) + 1} cannot be read ({type(e).__name__}: {str(e)[:80]}); those before it are judged"
        )
    if not note and frames and path.suffix.lower() in TEXT and not _ends_with_a_line(path):
        frames.pop()
        note = f"its last line is cut; the {len(frames)} frames before it are judged"
    note = note or trouble
    if not frames:
        raise BadInput(f"{path}: {note}" if note else expected("CAN frames", "none", path))
    return CanTake(frames=_from_begin(frames), note=note)


def _from_begin(frames: list[CanFrame]) -> tuple[CanFrame, ...]:
    """Stamps of a calendar have too few digits left for microseconds: they are counted from the first frame on."""
    zero_s = frames[0].t_s if abs(frames[0].t_s) > EPOCH_S else 0.0
    if not zero_s:
        return tuple(frames)
    return tuple(f._replace(t_s=f.t_s - zero_s) for f in frames)


def _messages(path: Path, bounds: Bounds) -> tuple[Iterator[can.Message], str]:
    """What the reader of this ending finds, and what is known to be wrong with the file."""
    ending = path.suffix.lower()
    if ending in READERS and ending != ".mf4":
        return reader_of(path)(path), ""
    source, trouble = _source(path, bounds)
    return _by_python_can(".log" if ending == ".mf4" else ending, source), trouble


def _source(path: Path, bounds: Bounds) -> tuple[Any, str]:
    """What python-can shall read, and what is known to be wrong with it."""
    try:
        if path.suffix.lower() == ".blf":
            return safe_blf(path)
        if path.suffix.lower() == ".mf4":
            log, trouble = candump_of(path, bounds.max_s, MOST_FRAMES)
            return io.TextIOWrapper(log, encoding="utf-8", errors="replace"), trouble
    except ValueError as e:
        raise BadInput(f"{path}: {e}") from e
    _check_lines(path)
    return io.TextIOWrapper(path.open("rb"), encoding="utf-8", errors="replace"), ""


def _ends_with_a_line(path: Path) -> bool:
    """A line that is cut may still read as a frame, and would be a shorter one."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 1))
        return file.read(1) == b"\n"


def _check_lines(path: Path) -> None:
    """python-can takes whole lines: one without an end would fill the memory. Raises BadInput."""
    where = begin = 0
    with path.open("rb") as file:
        while data := file.read(BLOCK):
            ends = [k for k in (data.find(b"\n"),) if k >= 0]
            if (where + ends[0] if ends else where + len(data)) - begin > MOST_LINE:
                raise BadInput(expected(f"lines of {MOST_LINE} characters at most", "more", f"{path}: byte {begin}"))
            longest = max(map(len, data.split(b"\n")), default=0)
            if longest > MOST_LINE:
                raise BadInput(expected(f"lines of {MOST_LINE} characters at most", "more", f"{path}: byte {where}"))
            where += len(data)
            last = data.rfind(b"\n")
            begin = where - len(data) + last + 1 if last >= 0 else begin


def _by_python_can(ending: str, source: Any) -> Iterator[can.Message]:
    readers: Mapping[str, Callable[..., Any]] = MESSAGE_READERS
    try:
        yield from readers[ending](source)
    finally:
        source.close()

"""Logs by python-can's readers, bounded: text logs line by line, BLF container by container.

A reader of python-can raises whatever its parsing comes to, and follows the lengths that a file claims.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import can
from can.io.player import MESSAGE_READERS

from psabench.conform.sources.blf import safe_blf
from psabench.errors import BadInput, expected

MOST_LINE = 1 << 16  # characters of a line of a text log


# Lines that are no frame, and of which python-can's readers say nothing; they pass over a damaged frame as well.
# ASC: comments, the head, events other than frames. TRC: comments, states of the bus, errors, events.
NO_FRAME: Mapping[str, re.Pattern[str]] = {
    ".asc": re.compile(
        r"\s*($|//|date\b|base\b|(no\s+)?internal\s+events|begin\s+trigger|end\s+trigger"
        r"|\d+\.\d+\s+(?!CANFD\b)[a-z]|\d+\.\d+\s+\d+\s+(statistic|J1939))",
        re.ASCII | re.IGNORECASE,
    ),
    ".trc": re.compile(
        r"\s*($|;|\d+\)?\s+\S+\s+(FFFFFFFF|((\d+\s+)?(Warng|Error))|ST|EC|ER|EV)\b)", re.ASCII | re.IGNORECASE
    ),
}


class _Lines(io.TextIOWrapper):
    """Raises ValueError for a line without an end: it would fill the memory, or was cut and gave a shorter frame.

    no_frame: the lines that give no message. Raises ValueError when more is read before each other line has given one.
    """

    no_frame: re.Pattern[str] | None = None
    _owed = ""  # a line that has to give a message

    def give(self, messages: Iterator[can.Message]) -> Iterator[can.Message]:
        """The messages of a reader of these lines. Raises ValueError for one with fewer bytes than it claims."""
        for m in messages:
            if not m.is_remote_frame and len(m.data) < (m.dlc if m.is_fd else min(m.dlc, 8)) and not m.is_error_frame:
                raise ValueError(expected(f"{m.dlc} bytes", len(m.data)))
            self._owed = ""
            yield m

    def __next__(self) -> str:  # type: ignore[override]  # of the stub's base, which is of bytes
        if self._owed:
            raise ValueError(expected("a frame", repr(self._owed.strip()[:80])))
        line = self.readline(MOST_LINE + 1)
        if not line:
            raise StopIteration
        if self.no_frame is not None and not self.no_frame.match(line):
            self._owed = line
        if len(line) > MOST_LINE:
            raise ValueError(expected(f"lines of {MOST_LINE} characters at most", "more"))
        if not line.endswith("\n"):
            raise ValueError(expected("a line feed at the end", repr(line[-40:])))
        return line


def read_text(path: Path) -> Iterator[can.Message]:
    """Of candump, ASC, TRC, CSV. Raises BadInput at a damage, after the frames before it, OSError."""
    readers: Mapping[str, Callable[..., Any]] = MESSAGE_READERS
    ending = path.suffix.lower()
    with _Lines(path.open("rb"), encoding="utf-8", errors="replace") as file:
        file.no_frame = NO_FRAME.get(ending)
        yield from _until_damage(path, file.give(readers[ending](file)))


def read_blf(path: Path) -> Iterator[can.Message]:
    """Raises BadInput at a damage, after the frames before it, OSError."""
    yield from _until_damage(path, _blf_messages(path))


def _blf_messages(path: Path) -> Iterator[can.Message]:
    """Raises ValueError, and what python-can raises."""
    reader: Any = can.BLFReader
    for piece, trouble in safe_blf(path):
        yield from reader(piece)
        if trouble:
            raise ValueError(trouble)


def _until_damage(path: Path, messages: Iterator[can.Message]) -> Iterator[can.Message]:
    """Raises BadInput for what the reader raises."""
    read = 0
    try:
        for m in messages:
            yield m
            read += 1
    except OSError:
        raise
    except Exception as e:  # no byte of a file may end us
        said = str(e)[:160] if type(e) is ValueError else f"{type(e).__name__}: {str(e)[:160]}"
        got = f"a damaged one ({said}); the {read} before it are good"
        raise BadInput(expected("a whole message", got, f"{path}: message {read + 1}")) from e

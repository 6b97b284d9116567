"""Logs by python-can's readers, bounded: text logs line by line, BLF container by container.

A reader of python-can raises whatever its parsing comes to, and follows the lengths that a file claims.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import can
from can.io.player import MESSAGE_READERS

from psabench.conform.sources.blf import safe_blf
from psabench.errors import BadInput, expected

MOST_LINE = 1 << 16  # characters of a line of a text log


class _Lines(io.TextIOWrapper):
    """Raises ValueError for a line without an end: it would fill the memory, or was cut and gave a shorter frame."""

    def __next__(self) -> str:  # type: ignore[override]  # of the stub's base, which is of bytes
        line = self.readline(MOST_LINE + 1)
        if not line:
            raise StopIteration
        if len(line) > MOST_LINE:
            raise ValueError(expected(f"lines of {MOST_LINE} characters at most", "more"))
        if not line.endswith("\n"):
            raise ValueError(expected("a line feed at the end", repr(line[-40:])))
        return line


def read_text(path: Path) -> Iterator[can.Message]:
    """Of candump, ASC, TRC, CSV. Raises BadInput at a damage, after the frames before it, OSError."""
    readers: Mapping[str, Callable[..., Any]] = MESSAGE_READERS
    with _Lines(path.open("rb"), encoding="utf-8", errors="replace") as file:
        yield from _until_damage(path, readers[path.suffix.lower()](file))


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

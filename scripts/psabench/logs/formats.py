"""CAN logs by ending: one table of what reads them. psabench.link.log_file has the table of what writes them."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import can
from can.io.player import MESSAGE_READERS

from psabench.errors import BadInput, check_there, expected, input_error
from psabench.places import no_package

READERS: Mapping[str, str] = {  # module and function; text logs: read_text
    ".blf": "psabench.logs.python_can:read_blf",
    ".db": "psabench.logs.sqlite_log:read_db",
    ".lcmlog": "psabench.lcm.frames:read_frames",
    ".mcap": "psabench.logs.mcap_log:read_mcap",
    ".mf4": "psabench.logs.formats:read_mf4",
    ".pcap": "psabench.logs.pcap:read_pcap",
}
TEXT_READER = "psabench.logs.python_can:read_text"
READABLE = sorted({*MESSAGE_READERS, *READERS})
# What each keeps beside the frame: instants to the microsecond, and the number of the bus. docs/tools/logs.md.
KEEPS: Mapping[str, tuple[str, ...]] = {
    ".asc": ("channels",),
    ".blf": ("channels",),
    ".csv": ("time stamps",),
    ".db": ("time stamps",),
    ".lcmlog": ("time stamps", "channels"),
    ".log": ("time stamps", "channels"),
    ".mcap": ("time stamps", "channels"),
    ".mf4": ("time stamps", "channels"),
    ".pcap": ("time stamps",),
    ".trc": (),
}
ALL_S, ALL_FRAMES = 1e12, 1 << 40


def read_frames(path: Path) -> Iterator[can.Message]:
    """Frames of a log, in the order of the file. Raises BadInput at a damage, after the frames before it."""
    check_readable(path)
    try:
        yield from reader_of(path)(path)
    except OSError as e:
        raise input_error(path, "a CAN log", e) from e


def check_readable(path: Path) -> None:
    """Whether there is a log with an ending that we read; its content is not looked at. Raises BadInput."""
    if path.suffix.lower() not in READABLE:
        raise BadInput(expected(f"an ending of {' '.join(READABLE)}", path.suffix or "none", path))
    check_there(path, "a CAN log")


def reader_of(path: Path) -> Callable[[Path], Iterator[can.Message]]:
    """Of a log with an ending of READABLE. Raises BadInput where a package is missing."""
    module, _, name = READERS.get(path.suffix.lower(), TEXT_READER).partition(":")
    try:
        function: Callable[[Path], Iterator[can.Message]] = getattr(import_module(module), name)
    except ImportError as e:
        raise no_package(e, path) from e
    return function


def read_mf4(path: Path) -> Iterator[can.Message]:
    """By asammdf in a process of its own. Raises BadInput."""
    from psabench.conform.sources.mf4 import candump_of

    try:
        log, trouble = candump_of(path, ALL_S, ALL_FRAMES)
    except ValueError as e:
        raise BadInput(f"{path}: {e}") from e
    reader: Any = can.CanutilsLogReader
    with io.TextIOWrapper(log, encoding="utf-8") as text:
        yield from reader(text)
    if trouble:
        raise BadInput(expected("a whole log", trouble, path))

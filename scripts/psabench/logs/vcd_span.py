"""First and last instants of a VCD file from its ends: what lies between is not read, however long it is."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from psabench.errors import BadInput, expected, input_error

MOST_HEAD = 1 << 20  # bytes of a VCD in which its lines are declared
TAIL = 1 << 16
SCALE = re.compile(rb"\$timescale\s+(\d+)\s*(s|ms|us|ns|ps|fs)\s+\$end")
TIME = re.compile(rb"^#(\d+)", re.MULTILINE)
FS = {b"s": 10**15, b"ms": 10**12, b"us": 10**9, b"ns": 10**6, b"ps": 10**3, b"fs": 1}


def read_head(vcd: Path) -> bytes:
    """The declarations and what follows them at once. Raises BadInput."""
    try:
        with vcd.open("rb") as file:
            return file.read(MOST_HEAD)
    except OSError as e:
        raise input_error(vcd, "a VCD file", e) from e


@dataclass(frozen=True, slots=True)
class Span:
    """Of a recording, ns: its first levels, its first change after them, its last time stamp."""

    start_ns: int
    edge_ns: int
    end_ns: int


def span_of(vcd: Path) -> Span:
    """Raises BadInput."""
    head = read_head(vcd)
    with vcd.open("rb") as file:
        file.seek(max(0, vcd.stat().st_size - TAIL))
        tail = file.read()
    unit, first, last = _unit_in(head), TIME.findall(head), TIME.findall(tail)
    if not unit or not first or not last:
        raise BadInput(expected("a VCD file with a time scale and times", "another file", vcd))
    start, edge, end = (int(t) * unit // FS[b"ns"] for t in (first[0], [*first, last[-1]][1], last[-1]))
    return Span(start, edge, end)


def unit_fs(vcd: Path) -> int:
    """The unit of a recording's times. Raises BadInput."""
    if unit := _unit_in(read_head(vcd)):
        return unit
    raise BadInput(expected("a VCD file with a time scale", "another file", vcd))


def _unit_in(head: bytes) -> int:
    """fs; 0: none is declared."""
    scale = SCALE.search(head)
    return int(scale[1]) * FS[scale[2]] if scale else 0

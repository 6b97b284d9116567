"""VCD files of any tool as a recording of lines; sigrok's comment in them says how exact the edges are."""

from __future__ import annotations

import re
from pathlib import Path

from psabench.conform.sources.taken import NS, Bounds, LineTake
from psabench.errors import BadInput
from psabench.link.vcd import read_vcd_part

SAMPLED = re.compile(r"channels at (\d+(?:\.\d+)?) ?([kMG]?)Hz")  # of sigrok, in $comment
HZ = {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}


def read_vcd_file(path: Path, bounds: Bounds) -> LineTake:
    """Raises BadInput for what is no VCD with 1-bit wires and times; OSError."""
    try:
        with path.open("rb") as file:
            part = read_vcd_part(file, str(path), bounds.max_s * NS)
    except ValueError as e:
        raise BadInput(str(e)) from e
    if part.start_ns < 0 or not part.wires:
        raise BadInput(f"{path}: {part.note or 'expected a time and a level of a 1-bit wire, got none'}")
    sampled = SAMPLED.search(part.head)
    of_file_ns = NS / (float(sampled[1]) * HZ[sampled[2]]) if sampled and float(sampled[1]) > 0 else 0.0
    sample_ns = NS / bounds.line_hz if bounds.line_hz else of_file_ns
    return LineTake(
        channels=part.wires,
        start_ns=part.start_ns,
        end_ns=part.end_ns,
        resolution_ns=max(1.0, part.unit_fs / 1e6, sample_ns),
        note=part.note,
    )

"""Sampled bytes of up to seven lines, as the line port and bit-bang adapters give them, to a log of edges.

Bit k of a byte is line k at that sample, bit 7 says that samples were lost just before it (docs/lineport.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from psabench.boards.registry import BOARDS
from psabench.conform.capture.log import LineLog
from psabench.link.vcd import Vcd, Wire

NS = 1e9
GAP = 0x80
BLOCK = 1 << 22  # samples looked at together: bounds the memory

# Lines of the port, bit 0 first, by the names that recordings of all pins have (docs/lineport.md).
PORT_LINES: Mapping[str, Sequence[str]] = {name: board.port_lines for name, board in BOARDS.items()}


def line_log(data: bytes, family: str, sample_hz: float) -> LineLog:
    """Edges of the lines; sample 0 is the instant 0. An edge is at the first sample that shows it."""
    x = np.frombuffer(data, np.uint8)
    end_ns = round(len(x) / sample_hz * NS)
    names = PORT_LINES[family]
    changes = _changes(x)
    wires = {name: _wire(x, changes, bit, sample_hz) for bit, name in enumerate(names)}
    gaps = np.rint(np.flatnonzero(x & GAP) / sample_hz * NS).astype(np.int64)
    return LineLog(recording=Vcd(1, 0, end_ns, wires), resolution_ns=NS / sample_hz, gaps_ns=gaps)


def _changes(x: npt.NDArray[np.uint8]) -> npt.NDArray[np.int64]:
    """Samples (n,) at which any of the lines differs from the sample before."""
    parts = []
    for k in range(0, len(x), BLOCK):
        block = x[max(k - 1, 0) : k + BLOCK] & ~np.uint8(GAP)
        parts.append(np.flatnonzero(block[1:] != block[:-1]) + max(k - 1, 0) + 1)
    return np.concatenate(parts) if parts else np.empty(0, np.int64)


def _wire(x: npt.NDArray[np.uint8], changes: npt.NDArray[np.int64], bit: int, sample_hz: float) -> Wire:
    at = changes[((x[changes] ^ x[changes - 1]) >> bit & 1).astype(bool)] if len(changes) else changes
    level = (x[at] >> bit & 1).astype(np.uint8)
    first = np.array([x[0] >> bit & 1 if len(x) else 0], np.uint8)
    t_ns = np.rint(at / sample_hz * NS).astype(np.int64)
    return Wire(np.concatenate(([np.int64(0)], t_ns)), np.concatenate((first, level)))

"""Frames out of a log of psa-emu (`--can log:FILE`, the format of candump -L), all at once.

Only data frames with an 11-bit identifier and eight bytes: what units stream, and SDO. Their lines are of one length,
so that ten thousands of them are one array.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psabench.errors import LinkError, expected
from psabench.link.signals import Floats, Ints, Signal

STAMP = 20  # "(0000000001.234567) "
ID, DATA = 3, 16  # digits
NEWLINE, HASH = ord("\n"), ord("#")

_NIBBLE = np.full(256, 0xFF, dtype=np.uint8)
_NIBBLE[[ord(c) for c in "0123456789ABCDEF"]] = np.arange(16)


@dataclass(frozen=True, slots=True, kw_only=True)
class Logged:
    """n frames in the order of the bus."""

    t_s: Floats  # (n,) end of the frame
    can_id: Ints  # (n,)
    data: npt.NDArray[np.uint64]  # (n,) eight bytes, the first one lowest

    def __len__(self) -> int:
        return len(self.t_s)

    def only(self, ids: Iterable[int]) -> Logged:
        """Those with one of these identifiers."""
        return self.at(np.isin(self.can_id, list(ids)))

    def at(self, which: npt.NDArray[np.bool_] | Ints | slice) -> Logged:
        """Some of them."""
        return Logged(t_s=self.t_s[which], can_id=self.can_id[which], data=self.data[which])

    def raw(self, s: Signal) -> Ints:
        """A signal's integers."""
        value = ((self.data >> np.uint64(s.start_bit)) & np.uint64((1 << s.bits) - 1)).astype(np.int64)
        return np.where(value >= 1 << (s.bits - 1), value - (1 << s.bits), value) if s.signed else value

    def physical(self, s: Signal) -> Floats:
        """A signal in its own unit."""
        return self.raw(s).astype(np.float64) * s.scale + s.offset


def read(text: bytes, ids: Iterable[int]) -> Logged:
    """The frames with these identifiers. Raises LinkError for a log that is damaged or cut short."""
    lines = _lines(text)
    can_id = _hex(lines[:, -DATA - 2 - ID : -DATA - 2]).astype(np.int64) @ np.array([256, 16, 1])
    kept = np.isin(can_id, list(ids))
    lines, can_id = lines[kept], can_id[kept]
    nibbles = _hex(lines[:, -DATA - 1 : -1])
    joined = np.ascontiguousarray(nibbles[:, 0::2] << 4 | nibbles[:, 1::2])
    return Logged(t_s=_stamps(lines), can_id=can_id, data=joined.view("<u8")[:, 0])


def _lines(text: bytes) -> npt.NDArray[np.uint8]:
    """Those of our frames, (n, length), newline included."""
    if text and text[-1] != NEWLINE:
        raise LinkError(expected("a whole log", "one that is cut short", "bus log"))
    all_bytes = np.frombuffer(text, dtype=np.uint8)
    ends = np.flatnonzero(all_bytes == NEWLINE) + 1
    starts = np.concatenate([[0], ends[:-1]])
    if not ends.size:
        return np.zeros((0, STAMP + ID + DATA + 3), dtype=np.uint8)
    channel = text[STAMP : text.index(b" ", STAMP)]
    length = STAMP + len(channel) + 1 + ID + 1 + DATA + 1
    before, first = (all_bytes[np.maximum(ends - DATA - k, 0)] for k in (2, 1))
    other = np.flatnonzero((ends - starts != length) | (before != HASH) | (first == HASH))
    # What lies between two other lines is of one length: most of the log in few pieces.
    pieces = zip(np.concatenate([[0], ends[other]]), np.concatenate([starts[other], [len(text)]]), strict=True)
    ours = np.concatenate([all_bytes[a:b] for a, b in pieces])
    return ours.reshape(-1, length)


def _hex(digits: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    value = _NIBBLE[digits]
    if value.size and value.max() > 15:
        raise LinkError(expected("hexadecimal digits", "other characters", "bus log"))
    return value


def _stamps(lines: npt.NDArray[np.uint8]) -> Floats:
    """Seconds: exact to the microsecond that is printed."""
    microseconds = np.zeros(len(lines), dtype=np.int64)
    for column in (*range(1, 11), *range(12, 18)):
        microseconds = microseconds * 10 + (lines[:, column] - ord("0"))
    return np.asarray(microseconds / 1e6)

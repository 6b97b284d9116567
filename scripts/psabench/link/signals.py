"""Vectorised decoding of DBC signals: many frames of one message at once.

cantools knows the DBC and decodes one frame at a time; a stream of thousands a second wants arrays. The layout (start
bit, length, sign, scale, offset) is cantools', the arithmetic is numpy's. Little-endian signals only: the DBC has no
others, and `layout` says so if one appears.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from psabench.errors import expected

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """Where a signal lies in its frame, and what it means: physical = raw * scale + offset."""

    start_bit: int
    bits: int
    signed: bool
    scale: float
    offset: float
    unit: str


def layout(message: Any) -> Mapping[str, Signal]:
    """Signals of a cantools message by name. Raises ValueError for a big-endian one."""
    found = {}
    for s in message.signals:
        if s.byte_order != "little_endian":
            raise ValueError(expected("a little-endian signal", "a big-endian one", f"{message.name}.{s.name}"))
        found[s.name] = Signal(
            start_bit=s.start,
            bits=s.length,
            signed=bool(s.is_signed),
            scale=float(s.scale),
            offset=float(s.offset),
            unit=s.unit or "",
        )
    return found


def payload(data: Sequence[bytes | bytearray], size: int) -> npt.NDArray[np.uint8]:
    """Frames as bits, shape (n, 8 * size), bit 0 of byte 0 first. Every frame must have `size` bytes."""
    joined = np.frombuffer(b"".join(data), dtype=np.uint8).reshape(len(data), size)
    return np.unpackbits(joined, axis=1, bitorder="little")


def raw(bits: npt.NDArray[np.uint8], s: Signal) -> Ints:
    """Raw integers of one signal, shape (n,)."""
    part = bits[:, s.start_bit : s.start_bit + s.bits].astype(np.int64)
    weights = np.int64(1) << np.arange(s.bits, dtype=np.int64)
    value: Ints = part @ weights
    return np.where(value >= 1 << (s.bits - 1), value - (1 << s.bits), value) if s.signed else value


def physical(bits: npt.NDArray[np.uint8], s: Signal) -> Floats:
    """Physical values of one signal in its own unit, shape (n,)."""
    return raw(bits, s).astype(np.float64) * s.scale + s.offset


def unwrap(counter: Ints, bits: int, start: int = 0) -> Ints:
    """A wrapping counter made monotonic; the first value is the one congruent to it at or after `start`."""
    if not counter.size:
        return counter
    modulus = 1 << bits
    first = start + (int(counter[0]) - start) % modulus
    steps = np.diff(counter) % modulus
    return first + np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(steps)])

"""The line port: sampled bytes of INT, DATA and CLK to frames, as a bit-bang adapter or the emulator's pty gives them.

A byte is one sample of the three lines, bit 0 INT, bit 1 DATA, bit 2 CLK; bit 7 says that samples were lost just before
it. A frame lasts while INT is low; its bits are the levels of DATA where CLK has risen, least significant bit of the
word with the lowest address first, words 4 CLK periods apart (docs/lineport.md). Time is the count of samples: sample k
of an unbroken stream stops at t0_s + k / sample_hz.

Needs numpy only. Whatever the bytes are, nothing is raised and memory stays bounded: what is no frame is counted.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np
from numpy.typing import NDArray

from psabench.errors import expected

INT, DATA, CLK, GAP = 0x01, 0x02, 0x04, 0x80
SAMPLE_HZ = 8_000_000.0
WORDS = 4
PAUSE_CLK = 4  # CLK periods between words (article, protocol of exchange)
BLOCK = 1 << 20  # samples decoded at once: bounds the memory a call needs

IDLE_8 = np.uint64(INT * 0x0101_0101_0101_0101)  # eight samples of the line at rest
ROW = 32  # samples that are skipped together: four eights, the bytes of a uint32 of flags

T = TypeVar("T", bound=np.generic)
Ints = NDArray[np.int64]
Samples = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class LineFormat:
    """What the decoder must know of the board and of the adapter.

    word_bits: 16, 24 or 32. sample_hz: of the adapter. period_s: nominal spacing of frames, None if it is not known
    (then nothing counts as lost, late or early). tolerance_s: how far from that spacing a frame still is in time.
    """

    word_bits: int = 32
    sample_hz: float = SAMPLE_HZ
    period_s: float | None = 1e-3
    tolerance_s: float = 20e-6

    def __post_init__(self) -> None:
        if self.word_bits not in (16, 24, 32):
            raise ValueError(expected("16, 24 or 32", self.word_bits, "word_bits"))
        if not self.sample_hz > 0:
            raise ValueError(expected("a positive rate", self.sample_hz, "sample_hz"))
        if self.period_s is not None and not 0 <= self.tolerance_s < self.period_s / 2:
            raise ValueError(expected(f"less than period_s / 2 = {self.period_s / 2}", self.tolerance_s, "tolerance_s"))

    @property
    def bits(self) -> int:
        return WORDS * self.word_bits

    def timing(self, spacing: Ints) -> tuple[Ints, NDArray[np.float64]]:
        """Of spacings (n,) of INT falls, in samples: periods that each is, s by which it is off; 0 within the limit."""
        if self.period_s is None:
            return np.ones(len(spacing), np.int64), np.zeros(len(spacing))
        spacing_s = spacing / self.sample_hz
        steps = np.maximum(np.rint(spacing_s / self.period_s), 1)
        off_s = spacing_s - steps * self.period_s
        slack_s = self.tolerance_s + 1 / self.sample_hz
        return steps.astype(np.int64), np.where(np.abs(off_s) > slack_s, off_s, 0.0)


@dataclass(slots=True)
class Counts:
    """What came through, and what did not, since the decoder was made.

    lost: frames missing by the time between two INT falls; torn: INT low without exactly the bits and pauses of a
    frame, or with lost samples in it; late, early: frames further than tolerance_s from where the one before lets
    expect them; gaps: places where the adapter lost samples (no time is known across them, so nothing counts as lost,
    late or early there).
    """

    samples: int = 0
    frames: int = 0
    torn: int = 0
    lost: int = 0
    late: int = 0
    early: int = 0
    gaps: int = 0

    def __str__(self) -> str:
        return " ".join(f"{f.name}={getattr(self, f.name)}" for f in fields(self))


@dataclass(frozen=True, slots=True)
class Frames:
    """n frames in order: first (n) and last (n) sample with INT low .. high again, words (n, 4) as sent, unsigned."""

    fall: Ints
    rise: Ints
    words: NDArray[np.uint32]

    def __len__(self) -> int:
        return len(self.fall)

    def signed(self, word_bits: int) -> NDArray[np.int32]:
        """Words (n, 4) as two's complement of word_bits."""
        shift = np.int32(32 - word_bits)
        return (self.words << shift.astype(np.uint32)).view(np.int32) >> shift


def concat(parts: Iterable[Frames]) -> Frames:
    """One `Frames` of many."""
    p = [_empty(), *parts]
    return Frames(
        np.concatenate([f.fall for f in p]), np.concatenate([f.rise for f in p]), np.concatenate([f.words for f in p])
    )


def _empty() -> Frames:
    return Frames(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, WORDS), np.uint32))


class LineDecoder:
    """Bytes in any pieces to frames; the pieces make no difference to the result."""

    def __init__(self, fmt: LineFormat | None = None) -> None:
        self.fmt = fmt or LineFormat()
        self.counts = Counts()
        self._last = 0  # sample before the block; INT low: a frame under way at the start is not taken for one
        self._fall = -1  # INT fall of the frame under way, -1: none
        self._clk: Ints = np.empty(0, np.int64)  # its bits so far: sample,
        self._bit: NDArray[np.bool_] = np.empty(0, np.bool_)  # and level
        self._gap_at = -1  # last gap
        self._prev_fall = -1  # INT fall of the frame before, -1: none

    def feed(self, data: bytes | bytearray | memoryview) -> Frames:
        """Frames completed by these samples."""
        x = np.frombuffer(data, np.uint8)
        return concat([self._block(x[i : i + BLOCK]) for i in range(0, len(x), BLOCK)])

    def feed_edges(self, fall: Ints, rise: Ints, clk: Ints, bit: NDArray[np.bool_]) -> Frames:
        """As `feed` where edges are known, as in a recording: INT falls and rises, CLK rises with DATA, in samples."""
        return self._frames(fall, rise, clk, bit, np.empty(0, np.int64))

    def _block(self, x: Samples) -> Frames:
        base = self.counts.samples
        self.counts.samples += len(x)
        y, left_out = _busy(x, self._last)
        left_out += base
        before = np.concatenate(([np.uint8(self._last)], y[:-1]))
        self._last = int(x[-1])

        def sample(k: Ints) -> Ints:
            at: Ints = k + left_out[k // ROW]
            return at

        int_level = y & INT
        turned = np.flatnonzero(int_level != before & INT)
        low = int_level[turned] == 0
        up = np.flatnonzero(y & CLK > before & CLK)
        gaps = sample(np.flatnonzero(y >= GAP) if y.max(initial=0) >= GAP else np.empty(0, np.int64))
        self.counts.gaps += len(gaps)
        turned_at = sample(turned)
        return self._frames(turned_at[low], turned_at[~low], sample(up), y[up] & DATA != 0, gaps)

    def _frames(self, fall: Ints, rise: Ints, clk: Ints, bit: NDArray[np.bool_], gaps: Ints) -> Frames:
        """Pairs INT falls with rises, over what is left of the block before, and keeps what is unfinished."""
        gaps = np.concatenate(([self._gap_at], gaps)) if self._gap_at >= 0 else gaps
        self._gap_at = int(gaps[-1]) if len(gaps) else -1
        self._timing(fall, gaps)
        clk = np.concatenate((self._clk, clk)) if len(self._clk) else clk
        level = np.concatenate((self._bit, bit)) if len(self._bit) else bit
        if self._fall >= 0:
            fall = np.concatenate(([self._fall], fall))
        if len(rise) and (not len(fall) or rise[0] < fall[0]):
            rise = rise[1:]  # INT was low when the recording began
        whole = len(rise)
        self._keep(fall[whole:], clk, level)
        return self._decode(fall[:whole], rise, clk, level, gaps)

    def _keep(self, fall: Ints, clk: Ints, level: NDArray[np.bool_]) -> None:
        """The frame under way. One bit too many proves it torn, so no more than that is kept."""
        self._fall = int(fall[0]) if len(fall) else -1
        first = int(np.searchsorted(clk, self._fall)) if len(fall) else len(clk)
        self._clk = clk[first : first + self.fmt.bits + 1]
        self._bit = level[first : first + self.fmt.bits + 1]

    def _decode(self, fall: Ints, rise: Ints, clk: Ints, level: NDArray[np.bool_], gaps: Ints) -> Frames:
        """Words of those INT-low intervals that hold exactly a frame; the others are torn."""
        bits = self.fmt.bits
        first = np.searchsorted(clk, fall)
        good = np.searchsorted(clk, rise) - first == bits
        good &= np.searchsorted(gaps, fall) == np.searchsorted(gaps, rise, "right")
        steady = self._steady(_rows(clk, first[good], bits))
        sent_bits = _rows(level, first[good], bits)[steady]
        good[good] = steady
        sent = np.packbits(sent_bits, axis=1, bitorder="little").reshape(-1, WORDS, self.fmt.word_bits // 8)
        words = np.zeros((len(sent), WORDS, 4), np.uint8)
        words[:, :, : sent.shape[2]] = sent
        self.counts.frames += len(words)
        self.counts.torn += len(fall) - len(words)
        return Frames(fall[good], rise[good], words.view("<u4")[:, :, 0].astype(np.uint32))

    def _steady(self, at: Ints) -> NDArray[np.bool_]:
        """Whether the CLK rises (n, bits) stand as in a frame: every period within half a period (or one sample) of the
        mean, every pause PAUSE_CLK longer. The mean is the frame's own, so that nothing depends on either clock's rate.
        """
        mean = (at[:, -1] - at[:, 0]) / (self.fmt.bits - 1 + (WORDS - 1) * PAUSE_CLK)
        limit = np.maximum(mean / 2, 1.0)
        period = np.diff(at, axis=1)
        first_pause = self.fmt.word_bits - 1
        pause = period[:, first_pause :: self.fmt.word_bits].copy()
        period[:, first_pause :: self.fmt.word_bits] = period[:, :1]
        return _all_near(period, mean, limit) & _all_near(pause, mean * (1 + PAUSE_CLK), limit)

    def _timing(self, fall: Ints, gaps: Ints) -> None:
        """Counts what is missing or out of time between INT falls, torn frames included: they were sent."""
        if not len(fall):
            return
        if self._prev_fall >= 0:
            fall = np.concatenate(([self._prev_fall], fall))
        self._prev_fall = int(fall[-1])
        if self.fmt.period_s is None or len(fall) < 2:
            return
        known = np.searchsorted(gaps, fall[:-1], "right") == np.searchsorted(gaps, fall[1:], "right")
        steps, off_s = self.fmt.timing(np.diff(fall)[known])
        self.counts.lost += int((steps - 1).sum())
        self.counts.late += int((off_s > 0).sum())
        self.counts.early += int((off_s < 0).sum())


def _busy(x: Samples, before: int) -> tuple[Samples, Ints]:
    """The samples in which anything may happen, row by row, and how many are left out before each of these rows.

    9 samples of 10 are the line at rest. A row at rest that follows one that is not, or `before`, is kept too: so the
    sample before any kept one has the level of the kept one before it, and neighbours tell every change.
    """
    whole = len(x) - len(x) % ROW
    busy = (x[:whole].view(np.uint64) != IDLE_8).view(np.uint32) != 0
    keep = busy.copy()
    keep[1:] |= busy[:-1]
    keep[:1] |= before != INT
    rows = np.flatnonzero(keep)
    y = np.concatenate((x[:whole].reshape(-1, ROW)[rows].reshape(-1), x[whole:]))
    rows = np.append(rows, whole // ROW)
    return y, ROW * (rows - np.arange(len(rows)))


def _rows(values: NDArray[T], first: Ints, n: int) -> NDArray[T]:
    """n values from each of these places on; a view, not a copy, if one row begins where the one before ends."""
    if len(first) and (np.diff(first) == n).all():
        whole: NDArray[T] = values[first[0] : first[-1] + n].reshape(-1, n)
        return whole
    rows: NDArray[T] = values[first[:, None] + np.arange(n)]
    return rows


def _all_near(values: Ints, want: NDArray[np.float64], limit: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether all values (n, m) of a row are within limit (n) of want (n)."""
    near: NDArray[np.bool_] = (np.abs(values.min(axis=1) - want) <= limit) & (
        np.abs(values.max(axis=1) - want) <= limit
    )
    return near


def open_line(path: Path) -> BinaryIO:
    """The line port at a path (pty or file), unbuffered. Raises OSError."""
    return os.fdopen(os.open(path, os.O_RDONLY | os.O_NOCTTY), "rb", buffering=0)


def decode_stream(stream: BinaryIO, decoder: LineDecoder) -> Iterator[Frames]:
    """Frames of a line port or file opened unbuffered, as they come, to its end: of the file, or of the emulator."""
    while data := _read(stream):
        yield decoder.feed(data)


def _read(stream: BinaryIO) -> bytes:
    try:
        return stream.read(BLOCK)
    except OSError as e:
        if e.errno == errno.EIO:  # a pty whose other end has gone
            return b""
        raise

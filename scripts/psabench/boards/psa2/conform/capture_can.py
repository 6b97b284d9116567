"""Samples of a PSA-2 in a log of its CAN bus: PSA2_XY with the PSA2_ZT that follows it, as arrays of integers."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from psabench.conform.capture.intervals import fact, first_of
from psabench.conform.capture.log import Bools, CanFrame, CanLog, Capture
from psabench.conform.verdict import Failed, conclusive, damaged_data_are
from psabench.link import signals
from psabench.link.signals import Ints

STAMP_BITS, SEQ_BITS = 16, 16
CODE_MAX, CODE_MIN = (1 << 23) - 1, -(1 << 23)


@dataclass(frozen=True, kw_only=True)
class Pairs:
    """n samples in the order in which they came."""

    seq: Ints  # (n,) as sent
    code: Ints  # (n, 3)
    temp: Ints  # (n,)
    channel: Ints
    settled: Bools
    clip: Bools
    overrun: Bools
    new: Bools
    stamp: Ints  # (n,) units of TSTAMP, unwrapped
    frames: tuple[CanFrame, ...]  # PSA2_XY of each

    def __len__(self) -> int:
        return len(self.seq)

    @property
    def steps(self) -> Ints:
        """(n-1,) by how much SEQ rises."""
        return np.diff(self.seq) % (1 << SEQ_BITS)

    def where(self, keep: Bools) -> Pairs:
        """Those with keep (n,)."""
        columns = {f.name: getattr(self, f.name)[keep] for f in fields(self) if f.name != "frames"}
        return Pairs(**columns, frames=tuple(f for f, k in zip(self.frames, keep, strict=True) if k))

    def unbroken(self) -> None:
        """Raises Failed for the first gap of SEQ."""
        if (k := first_of(self.steps != 1)) is not None:
            raise Failed(f"SEQ {self.seq[k]}, then {self.seq[k + 1]}", "one more", frames=self.about(k))

    def about(self, k: int) -> tuple[CanFrame, ...]:
        """Frames around sample k, for a report."""
        return self.frames[max(0, k - 2) : k + 3]


def segment(e: Capture, begin: str, end: str | None = None) -> Capture:
    """The same with the part of the CAN log between two cuts of the stimulus (facts["cut"])."""
    lacking = f"the scene has no cut {begin} or {end}"
    cuts = fact(e, "cut", lacking)
    conclusive(begin in cuts and (end is None or end in cuts), lacking)
    frames = e.can.frames[cuts[begin] : None if end is None else cuts[end]]
    return e.with_can(CanLog(frames=frames))


def pairs(e: Capture, least: int = 20) -> Pairs:
    """Raises Inconclusive for fewer than `least`, Failed for one of another length."""
    first, second = _halves(e)
    conclusive(len(first) >= least, f"{len(first)} samples came as PSA2_XY and PSA2_ZT; expected {least}")
    with damaged_data_are(Failed, "messages of their length", frames=first[:4]):
        xy, zt = CanLog(frames=tuple(first)).raw("PSA2_XY"), CanLog(frames=tuple(second)).raw("PSA2_ZT")
    return Pairs(
        seq=xy["SEQ"],
        code=np.stack((xy["X"], xy["Y"], zt["Z"]), axis=1),
        temp=zt["T"],
        channel=zt["CHANNEL"],
        settled=zt["SETTLED"].astype(bool),
        clip=zt["CLIP"].astype(bool),
        overrun=zt["OVERRUN"].astype(bool),
        new=zt["T_NEW"].astype(bool),
        stamp=signals.unwrap(zt["TSTAMP"], STAMP_BITS),
        frames=tuple(first),
    )


def _halves(e: Capture) -> tuple[list[CanFrame], list[CanFrame]]:
    """Both halves of each sample; halves without the other are left out (PSA2-CAN-06 checks them)."""
    ids = [f.frames[0].can_id for f in (e.frames_of("PSA2_XY"), e.frames_of("PSA2_ZT")) if len(f)]
    if len(ids) < 2:
        return [], []
    first, second, half = [], [], None
    for f in e.can.frames:
        if f.error or f.sent or f.can_id not in ids:
            continue
        if f.can_id == ids[0]:
            half = f
        elif half is not None:
            first.append(half)
            second.append(f)
            half = None
    return first, second


def aligned(a: Ints, b: Ints) -> tuple[int, int]:
    """Shift k with which most rows a[i + k] are rows b[i], and how many; a (n, c), b (m, c)."""
    if not len(a) or not len(b):
        return 0, 0
    same = (a[:, None, :] == b[None, :, :]).all(axis=2)
    i, j = np.nonzero(same)
    if not len(i):
        return 0, 0
    count = np.bincount(i - j + len(b))
    k = int(np.argmax(count))
    return k - len(b), int(count[k])


def signed(words: Ints, bits: int) -> Ints:
    """Two's complement of so many bits."""
    half = np.int64(1) << (bits - 1)
    return (words & ((half << 1) - 1) ^ half) - half

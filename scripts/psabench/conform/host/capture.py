"""What was on the bus in a case: read from the emulator's log, by rules of the protocol page alone.

Written apart from `psabench.boards.psa2.frames`, so that what a host is checked by is not what our own host does.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable
from dataclasses import dataclass, field

LINE = re.compile(r"\((\d+\.\d+)\) \S+ ([0-9A-F]+)#([0-9A-F]*)")
STAMP_US, STAMPS = 4, 1 << 16  # TSTAMP of PSA2_ZT
WRAP_US = STAMP_US * STAMPS
PERIOD_US = 1000
SEQS = 1 << 16
SILENT_S = 0.1  # after such a silence numbers may go on from another instant: the converter itself had stopped
OFF_PERIODS = 0.8  # a converter whose data-ready was held gives one word out of step
LIMITS = (0x7FFFFF, -0x800000)
NMT, EMCY, XY, ZT, SDO_TX, SDO_RX, HEARTBEAT = 0x000, 0x080, 0x180, 0x280, 0x580, 0x600, 0x700


@dataclass(frozen=True, slots=True)
class Frame:
    """On the bus. t_s: when it had come, simulated."""

    t_s: float
    can_id: int
    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class SentSample:
    """A sample that both halves came of. due: they came one after the other, once, so that a host must take it."""

    seq: int
    epoch: int  # restarts of the board before it
    codes: tuple[int, int, int, int]
    channel: int
    settled: bool
    overrun: bool
    t_us: int  # instant of its conversion, simulated, to 4 us
    arrived_s: float
    due: bool

    @property
    def limits(self) -> tuple[bool, bool, bool]:
        """Axes whose code is at a limit."""
        x, y, z, _ = self.codes
        return x in LIMITS, y in LIMITS, z in LIMITS


@dataclass(slots=True)
class Bus:
    """Of one case. samples: in the order of their numbers, from the host's first NMT start on."""

    frames: list[Frame]
    node: int
    samples: list[SentSample] = field(default_factory=list)

    def of(self, service: int) -> list[Frame]:
        """Frames of a service of the board's node."""
        return [f for f in self.frames if f.can_id == service + self.node]

    @property
    def boots(self) -> list[float]:
        """Instants of the boot-up messages, s."""
        return [f.t_s for f in self.of(HEARTBEAT) if f.data == b"\0"]

    @property
    def starts(self) -> list[float]:
        """Instants of NMT start for the node, s."""
        mine = (bytes((1, 0)), bytes((1, self.node)))
        return [f.t_s for f in self.frames if f.can_id == NMT and f.data in mine]


def read_log(lines: Iterable[str], node: int) -> Bus:
    """From a log as `candump -L` writes it."""
    found = [LINE.match(line) for line in lines]
    bus = Bus([Frame(float(m[1]), int(m[2], 16), bytes.fromhex(m[3])) for m in found if m], node)
    bus.samples = list(_samples(bus))
    return bus


def signed(data: bytes) -> int:
    return int.from_bytes(data, "little", signed=True)


def number(data: bytes) -> int:
    return int.from_bytes(data, "little")


@dataclass(slots=True)
class _Epoch:
    """Halves that came between two boot-ups."""

    xy: dict[int, Frame] = field(default_factory=dict)  # by SEQ, the first of each
    zt: dict[int, Frame] = field(default_factory=dict)  # by the SEQ that its time tells
    adjacent: set[int] = field(default_factory=set)  # SEQ of those whose halves came one after the other
    late: set[int] = field(default_factory=set)  # SEQ of those that came after a later one


def _samples(bus: Bus) -> Iterable[SentSample]:
    if not bus.starts:
        return
    boots = [t for t in bus.boots if t > bus.starts[0]]
    edges = [bus.starts[0], *boots, float("inf")]
    for epoch, (begin, end) in enumerate(itertools.pairwise(edges)):
        mine = [f for f in bus.frames if begin < f.t_s <= end and f.can_id in (XY + bus.node, ZT + bus.node)]
        yield from _of_epoch(epoch, [f for f in mine if len(f.data) == 8], bus.node)


def _of_epoch(epoch: int, frames: list[Frame], node: int) -> Iterable[SentSample]:
    e = _sorted_halves(frames, node)
    for seq, xy in e.xy.items():
        zt = e.zt.get(seq)
        if zt is None:
            continue
        x, y, z, status = signed(xy.data[0:3]), signed(xy.data[3:6]), signed(zt.data[0:3]), zt.data[5]
        yield SentSample(
            seq=seq % SEQS,
            epoch=epoch,
            codes=(x, y, z, signed(zt.data[3:5])),
            channel=status >> 4,
            settled=bool(status & 1),
            overrun=bool(status & 4),
            t_us=_instant_us(zt),
            arrived_s=zt.t_s,
            due=seq in e.adjacent and seq not in e.late,
        )


def _instant_us(zt: Frame) -> int:
    """Of the sample: the last instant before its arrival with that TSTAMP."""
    arrived_us = round(zt.t_s * 1e6)
    return arrived_us - (arrived_us - STAMP_US * number(zt.data[6:8])) % WRAP_US


def _sorted_halves(frames: list[Frame], node: int) -> _Epoch:
    """A half's number is the one it carries (XY) or the one of its instant (ZT), counted from the last whole pair."""
    e = _Epoch()
    anchor: tuple[int, int] | None = None  # number, unwrapped, and instant of the last pair
    arrived_s = 0.0  # of the last ZT
    xy_seq: int | None = None  # number of the XY that came just before
    for f in frames:
        if f.can_id == XY + node:
            seq = number(f.data[6:8])
            xy_seq = seq if anchor is None else _unwrapped(seq, anchor[0])
            e.xy.setdefault(xy_seq, f)
            continue
        t_us = _instant_us(f)
        silent = anchor is None or f.t_s - arrived_s > SILENT_S
        due = xy_seq if anchor is None or silent else _due(anchor, xy_seq, t_us)
        arrived_s = f.t_s
        if due is not None and due not in e.zt:
            e.zt[due] = f
            if due == xy_seq and anchor is not None and due < anchor[0]:
                e.late.add(due)
            elif due == xy_seq:
                e.adjacent.add(due)
                anchor = (due, t_us)
        xy_seq = None
    return e


def _due(anchor: tuple[int, int], xy_seq: int | None, t_us: int) -> int:
    """Number of a sample of that instant; the one that its XY carries, if that is right to less than a period."""
    periods = (t_us - anchor[1]) / PERIOD_US
    if xy_seq is not None and abs(periods - (xy_seq - anchor[0])) < OFF_PERIODS:
        return xy_seq
    return anchor[0] + round(periods)


def _unwrapped(seq: int, near: int) -> int:
    return near + (seq - near + SEQS // 2) % SEQS - SEQS // 2

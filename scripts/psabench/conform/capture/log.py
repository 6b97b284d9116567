"""What was seen on the wires of a board: CAN frames, levels of its lines, cycles on its bus. All that a check may know.

Capture comes from a stimulus of the device suite or from files (`conform.sources`); a check cannot tell which.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from psabench.conform.profile import Variant
from psabench.errors import expected
from psabench.link import signals
from psabench.link.busport import Cycle
from psabench.link.protocol_files import dbc_node, message
from psabench.link.signals import Floats, Ints
from psabench.link.vcd import Vcd, Wire

if TYPE_CHECKING:
    from psabench.link.can_host import Message

Bools = npt.NDArray[np.bool_]
PPM = 1e-6


class CanFrame(NamedTuple):
    """One frame as an adapter reports it; t_s: the adapter's own time stamp."""

    t_s: float
    can_id: int
    data: bytes
    fd: bool = False
    error: bool = False
    sent: bool = False  # by us, not received
    extended: bool = False  # identifier of 29 bits
    remote: bool = False
    brs: bool | None = None  # data at the second bit rate, of an FD frame; None: no one told

    @classmethod
    def of(cls, m: Message, t_s: float, brs: bool | None = None) -> CanFrame:
        """What python-can received or read."""
        kind = {"fd": bool(m.is_fd), "error": bool(m.is_error_frame), "remote": bool(m.is_remote_frame)}
        return cls(t_s, int(m.arbitration_id), bytes(m.data), extended=bool(m.is_extended_id), brs=brs, **kind)


@dataclass(frozen=True, kw_only=True, eq=False)
class CanLog:
    """Frames in the order in which they passed. Equal to itself alone: a hash over 100,000 frames costs 0.1 s."""

    frames: tuple[CanFrame, ...] = ()

    def __len__(self) -> int:
        return len(self.frames)

    def of_id(self, can_id: int) -> CanLog:
        """The frames of one identifier that were received, error frames left out."""
        return CanLog(frames=tuple(f for f in self.frames if f.can_id == can_id and not f.error and not f.sent))

    def of(self, name: str, board: str, node: int) -> CanLog:
        """The frames of a message of the DBC, as a board at this node sends it."""
        return self.of_id(int(message(name).frame_id) - dbc_node(board) + node)

    @property
    def t_s(self) -> Floats:
        """(n,) time stamps of the adapter."""
        return np.array([f.t_s for f in self.frames], np.float64)

    def raw(self, name: str) -> Mapping[str, Ints]:
        """Signals (n,) of frames that all are this message, as integers. Raises ValueError for another length."""
        length = int(message(name).length)
        for f in self.frames:
            if len(f.data) != length:
                raise ValueError(expected(f"{length} bytes", len(f.data), f"{name} at {f.t_s:.6f} s"))
        bits = signals.payload([f.data for f in self.frames], length)
        return {s: signals.raw(bits, at) for s, at in signals.layout(message(name)).items()}


@dataclass(frozen=True, kw_only=True, eq=False)
class LineLog:
    """Levels of lines; equal to itself alone. An edge at t_ns happened in (t_ns - resolution_ns, t_ns].

    About `gaps_ns` nothing is known.
    """

    recording: Vcd
    resolution_ns: float = 1.0
    gaps_ns: Ints = field(default_factory=lambda: np.empty(0, np.int64))  # (n,) instants at which samples were lost

    def __contains__(self, name: str) -> bool:
        return name in self.recording.wires

    def __getitem__(self, name: str) -> Wire:
        """A line by its name. Raises KeyError, with the lines that there are."""
        if name not in self.recording.wires:
            raise KeyError(expected(", ".join(self.recording.wires), name, "line"))
        return self.recording.wires[name]

    @property
    def start_ns(self) -> int:
        return self.recording.start_ns

    @property
    def end_ns(self) -> int:
        return self.recording.end_ns

    def falls(self, name: str) -> Ints:
        """Instants (n,) at which the line went low."""
        return self[name].edges_ns(0)

    def rises(self, name: str) -> Ints:
        """Instants (n,) at which the line went high."""
        return self[name].edges_ns(1)

    def pulses(self, name: str, level: int) -> tuple[Ints, Ints]:
        """Begin and end (n,) of each whole stay at this level, without those that a gap cuts."""
        begin, end = self[name].edges_ns(level), self[name].edges_ns(1 - level)
        end = end[np.searchsorted(end, begin[0], "right") :] if len(begin) else end[:0]
        n = min(len(begin), len(end))
        begin, end = begin[:n], end[:n]
        whole = self.known(begin, end)
        return begin[whole], end[whole]

    def by_clock(self, rate: float) -> LineLog:
        """As a clock sees them that counts `rate` seconds in one; an edge still happened before its instant."""
        if rate == 1.0:
            return self
        late_ns = self.resolution_ns * max(rate, 1.0) + 1.0
        return self.at_times(lambda t_ns: t_ns + np.ceil(t_ns * (rate - 1.0)).astype(np.int64), late_ns)

    def at_times(self, moved: Callable[[Ints], Ints], resolution_ns: float) -> Self:
        """The same with each instant moved."""
        r = self.recording
        ends = moved(np.array([r.start_ns, r.end_ns], np.int64))
        wires = {name: Wire(moved(w.t_ns), w.level) for name, w in r.wires.items()}
        recording = Vcd(r.unit_ns, int(ends[0]), int(ends[1]), wires)
        return replace(self, recording=recording, resolution_ns=resolution_ns, gaps_ns=moved(self.gaps_ns))

    def known(self, begin_ns: Ints, end_ns: Ints) -> Bools:
        """(n,) whether no samples were lost between these instants, nor just before one: its edge may be older."""
        same: Bools = np.searchsorted(self.gaps_ns, begin_ns) == np.searchsorted(self.gaps_ns, end_ns, "right")
        return same

    def unbroken(self) -> LineLog:
        """The longest stretch in which no samples were lost; all of it where none were."""
        if not len(self.gaps_ns):
            return self
        ends = np.concatenate(([self.start_ns], self.gaps_ns, [self.end_ns + 1]))
        k = int(np.argmax(np.diff(ends)))
        begin, end = int(ends[k]), int(ends[k + 1]) - 1
        recording = self.recording.part(list(self.recording.wires), begin, end)
        return LineLog(recording=recording, resolution_ns=self.resolution_ns)


@dataclass(frozen=True, kw_only=True)
class Capture:
    """All of one stimulus or recording. lines: None where no probe was there."""

    variant: Variant
    node: int
    stimulus: str
    can: CanLog = field(default_factory=CanLog)
    lines: LineLog | None = None
    cycles: tuple[Cycle, ...] = ()
    marks: Mapping[str, float] = field(default_factory=dict)  # instants by name, s in the time of the CAN log: a reset
    facts: Mapping[str, object] = field(default_factory=dict)  # what the stimulus asked for: objects read, rejections
    inputs_v: Mapping[str, float] = field(default_factory=dict)  # volts at the inputs by axis, where they are known
    clock_ppm: float = 100.0  # how far the board's clock and the recording's may lie apart

    @cached_property
    def wires(self) -> LineLog:
        """The lines; for checks that need them. Raises ValueError where no probe was there."""
        if self.lines is None:
            raise ValueError(expected("recorded lines", "none"))
        return self.lines

    def slack_ns(self, interval_ns: float, edges: int = 2) -> float:
        """How far an interval between two edges may seem off: resolution of the edges, clocks that differ."""
        resolution_ns = 0.0 if self.lines is None else self.lines.resolution_ns
        return edges / 2 * resolution_ns + apart(interval_ns, self.clock_ppm)

    def frames_of(self, name: str) -> CanLog:
        """Frames of a message of the DBC that this board sent."""
        return self.can.of(name, self.variant.family, self.node)

    def with_can(self, can: CanLog) -> Capture:
        """The same with another log of the bus."""
        return replace(self, can=can)

    def with_lines(self, lines: LineLog | None) -> Capture:
        """The same with other lines."""
        return replace(self, lines=lines)


def apart(interval: float, clock_ppm: float) -> float:
    """How far an interval may seem off between clocks that differ by as much; the farther of the two: one is slow."""
    return abs(interval) * clock_ppm * PPM / (1.0 - clock_ppm * PPM)


def joined(logs: Sequence[CanLog]) -> CanLog:
    """One log of several, in their order."""
    return CanLog(frames=tuple(f for log in logs for f in log.frames))

"""Readings of a board from CAN as columns in the units of the DBC: any board whose readings are one or more messages.

`ReadingReader` listens to a `CanHost`, keeps the bytes of its node's messages and counts what is wrong with them;
`take` turns what has arrived into one `Readings`. What counts as lost: `boards.stream`. (PSA-2 has forms, pairs and
blocks: `frames`.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from psabench.boards.stream import FrameCounters, NodeState, by_stretch, missing_counts
from psabench.errors import expected
from psabench.link import signals
from psabench.link.can_host import Message
from psabench.link.protocol_files import dbc_node, message
from psabench.link.signals import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingLayout:
    """What one reading of a board is on the bus.

    messages: names in the DBC, in the order in which the board sends them. counter: the column that rises by one with
    each reading and wraps; stamp: its instant; overrun: 1 where the board lost something before it. "": none.
    """

    board: str
    messages: tuple[str, ...]
    counter: str = ""
    stamp: str = ""
    overrun: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Readings:
    """n readings: columns in the units of `units` ("": a code or a count), by the names of their signals.

    A name that an earlier message of the reading has already is preceded by that of its own, "PIK_TOTALS.X".
    """

    t_rx_s: Floats  # (n,) when the (last) CAN message of each arrived, in the time of the transport
    t_sample_s: Floats  # (n,) the board's own time stamp, unwrapped, s; NaN where it sends none
    columns: Mapping[str, Floats]  # (n,) each
    units: Mapping[str, str]

    def __len__(self) -> int:
        return len(self.t_rx_s)

    def __getitem__(self, name: str) -> Floats:
        """A column. Raises KeyError, with the names that there are."""
        if name not in self.columns:
            raise KeyError(expected(", ".join(self.columns), name, "column"))
        return self.columns[name]

    def head(self, count: int) -> Readings:
        """The first `count` of them."""
        return self.part(slice(count))

    def part(self, span: slice) -> Readings:
        """Those from one on and up to another."""
        return Readings(
            t_rx_s=self.t_rx_s[span],
            t_sample_s=self.t_sample_s[span],
            columns={k: v[span] for k, v in self.columns.items()},
            units=self.units,
        )


def _columns(messages: tuple[str, ...]) -> list[dict[str, signals.Signal]]:
    """The signals of each message under the names of their columns."""
    taken: set[str] = set()
    out = []
    for name in messages:
        at = signals.layout(message(name))
        out.append({s if s not in taken else f"{name}.{s}": place for s, place in at.items()})
        taken |= set(at)
    return out


def join_readings(parts: Sequence[Readings]) -> Readings:
    """One `Readings` of one or more with the same columns."""
    if len(parts) == 1:
        return parts[0]
    return Readings(
        t_rx_s=np.concatenate([p.t_rx_s for p in parts]),
        t_sample_s=np.concatenate([p.t_sample_s for p in parts]),
        columns={name: np.concatenate([p.columns[name] for p in parts]) for name in parts[0].columns},
        units=parts[0].units,
    )


class ReadingReader:
    """Collects the readings of one node: `host.listeners.append(reader.on_message, reader.ids)`.

    A gap in the counter is a loss within a stretch of the stream only: `boards.stream` says where one begins.
    """

    def __init__(self, layout: ReadingLayout, node_id: int) -> None:
        self.layout = layout
        self.counters = FrameCounters()
        self._state = NodeState(node_id)
        shift = node_id - dbc_node(layout.board)
        self._place = {int(message(name).frame_id) + shift: k for k, name in enumerate(layout.messages)}
        self.ids = frozenset([*self._place, *self._state.ids])
        self._at = _columns(layout.messages)
        self._lengths = [int(message(name).length) for name in layout.messages]
        self._begun: list[bytes] = []  # messages of the reading under way
        self._seen = False
        self._kept: list[list[bytes]] = []
        self._t_s: list[float] = []
        self._marks: list[int] = []  # places in them where a stretch begins
        self._count: int | None = None  # of the stretch's last reading
        self._stamp = 0
        self._stretch_is_new = True

    def on_message(self, m: Message) -> None:
        """Take one CAN frame; those of other nodes and services are let by."""
        k = self._place.get(m.arbitration_id)
        if m.is_error_frame or m.is_remote_frame:
            return
        if k is not None:
            self._on_part(k, m)
        elif m.arbitration_id in self._state.ids and self._state.begins(m):
            self._begun = []  # a stop may come in the middle of a reading: that is no fault
            self._marks.append(len(self._kept))

    def _on_part(self, k: int, m: Message) -> None:
        """The message of a reading that is at this place in it."""
        whole = len(m.data) == self._lengths[k]
        if k != len(self._begun) or not whole:
            # a reading that was under way when we came is no fault
            self.counters.torn += bool(self._begun) or not whole or (self._seen and k > 0)
            self._begun = []
        if whole and k == len(self._begun):
            self._begun.append(bytes(m.data))
        self._seen = True
        if len(self._begun) == len(self.layout.messages):
            self._kept.append(self._begun)
            self._t_s.append(m.timestamp)
            self._begun = []

    def __len__(self) -> int:
        """Readings that `take` would return."""
        return len(self._kept)

    def least(self, count: int) -> int:
        """CAN frames that must come yet before `len` can be count."""
        return (count - len(self)) * len(self.layout.messages) - len(self._begun)

    def forget(self) -> None:
        """Drop what has arrived and is not taken; the next reading begins a stretch."""
        self._begun, self._kept, self._t_s, self._marks, self._seen = [], [], [], [], False
        self._begin()

    def _begin(self) -> None:
        self._count, self._stretch_is_new = None, True

    def take(self) -> Readings:
        """Everything since the last call, decoded."""
        kept, t_s, marks = self._kept, self._t_s, self._marks
        self._kept, self._t_s, self._marks = [], [], []
        parts = []
        for begins, span in by_stretch(len(kept), marks):
            if begins:
                self._begin()
            parts.append(self._decode(kept[span], t_s[span]))
        self.counters.frames += len(kept)
        return join_readings(parts)

    def _decode(self, kept: list[list[bytes]], t_s: list[float]) -> Readings:
        """Of one stretch."""
        columns: dict[str, Floats] = {}
        units: dict[str, str] = {}
        t_sample_s = np.full(len(kept), np.nan)
        for k, name in enumerate(self.layout.messages):
            bits = signals.payload([r[k] for r in kept], int(message(name).length))
            for column, at in self._at[k].items():
                columns[column] = signals.physical(bits, at)
                units[column] = at.unit
                if kept and column == self.layout.counter:
                    self._count_gaps(signals.raw(bits, at), at.bits)
                if kept and column == self.layout.stamp:
                    unwrapped = signals.unwrap(signals.raw(bits, at), at.bits, self._stamp)
                    self._stamp = int(unwrapped[-1])
                    t_sample_s = unwrapped.astype(np.float64) * at.scale
        if kept:
            self.counters.stretches += self._stretch_is_new
            self._stretch_is_new = False
        if self.layout.overrun in columns:
            self.counters.overruns += int(columns[self.layout.overrun].sum())
        return Readings(t_rx_s=np.array(t_s), t_sample_s=t_sample_s, columns=columns, units=units)

    def _count_gaps(self, counter: signals.Ints, bits: int) -> None:
        self.counters.lost += missing_counts(counter, bits, self._count)
        self._count = int(counter[-1])

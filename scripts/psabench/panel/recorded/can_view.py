"""A recording of the bus as the panel shows it: channels, units and CAN of its frames; the page moves its time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from psabench.boards.decode import senders_of
from psabench.boards.devices import of_board, reader_of
from psabench.boards.psa2.frames import FrameReader
from psabench.boards.readings import ReadingReader
from psabench.boards.registry import BOARDS
from psabench.errors import BadInput, expected
from psabench.link.can_host import Message
from psabench.link.listeners import Listeners
from psabench.link.protocol_files import dbc_node
from psabench.panel.can_trace import CanTrace
from psabench.panel.channels import Channels, overview_row, samples_of, unit_message
from psabench.panel.recorded.base import PlayedView
from psabench.panel.recorded.playback import Player, Scan, scan_log
from psabench.panel.view import TURN_S

UNITS = 128  # that are shown


@dataclass(frozen=True, slots=True)
class Recorded:
    """One unit of a recording."""

    board: str
    node: int
    reader: FrameReader | ReadingReader

    @property
    def title(self) -> str:
        return of_board(self.board).title


def units_of(found: Scan, board: str, node: int | None) -> dict[tuple[str, str], Recorded]:
    """By bus and name: each board at its node of the DBC, `board` at the others; with a node, `board` there alone."""
    units: dict[tuple[str, str], Recorded] = {}
    for bus, ids in found.ids.items():
        usual = {dbc_node(b): b for b in BOARDS if dbc_node(b) in senders_of(ids, b)}
        at = dict.fromkeys(sorted(senders_of(ids, board)), board) | usual if node is None else {node: board}
        for n in sorted(at)[: UNITS - len(units)]:
            name = f"node{n}" if len(found.ids) == 1 else f"{bus}.node{n}"
            units[bus, name] = Recorded(at[n], n, reader_of(at[n], n))
    return units


class CanView(PlayedView):
    """See `view.View`. Raises BadInput for a file that cannot be read. look: see `scan_log`."""

    def __init__(
        self, path: Path, files: Mapping[str, Path], board: str, node: int | None, look: Callable[[float], None]
    ) -> None:
        super().__init__(path, files)
        self.scan = scan_log(path, look)
        self._given = board, node
        if node is not None and not any(node in senders_of(ids, board) for ids in self.scan.ids.values()):
            raise BadInput(expected(f"samples of a {board} at node {node}", "none", path))
        self._player = Player(path, self.scan.begin_s, self._on_message)
        self._begin()

    def _begin(self) -> None:
        """At time 0, where nothing has come yet."""
        self._player.rewind()
        units = units_of(self.scan, *self._given)
        self._units = {name: unit for (_, name), unit in units.items()}
        self.titles = {name: (unit.title, unit.node) for name, unit in self._units.items()}
        self.channels = {name: Channels() for name in self._units}
        boards = {bus: {u.node: u.board for (b, _), u in units.items() if b == bus} for bus in self.scan.ids}
        self.traces = {bus: CanTrace(bus, boards[bus]) for bus in self.scan.ids}
        self._listeners = {bus: Listeners() for bus in self.scan.ids}
        for bus, trace in self.traces.items():
            self._listeners[bus].append(trace.on_message)
        for (bus, _), unit in units.items():
            self._listeners[bus].append(unit.reader.on_message, unit.reader.ids)
        self.unit = self.unit if self.unit in self._units else next(iter(self._units), "")
        self._viewed_s = 0.0

    def _on_message(self, bus: str, m: Message) -> None:
        if bus in self._listeners:
            self._listeners[bus].hand_on(m)

    # ---- time

    def look_between(self, look: Callable[[], None]) -> None:
        self._player.between = look

    def wait(self, for_s: float) -> None:
        """As far as it comes meanwhile: at a high speed it plays as fast as it is read."""
        self._player.run_to(self._player.now_s + for_s, TURN_S)

    def now_s(self) -> float:
        return self._player.now_s

    def go_to(self, t_s: float) -> None:
        """Backwards, too: the file is read again."""
        if t_s < self._player.now_s:
            self._begin()
        self._player.run_to(t_s)

    def ended(self) -> str:
        return self._player.ended

    def about(self) -> Mapping[str, Any]:
        length = {"kind": "can", "length_s": self.scan.length_s, "whole": self.scan.whole}
        return length | {"damage": self.scan.damage, "buses": list(self.scan.ids)}

    # ---- what goes by itself

    def take(self, every_unit: bool) -> dict[str, Any]:
        """New buckets of the chosen unit; of the others, too, when every_unit."""
        found: dict[str, Any] = {}
        for name, unit in self._units.items():
            if name != self.unit and not every_unit:
                continue
            buckets = self.channels[name].add(samples_of(unit.reader.take()))
            if name == self.unit and buckets:
                found = unit_message(name, self.channels[name], buckets)
        return found

    def state(self, *, lines: bool) -> dict[str, Any]:
        """The overview."""
        rows = [
            overview_row(n, u.title, self.channels[n], u.reader.counters) | {"lines": [0, 0]}
            for n, u in self._units.items()
        ]
        return self.played(rows)

    def can(self, now_s: float) -> dict[str, Any]:
        """The CAN card."""
        span_s, self._viewed_s = now_s - self._viewed_s, now_s
        return {"kind": "can", "buses": [t.view(span_s) for t in self.traces.values()]}

"""A recording as the panel shows it: channels, statistics, units and CAN of its frames; the page moves its time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from psabench.boards.decode import senders_of
from psabench.boards.devices import of_board, reader_of
from psabench.boards.psa2.frames import FrameReader
from psabench.boards.readings import ReadingReader
from psabench.boards.registry import BOARDS
from psabench.errors import BadInput, BenchError, expected
from psabench.link.can_host import Message
from psabench.link.protocol_files import dbc_node
from psabench.panel.can_trace import CanTrace
from psabench.panel.channels import Channels, channel_figures, overview_row, samples_of, unit_message
from psabench.panel.describe import describe_command
from psabench.panel.playback import Player, Scan, recording_files, scan_log
from psabench.panel.view import TURN_S
from psabench.shell.builtins import ROWS
from psabench.shell.commands import Vocabulary
from psabench.shell.grammar import Call, parse
from psabench.shell.lexer import Wrong

LINES = ("wait", "at", "time", "dut.use")  # of the shell that a recording understands
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


class RecordingView:
    """See `view.View`. Raises BadInput for a file that cannot be read."""

    pace = "step"

    def __init__(self, path: Path, files: Mapping[str, Path], board: str, node: int | None) -> None:
        self._path, self._files = path, files
        self.scan = scan_log(path)
        self._given = board, node
        if node is not None and not any(node in senders_of(ids, board) for ids in self.scan.ids.values()):
            raise BadInput(expected(f"samples of a {board} at node {node}", "none", path))
        self._player = Player(path, self.scan.begin_s, self._on_message)
        rows = {row.command.name: row.command for row in ROWS if row.command.name in LINES}
        self._vocabulary = Vocabulary(rows, {})
        self.unit = ""
        self._begin()

    def _begin(self) -> None:
        """At time 0, where nothing has come yet."""
        self._player.rewind()
        units = units_of(self.scan, *self._given)
        self._units = {name: unit for (_, name), unit in units.items()}
        self.channels = {name: Channels() for name in self._units}
        self._readers = {bus: [u.reader for (b, _), u in units.items() if b == bus] for bus in self.scan.ids}
        boards = {bus: {u.node: u.board for (b, _), u in units.items() if b == bus} for bus in self.scan.ids}
        self.traces = {bus: CanTrace(bus, boards[bus]) for bus in self.scan.ids}
        self.unit = self.unit if self.unit in self._units else next(iter(self._units), "")
        self._viewed_s = 0.0

    def _on_message(self, bus: str, m: Message) -> None:
        if bus not in self.traces:
            return
        self.traces[bus].on_message(m)
        for reader in self._readers[bus]:
            reader.on_message(m)

    # ---- time

    def look_between(self, look: Callable[[], None]) -> None:
        self._player.between = look

    def wait(self, for_s: float) -> None:
        """As far as it comes meanwhile: at a high speed it plays as fast as it is read."""
        self._player.run_to(self._player.now_s + for_s, TURN_S)

    def receive(self, for_s: float) -> None:
        raise AssertionError("a recording moves in steps")

    def now_s(self) -> float:
        return self._player.now_s

    def close(self) -> None:
        """Its file is closed with its reader."""

    # ---- what a page asks for

    def line(self, text: str) -> dict[str, Any]:
        """One of LINES. Raises Wrong."""
        call, before_s = parse(text, self._vocabulary), self._player.now_s
        if call is None:
            return {"text": "", "result": {}}
        result = self._result(call)
        shown = ", ".join(f"{k} {v}" for k, v in result.items())
        rewound = self._player.now_s < before_s  # the page draws its curves again
        return {"line": call.line, "text": shown, "result": result, "failed": "", "rewound": rewound}

    def _result(self, call: Call) -> dict[str, Any]:
        if call.command.name == "wait":
            self._player.run_to(self._player.now_s + float(str(call.args["for_s"])))
        elif call.command.name == "at":
            self._go_to(float(str(call.args["t_s"])))
        elif call.command.name == "dut.use":
            self._use(str(call.args.get("unit", self.unit)))
            return {"unit": self.unit}
        return {"t_s": self._player.now_s} | ({"frames": self._player.ended} if self._player.ended else {})

    def _go_to(self, t_s: float) -> None:
        """Backwards, too: the file is read again."""
        if t_s < self._player.now_s:
            self._begin()
        self._player.run_to(t_s)

    def _use(self, name: str) -> None:
        if name not in self._units:
            raise Wrong(expected(", ".join(self._units) or "no unit", repr(name[:40]), "unit"))
        self.unit = name

    def frame(self) -> Mapping[str, Any]:
        raise BenchError(expected("a bench with lines", "a recording of CAN", "frame"))

    def truth(self) -> dict[str, Any]:
        raise BenchError(expected("an emulator", "a recording", "truth"))

    def channel_statistics(self, channel: str) -> dict[str, Any]:
        """Of a channel of the chosen unit. Raises BenchError."""
        return channel_figures(self.channels.get(self.unit, Channels()), channel)

    def snapshots(self) -> list[str]:
        return []

    def describe(self) -> dict[str, Any]:
        """The whole state of the page; what only a bench has is empty."""
        commands = {name: describe_command(c) for name, c in self._vocabulary.commands.items()}
        history = self.channels[self.unit].history if self.unit else ()
        units = [{"name": n, "board": u.title, "node": u.node} for n, u in self._units.items()]
        shown = unit_message(self.unit, self.channels[self.unit], list(history)) if self.unit else {}
        empty: dict[str, Any] = {
            "registers": {},
            "absent": {},
            "snapshots": [],
            "tables": [],
            "tears": [],
            "choices": {},
        }
        return {
            "kind": "hello",
            "pace": self.pace,
            "units": units,
            "unit": self.unit,
            "truth": False,
            "commands": commands,
            "history": shown,
            "recording": self._about(),
            **empty,
        }

    def _about(self) -> dict[str, Any]:
        """For the card."""
        about = {"file": self._path.name, "files": list(self._files), "length_s": self.scan.length_s}
        return about | {"whole": self.scan.whole, "damage": self.scan.damage, "buses": list(self.scan.ids)}

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
        """The overview; a recording of CAN has no instruments, faults and lines."""
        rows = [
            overview_row(n, u.title, self.channels[n], u.reader.counters) | {"lines": [0, 0]}
            for n, u in self._units.items()
        ]
        nothing: dict[str, Any] = {"instruments": {}, "faults": [], "lines": {}, "bus": {}, "counters": {}, "files": []}
        return {"kind": "state", "late": None, "overview": rows, "ended": self._player.ended, **nothing}

    def can(self, now_s: float) -> dict[str, Any]:
        """The CAN card."""
        span_s, self._viewed_s = now_s - self._viewed_s, now_s
        return {"kind": "can", "buses": [t.view(span_s) for t in self.traces.values()]}


@dataclass(frozen=True, slots=True)
class RecordingSource:
    """path: a file or a folder; chosen: the file of it that is shown."""

    path: Path
    board: str = "psa2"
    node: int | None = None
    chosen: str = ""

    is_own = False

    def open(self) -> RecordingView:
        """Raises BadInput."""
        files = {p.name: p for p in recording_files(self.path)}
        name = self.chosen or next(iter(files))
        if name not in files:
            raise BadInput(expected(", ".join(files), repr(name[:40]), "recording"))
        return RecordingView(files[name], files, self.board, self.node)

    def choose(self, name: str) -> RecordingSource:
        return replace(self, chosen=name)

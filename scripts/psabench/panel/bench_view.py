"""An open bench as the panel needs it: lines carried out, time moved, channels and frames kept, state read."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from psabench.bench import NS, Bench
from psabench.boards.psa2.device import Psa2
from psabench.errors import BenchError, ControlError, expected
from psabench.link.signals import Ints
from psabench.link.vcd import read_vcd
from psabench.panel.can_trace import CanTrace
from psabench.panel.channels import Channels, channel_figures, overview_row, samples_of, unit_message
from psabench.panel.describe import NOT_HERE, describe_bench
from psabench.panel.frame_view import drawn_frame, tears_of
from psabench.panel.view import TURN_S
from psabench.shell.builtins import SLICE_NS
from psabench.shell.grammar import Call, parse
from psabench.shell.lexer import Wrong
from psabench.shell.session import Session
from psabench.shell.transcript import Transcript

FILE_ARGS = ("path", "file")
PLAIN_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]{0,99}")  # no folder, not hidden
IDLE_S = 0.005  # a wait when no bus has a frame
TABLES = ("table", "table2", "table3")
SNAPSHOT, SNAPSHOTS = ".psasnap", 20  # ending of the files that are offered, and how many
FRAME_S, FRAME_MB = 0.005, 10.0  # of recording that holds a whole frame, and its bound


@dataclass(slots=True)
class BenchView:
    """Used in the worker's thread alone. out: the only folder that a line may write into."""

    bench: Bench
    out: Path
    start: str = ""
    session: Session = field(init=False)
    channels: dict[str, Channels] = field(init=False)
    traces: list[CanTrace] = field(init=False)
    histories: dict[str, Transcript] = field(
        default_factory=dict
    )  # what led to each snapshot, by its name: the panel's
    lines: dict[str, Ints] = field(init=False)  # of a unit: frames drawn from its lines, torn ones
    tables: tuple[str, ...] = ()  # axes of the rate table: names of their readings
    mounts: dict[str, str] = field(default_factory=dict)  # where each unit is: head, table ...
    _viewed_s: float = 0.0
    _before: dict[str, tuple[int, int]] = field(default_factory=dict)  # lost and torn, when the bench was lent

    def __post_init__(self) -> None:
        self.session = Session(self.bench, self.start)
        self.session.transcript.lockstep = False  # the page moves time, and no line says so
        self.channels = {name: Channels() for name in self.bench.units}
        self.lines = {name: np.zeros(2, dtype=np.int64) for name in self.bench.units}
        self.traces = [self._trace(bus) for bus in self.bench.hosts]
        self.tables = tuple(n for k, n in enumerate(TABLES, 1) if self._maybe("table.read", {"axis": k}))

        told = self._maybe("units", {}).get("units", ())
        self.mounts = {str(u["name"]): str(u.get("on", "")) for u in told}

    @property
    def pace(self) -> str:
        return self.bench.pace

    @property
    def opens_paused(self) -> bool:
        return False

    @property
    def is_over(self) -> bool:
        return False

    @property
    def unit(self) -> str:
        return self.session.dut_name

    def look_between(self, look: Callable[[], None]) -> None:
        self.bench.between = look

    def wait(self, for_s: float) -> None:
        """As far as it comes meanwhile: a high speed slows down rather than hold up what pages ask for."""
        deadline_s, left_ns, slice_ns = time.monotonic() + TURN_S, round(for_s * NS), SLICE_NS
        while left_ns > 0 and time.monotonic() < deadline_s:
            self.bench.wait(min(slice_ns, left_ns) / NS)
            left_ns, slice_ns = left_ns - slice_ns, 2 * slice_ns  # of a fast bench a long one soon

    def close(self) -> None:
        self.bench.close()

    def _trace(self, bus: str) -> CanTrace:
        host = self.bench.hosts[bus]
        boards = {u.node.node_id: u.board for u in self.bench.units.values() if u.host is host}
        trace = CanTrace(bus, boards)
        host.listeners.append(trace.on_message)
        return trace

    # ---- what a page asks for

    def line(self, text: str) -> dict[str, Any]:
        """Carry out one line of the shell. Raises Wrong or another BenchError."""
        outcome = self.session.do(self._allowed(text))
        if outcome is None:
            return {"text": "", "result": {}}
        if outcome.call.command.name == "bench.snapshot":
            self.histories[Path(str(outcome.call.args["path"])).name] = self.session.transcript.copy()
        return {"line": outcome.call.line, "text": outcome.text, "result": outcome.result, "failed": outcome.failed}

    def _allowed(self, text: str) -> str:
        """The line, with files in our folder. Raises Wrong."""
        call = parse(text, self.session.vocabulary)
        if call is None:
            return text
        if call.command.name in NOT_HERE:
            known = "a command of the panel; psabench shell --connect has all"
            raise Wrong(expected(known, call.command.name, "panel"))
        names = [a for a in FILE_ARGS if a in call.args]
        if not names:
            return text
        self.out.mkdir(parents=True, exist_ok=True)
        return Call(call.command, call.args | {a: str(self.file(str(call.args[a]))) for a in names}).line

    def file(self, name: str) -> Path:
        """A file of that name in our folder. Raises Wrong."""
        if not PLAIN_NAME.fullmatch(name):
            raise Wrong(expected(f"a file name without a folder (it will be in {self.out})", repr(name[:40]), "file"))
        return self.out / name

    def go_on_from(self, name: str) -> None:
        """This bench comes from a snapshot: so does its script, where the panel has seen it made."""
        if name in self.histories:
            self.session.transcript = self.histories[name].copy()

    def frame(self) -> Mapping[str, Any]:
        """The next frame of the chosen unit on its lines, a torn one first, as SVG; counts. Raises BenchError."""
        if not self.bench.units:
            raise BenchError(expected("a PSA-2", "no unit", "frame"))
        if not isinstance(self.session.dut, Psa2):
            raise BenchError(expected("a PSA-2", f"a {self.session.dut.title}", "frame"))
        self.out.mkdir(parents=True, exist_ok=True)
        path = self.out / "frame.vcd"
        self.bench.probe.start(path, self.session.dut_name, limit_mb=FRAME_MB)
        try:
            self.bench.wait(FRAME_S)
        finally:
            self.bench.probe.stop()
        try:
            drawn = drawn_frame(read_vcd(path))
        except ValueError as e:
            raise BenchError(f"frame: {e}") from e
        self.lines[self.session.dut_name] += (drawn["frames"], drawn["torn"])
        return drawn

    def channel_statistics(self, channel: str) -> dict[str, Any]:
        """Of a channel of the chosen unit. Raises BenchError."""
        return channel_figures(self.channels.get(self.session.dut_name, Channels()), channel)

    def describe(self) -> dict[str, Any]:
        """The whole state of the page, for one that opens or has missed something."""
        kept = {"history": self._history(), "snapshots": self.snapshots(), "tables": self.tables}
        add = self.session.vocabulary.commands.get("faults.add")
        torn = tears_of(add, self.session.dut_name, self.session.dut) if self.bench.units else []
        return {"kind": "hello", **describe_bench(self.session), **kept, "tears": torn}

    def _history(self) -> dict[str, Any]:
        name = self.session.dut_name
        return unit_message(name, c, list(c.history)) if (c := self.channels.get(name)) else {}

    def snapshots(self) -> list[str]:
        """Snapshots in our folder, the latest first."""
        found = [p for p in self.out.glob(f"*{SNAPSHOT}") if p.is_file()]
        return [p.name for p in sorted(found, key=lambda p: p.stat().st_mtime_ns, reverse=True)[:SNAPSHOTS]]

    # ---- what goes by itself

    def receive(self, for_s: float) -> None:
        """Spend real time receiving, from all buses alike: a full one must not keep the others waiting."""
        hosts = list(self.bench.hosts.values())
        deadline_s = time.monotonic() + for_s
        while (left_s := deadline_s - time.monotonic()) > 0.0:
            came = [host.receive_turn(0.0) for host in hosts]
            if not any(came):
                time.sleep(min(left_s, IDLE_S))

    def lend(self) -> None:
        """To another program, which starts and stops streams: gaps are no losses meanwhile."""
        units = self.bench.units.items()
        self._before = {n: (u.frames.counters.lost, u.frames.counters.torn) for n, u in units}

    def follow(self) -> None:
        """Time is where the other program has brought it."""
        self.bench.resync()

    def take_back(self, why: str) -> None:
        """Ours again, with what has come until now; the script of this session does not lead here."""
        self.follow()
        self.bench.catch_up()
        self.take(every_unit=True)
        for unit in self.bench.units.values():
            unit.frames.forget()
        self._before = {}
        self.session.transcript.add(f"# {why}", self.session.now_ns())

    def take(self, every_unit: bool) -> dict[str, Any]:
        """New buckets of the chosen unit; of the others, which are kept for the overview, when every_unit."""
        found: dict[str, Any] = {}
        for name, unit in self.bench.units.items():
            if name != self.session.dut_name and not every_unit:
                continue
            buckets = self.channels[name].add(samples_of(unit.frames.take()))
            if name in self._before:
                unit.frames.counters.lost, unit.frames.counters.torn = self._before[name]
            if name == self.session.dut_name and buckets:
                found = unit_message(name, self.channels[name], buckets)
        return found

    def state(self, *, lines: bool) -> dict[str, Any]:
        """Instruments, faults, lines, counters of the bench, and the overview of units."""
        asked = {name: self._maybe(*call) for name, call in self._questions(lines).items()}
        counters = asked.pop("counters")
        return {
            "kind": "state",
            "instruments": {k: v for k, v in asked.items() if v and k not in ("faults", "lines")},
            "faults": asked["faults"].get("faults", []),
            "lines": asked.get("lines", {}).get("lines", {}),
            "bus": counters.get("bus", {}),
            "late": counters.get("pace", {}).get("late"),
            "files": counters.get("files", []),
            "counters": counters.get("units", {}).get(self.session.dut_name, {}),
            "overview": self._overview(),
        }

    def _questions(self, lines: bool) -> dict[str, tuple[str, Mapping[str, object]]]:
        unit: dict[str, object] = {"unit": self.session.dut_name} if self.session.dut_name else {}
        return {
            **({"lines": ("lines", unit)} if lines else {}),
            "counters": ("counters", {}),
            "faults": ("fault.list", {}),
            "head": ("head.read", {}),
            **{name: ("table.read", {"axis": axis}) for axis, name in enumerate(self.tables, 1)},
            "chamber": ("chamber.read", {}),
            "supply": ("supply.read", {}),
        }

    def _maybe(self, command: str, args: Mapping[str, object]) -> dict[str, Any]:
        if self.bench.pace == "real" or command.split(".")[0] in self.session.vocabulary.absent:
            return {}
        with suppress(ControlError):
            return self.bench.control.call(command, **args).result
        return {}

    def _overview(self) -> list[dict[str, Any]]:
        return [
            overview_row(name, unit.title, self.channels[name], unit.frames.counters)
            | {"lines": self.lines[name].tolist()}
            for name, unit in self.bench.units.items()
        ]

    def can(self, now_s: float) -> dict[str, Any]:
        """The CAN card."""
        span_s, self._viewed_s = now_s - self._viewed_s, now_s
        return {"kind": "can", "buses": [t.view(span_s) for t in self.traces]}

    def truth(self) -> dict[str, Any]:
        """Only for pages whose switch is on. Raises BenchError."""
        unit = self.session.dut_name or None
        return {"kind": "truth", "state": self.bench.truth_state(unit)}

    def now_s(self) -> float:
        """Time of the bench, s."""
        t_ns = self.session.now_ns()
        return self.bench.time_s if t_ns is None else t_ns / 1e9

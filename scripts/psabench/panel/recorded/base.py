"""What recordings of the bus and of lines have in common: files, units with channels, lines that move time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from psabench.errors import BenchError, expected
from psabench.panel.channels import Channels, channel_figures, unit_message
from psabench.panel.describe import describe_command
from psabench.shell.builtins import ROWS
from psabench.shell.commands import Vocabulary
from psabench.shell.grammar import Call, parse
from psabench.shell.lexer import Wrong

LINES = ("wait", "at", "time", "dut.use")  # of the shell that a recording understands


class PlayedView(ABC):
    """See `view.View`. titles: board and node by unit; channels: by unit, as far as they have been played."""

    pace = "step"
    opens_paused = False

    def __init__(self, path: Path, files: Mapping[str, Path]) -> None:
        self.path, self.files = path, files
        self.unit = ""
        self.titles: dict[str, tuple[str, int]] = {}
        self.channels: dict[str, Channels] = {}
        rows = {row.command.name: row.command for row in ROWS if row.command.name in LINES}
        self._vocabulary = Vocabulary(rows, {})

    # ---- of each kind

    @abstractmethod
    def now_s(self) -> float: ...

    @abstractmethod
    def look_between(self, look: Callable[[], None]) -> None: ...

    @abstractmethod
    def wait(self, for_s: float) -> None: ...

    @abstractmethod
    def take(self, every_unit: bool) -> dict[str, Any]: ...

    @abstractmethod
    def state(self, *, lines: bool) -> dict[str, Any]: ...

    @abstractmethod
    def can(self, now_s: float) -> dict[str, Any]: ...

    @abstractmethod
    def go_to(self, t_s: float) -> None:
        """Backwards, too."""

    @abstractmethod
    def ended(self) -> str:
        """Why nothing more comes; "": more comes."""

    @abstractmethod
    def about(self) -> Mapping[str, Any]:
        """For the card, beside the files."""

    # ---- of both

    @property
    def is_over(self) -> bool:
        return bool(self.ended())

    def receive(self, for_s: float) -> None:
        raise AssertionError("a recording moves in steps")

    def close(self) -> None:  # noqa: B027  # nothing is open: a reader closes its file
        """Nothing to do."""

    def line(self, text: str) -> dict[str, Any]:
        """One of LINES. Raises Wrong."""
        call, before_s = parse(text, self._vocabulary), self.now_s()
        if call is None:
            return {"text": "", "result": {}}
        result = self._result(call)
        shown = ", ".join(f"{k} {v}" for k, v in result.items())
        rewound = self.now_s() < before_s  # the page draws its curves again
        return {"line": call.line, "text": shown, "result": result, "failed": "", "rewound": rewound}

    def _result(self, call: Call) -> dict[str, Any]:
        if call.command.name == "wait":
            self.go_to(self.now_s() + float(str(call.args["for_s"])))
        elif call.command.name == "at":
            self.go_to(float(str(call.args["t_s"])))
        elif call.command.name == "dut.use":
            self._use(str(call.args.get("unit", self.unit)))
            return {"unit": self.unit}
        return {"t_s": self.now_s()} | ({"frames": self.ended()} if self.ended() else {})

    def _use(self, name: str) -> None:
        if name not in self.titles:
            raise Wrong(expected(", ".join(self.titles) or "no unit", repr(name[:40]), "unit"))
        self.unit = name

    def frame(self) -> Mapping[str, Any]:
        raise BenchError(expected("a bench with lines", "a recording", "frame"))

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
        units = [{"name": n, "board": title, "node": node} for n, (title, node) in self.titles.items()]
        c = self.channels.get(self.unit)
        files: dict[str, Any] = {"file": self.path.name, "files": list(self.files)}
        lists = dict.fromkeys(("snapshots", "tables", "tears"), ())
        return {
            "kind": "hello",
            "pace": self.pace,
            "units": units,
            "unit": self.unit,
            "truth": False,
            "commands": commands,
            "history": unit_message(self.unit, c, list(c.history)) if c else {},
            "recording": files | dict(self.about()),
            **lists,
            **{name: {} for name in ("registers", "absent", "choices")},
        }

    def played(self, overview: list[dict[str, Any]]) -> dict[str, Any]:
        """The state of a page; a recording has no instruments, no faults and no counters."""
        nothing: dict[str, Any] = {"instruments": {}, "faults": [], "lines": {}, "bus": {}, "counters": {}, "files": []}
        return {"kind": "state", "late": None, "overview": overview, "ended": self.ended(), **nothing}

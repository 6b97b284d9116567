"""A bench for the tests of the shell: its control socket is a function, its time a number, its vocabulary small."""

from __future__ import annotations

from typing import Any, cast

from psabench.bench import Bench
from psabench.errors import ControlError
from psabench.link.control import Reply
from psabench.shell.commands import Arg, Command, Kind, Vocabulary, from_help, with_kinds
from psabench.status import Status

ROWS: list[dict[str, Any]] = [
    {"name": "help", "what": "Lists the commands.", "args": []},
    {"name": "run", "what": "Moves the time.", "args": []},
    {
        "name": "head.turn",
        "what": "Turns the dividing head.",
        "args": [
            {"name": "angle_deg", "type": "number", "unit": "deg", "min": -3600, "max": 3600, "what": "on its scale"}
        ],
    },
    {
        "name": "head.mount",
        "what": "Mounts with another face.",
        "args": [{"name": "face", "type": "choice", "choices": ["direct", "reversed", "side"], "what": "which face"}],
    },
    {"name": "head.read", "what": "Reads the scale.", "args": []},
    {
        "name": "table.rate",
        "what": "Turns an axis.",
        "args": [
            {"name": "axis", "type": "integer", "min": 1, "max": 3, "what": "outermost first"},
            {"name": "rate_dps", "type": "number", "unit": "deg/s", "min": -100, "max": 100, "what": "of the axis"},
        ],
    },
    {
        "name": "table.profile",
        "what": "Rates against time.",
        "args": [
            {"name": "axis", "type": "integer", "min": 1, "max": 3, "what": "outermost first"},
            {"name": "times_s", "type": "numbers", "unit": "s", "min": 0, "max": 100, "what": "instants"},
        ],
    },
    {
        "name": "supply.output",
        "what": "Switches.",
        "args": [{"name": "on", "type": "boolean", "what": "output on"}],
    },
    {
        "name": "vcd.start",
        "what": "Records the lines.",
        "args": [
            {"name": "path", "type": "text", "what": "file"},
            {"name": "unit", "type": "unit", "optional": True, "what": "name of a unit"},
        ],
    },
    {"name": "lines", "what": "Levels now.", "args": []},
    {"name": "counters", "what": "Counters.", "args": []},
    {
        "name": "fault.add",
        "what": "Adds a fault.",
        "args": [
            {"name": "kind", "type": "name", "what": "see faults.kinds"},
            {"name": "point", "type": "name", "what": "see faults.points"},
            {"name": "at_s", "type": "number", "unit": "s", "min": 0, "max": 86400, "optional": True, "what": "when"},
            {
                "name": "for_s",
                "type": "number",
                "unit": "s",
                "min": 0,
                "max": 100,
                "optional": True,
                "what": "how long",
            },
            {"name": "bias_v", "type": "number", "unit": "V", "min": -15, "max": 15, "optional": True, "what": "added"},
            {"name": "mask", "type": "integer", "min": 1, "max": 255, "optional": True, "what": "bits"},
        ],
    },
]
CHOICES = {("", "unit"): ("a", "b")}
KINDS: list[dict[str, Any]] = [
    {"kind": "stuck", "what": "Stands still.", "points": ["UNIT.sensor.x|y|z", "UNIT.line.NAME"], "args": []},
    {
        "kind": "bias",
        "what": "Adds.",
        "points": ["UNIT.sensor.x|y|z"],
        "args": [
            {
                "name": "bias_v",
                "type": "number",
                "unit": "V",
                "min": -15,
                "max": 15,
                "least": 2e-6,
                "optional": False,
                "what": "added",
            }
        ],
    },
    {
        "kind": "lost",
        "what": "Loses.",
        "points": ["bus.NAME", "supply"],
        "args": [
            {
                "name": "for_s",
                "type": "number",
                "unit": "s",
                "min": 0,
                "max": 10,
                "optional": False,
                "what": "how long",
            },
            {"name": "mask", "type": "integer", "min": 1, "max": 255, "optional": True, "what": "bits"},
        ],
    },
]
POINTS = ["a.sensor.x", "a.sensor.z", "a.line.INT", "bus.can0", "supply"]
OWN = [
    Command(
        name="wait", what="Lets time pass.", args=(Arg(name="for_s", kind=Kind.REAL, unit="s", low=0, high=86400),)
    ),
    Command(
        name="scpi.send",
        what="Sends a line.",
        args=(
            Arg(name="instrument", kind=Kind.CHOICE, choices=("table", "head")),
            Arg(name="line", kind=Kind.REST),
        ),
    ),
]


def vocabulary() -> Vocabulary:
    commands = [*from_help(ROWS, CHOICES), *OWN]
    commands = [with_kinds(c, KINDS, POINTS) if c.name == "faults.add" else c for c in commands]
    return Vocabulary({c.name: c for c in commands}, {"chamber": "the scenario has no chamber"})


class FakeControl:
    """Answers `head.turn` and `head.read` like a head, notes the rest."""

    def __init__(self, bench: FakeBench) -> None:
        self.bench = bench
        self.calls: list[tuple[str, dict[str, object]]] = []
        self.angle_deg = 0.0

    def call(self, command: str, /, **args: object) -> Reply:
        self.calls.append((command, args))
        return Reply(t_ns=self.bench.t_ns, can_rx=0, rx={}, result=self._result(command, args))

    def _result(self, command: str, args: dict[str, object]) -> dict[str, Any]:
        if command == "help":
            return {"commands": ROWS}
        if command == "units":
            return {"units": [{"name": "a"}, {"name": "b"}]}
        if command.startswith("fault"):
            return {"kinds": KINDS, "points": POINTS}
        if command == "counters":
            raise ControlError(command, "state", "not now")
        if command == "lines":
            raise KeyboardInterrupt
        if command == "head.turn":
            self.angle_deg = float(str(args["angle_deg"]))
        return {"angle_deg": self.angle_deg} if command.startswith("head") else {}


class FakeBench:
    """No units on a bus, no instruments with an address."""

    def __init__(self, pace: str = "step") -> None:
        self.pace = pace
        self.t_ns = 0
        self.units: dict[str, Any] = {}
        self.addresses: dict[str, str] = {}
        self.control = FakeControl(self)

    @property
    def time_s(self) -> float:
        return self.t_ns / 1e9

    def wait(self, dwell_s: float) -> None:
        self.t_ns += round(dwell_s * 1e9)

    def status(self) -> Status:
        return Status(
            time_s=self.time_s,
            pace=self.pace,
            angle_deg=10.0,
            rate_dps=1.5,
            temp_degc=25.0,
            frames=7,
            late=1,
            lost=2,
            files=(),
        )


def fake(pace: str = "step") -> tuple[FakeBench, Bench]:
    """The same bench twice: as what it is, and as what the shell takes it for."""
    bench = FakeBench(pace)
    return bench, cast(Bench, bench)

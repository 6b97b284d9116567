"""A bench for the tests of the shell: its control socket is a function, its time a number."""

from __future__ import annotations

from typing import Any, cast

from psabench.bench import Bench, Status
from psabench.errors import ControlError
from psabench.link.control import Reply
from shell_words import KINDS, POINTS, ROWS


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
        )


def fake(pace: str = "step") -> tuple[FakeBench, Bench]:
    """The same bench twice: as what it is, and as what the shell takes it for."""
    bench = FakeBench(pace)
    return bench, cast(Bench, bench)

"""A session: a bench, what may be said to it, and what has been said. Prints nothing; terminal and script do."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

from psabench.bench import Bench
from psabench.boards.unit import Unit
from psabench.errors import BenchError, ControlError, CycleRefused, DeviceError
from psabench.instruments import KINDS
from psabench.shell import builtins, dut, render
from psabench.shell.commands import EVENTS, Command, Vocabulary, from_help, with_events, with_kinds
from psabench.shell.grammar import Call, parse
from psabench.shell.lexer import Wrong
from psabench.shell.transcript import Transcript

# The bench understood these codes of a rejection to mean: the line is wrong. Others: not now, not here.
WRONG_CODES = {"syntax", "command", "argument", "type", "range"}
NOT_NOW = 0x08000022  # CiA 301: the state of the device does not allow it
QUIT = "quit"
MOVE_TIME = {"bus.read", "bus.write"}  # of the bench's own commands; to the end of the cycle
PATHS = {"path"}  # arguments that name files of this machine, relative to where we are
NO_CONTROL = "it needs the control socket of an emulator (--connect PATH)"
NO_CAN = "it needs a bus (--can SPEC, as socketcand:127.0.0.1:29536)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a line came to. failed: an expectation that did not hold; the bench is well."""

    call: Call
    result: Mapping[str, Any]
    t_ns: int | None  # simulated time afterwards; None: no one tells it
    failed: str = ""

    @property
    def text(self) -> str:
        """As people see it; "": there is nothing to say."""
        return f"FAILED: {self.failed}" if self.failed else render.text(self.result)


@dataclass(slots=True)
class Session:
    """bench: open, and closed by who opened it. start: the line that brings up the same bench again; "": none."""

    bench: Bench
    start: str = ""
    vocabulary: Vocabulary = field(init=False)
    transcript: Transcript = field(init=False)
    latest: Mapping[str, Any] = field(default_factory=dict)  # result that `expect` looks at
    dut_name: str = ""
    tick: Callable[[], None] = lambda: None  # called now and then while time passes

    def __post_init__(self) -> None:
        self.transcript = Transcript(self.start, lockstep=self.bench.pace == "step")
        self.vocabulary = learn(self.bench)
        if self.bench.units:
            self.use(next(iter(self.bench.units)))

    @property
    def dut(self) -> Unit:
        """The unit that `dut` represents."""
        return self.bench.units[self.dut_name]

    def use(self, name: str) -> None:
        """`dut` is this unit from now on, one of the bench's; the commands that are offered follow."""
        self.dut_name = name
        mine = {r.command.name: dut.of_unit(r.command, self.dut) for r in dut.ROWS}
        commands = {n: mine.get(n, c) for n, c in self.vocabulary.commands.items()}
        self.vocabulary = replace(self.vocabulary, commands=commands)

    def now_ns(self) -> int | None:
        """Simulated time; None on a bench that does not tell it."""
        if self.bench.pace == "real":
            return None
        if self.bench.pace == "step":
            return round(self.bench.time_s * 1e9)
        return self.bench.control.call("time").t_ns

    def do(self, line: str) -> Outcome | None:
        """Carry out one line; None for a blank or a comment.

        Raises Wrong for a line that cannot be understood or carried out as it is, other BenchErrors for what
        the bench rejects now or for a link that fails. Whatever happens is in the transcript.
        """
        t_ns = self.now_ns()
        try:
            call = parse(line, self.vocabulary)
            if call is None:
                return None
            outcome = self._carry_out(call)
        except BenchError as e:
            self.transcript.add(line.strip(), t_ns, str(e))
            raise
        if call.command.name not in builtins.UNSAID:
            self.transcript.add(line.strip(), t_ns)
        return outcome

    def _carry_out(self, call: Call) -> Outcome:
        try:
            result = self._result(call)
        except ControlError as e:
            text = self.vocabulary.in_shell(f"{call.command.name}: {e.text}")
            raise (Wrong(text) if e.code in WRONG_CODES else BenchError(text)) from e
        except DeviceError as e:
            if e.abort_code != NOT_NOW or isinstance(e, CycleRefused):
                raise
            raise BenchError(f"{e}; {self._why_not_now()}") from e
        failed = str(result.get("failed", "")) if call.command.name == "expect" else ""
        if result and call.command.name not in builtins.UNSAID and call.command.name != "expect":
            self.latest = result
        t_ns = None if call.command.wire == QUIT else self.now_ns()  # no one is there to tell it
        return Outcome(call=call, result=result, t_ns=t_ns, failed=failed)

    def _why_not_now(self) -> str:
        """The board's own words (object 2031h) where it has any."""
        with suppress(BenchError):
            words = self.dut.refusal() if self.dut_name in self.bench.units else ""
            if words:
                return f"in its own words (object 2031h): {words}"
        return "while the board is being set up: dut.ready waits for the end"

    def _result(self, call: Call) -> Mapping[str, Any]:
        mine = builtins.HANDLERS.get(call.command.name)
        if mine:
            return mine(self, call.args)
        args = {k: os.path.abspath(str(v)) if k in PATHS else v for k, v in call.args.items()}
        result = self.bench.control.call(call.command.wire, **args).result
        if call.command.wire in MOVE_TIME:
            self.bench.catch_up()
        return result


def learn(bench: Bench) -> Vocabulary:
    """What may be said to this bench, and which objects it has not."""
    mine = [row.command for row in builtins.ROWS if row.here(bench)]
    theirs = _of_table(bench) if bench.pace != "real" else []
    missing = _not_in_scenario(bench) if theirs else {}
    if theirs:
        mine = [with_events(c, _events(bench)) if c.name == "until" else c for c in mine]
    commands: dict[str, Command] = {c.name: c for c in [*theirs, *mine] if c.name.split(".")[0] not in missing}
    things = {name.split(".")[0] for name in commands}
    why = {
        name: _why_absent(bench, name) for name in ("dut", "can", "scpi", *KINDS, "probe", "faults", "bench")
    } | missing
    return Vocabulary(commands, {name: reason for name, reason in why.items() if name not in things})


def _not_in_scenario(bench: Bench) -> dict[str, str]:
    """Instruments that this emulator's scenario has not, and its own words for it."""
    reasons = {}
    for name in KINDS:
        try:
            bench.control.call(f"{name}.read", **({"axis": 1} if name == "table" else {}))
        except ControlError as e:
            if e.code == "state":
                reasons[name] = e.text
    return reasons


def _events(bench: Bench) -> tuple[str, ...]:
    """Those that the boards of this bench can have: the choices of run.until."""
    rows = {str(row["name"]): row for row in bench.control.call("help").result["commands"]}
    args = rows["run.until"]["args"] if "run.until" in rows else []
    return next((tuple(a["choices"]) for a in args if a["name"] == "event" and "choices" in a), EVENTS)


def _of_table(bench: Bench) -> list[Command]:
    choices: dict[tuple[str, str], tuple[str, ...]] = {}
    with suppress(ControlError):
        units = bench.control.call("units").result["units"]
        choices["", "unit"] = tuple(str(u["name"]) for u in units)
    commands = from_help(bench.control.call("help").result["commands"], choices)
    if any(c.name == "faults.add" for c in commands):
        kinds = bench.control.call("fault.kinds").result["kinds"]
        points = bench.control.call("fault.points").result["points"]
        commands = [with_kinds(c, kinds, points) if c.name == "faults.add" else c for c in commands]
    return commands


def _why_absent(bench: Bench, name: str) -> str:
    if name in ("dut", "can"):
        return NO_CAN
    if name == "scpi":
        return "no instrument has an address (--scpi table=TCPIP::192.0.2.7::5025::SOCKET)"
    if bench.pace != "real":
        return "this emulator has no commands for it"
    if name in KINDS:
        return (
            f"{NO_CONTROL}; an instrument with an address (--scpi {name}=VISA-ADDRESS) is reached by scpi.send {name}"
        )
    return NO_CONTROL

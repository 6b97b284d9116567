"""A case on the bench: an emulator in lockstep plays the board, the host runs beside it, both logs are kept.

Simulated time is moved in small steps, no faster than the wall's time unless the case is in haste; on a slow machine it
passes slower, and it waits for a host that reads slowly. So nothing depends on how fast this machine is, except what a
host times by a clock of its own; how long the bench has stood still is therefore kept (`stood_s`).
"""

from __future__ import annotations

import fcntl
import os
import select
import shlex
import signal
import struct
import subprocess
import termios
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Protocol, TextIO

from psabench.conform.host import results
from psabench.conform.host.results import Told
from psabench.emulator import Emulator
from psabench.errors import BadInput, TimeOut, expected, input_error
from psabench.link.control import Control

STEP_S = 0.005  # simulated, between looks at the wall's clock
COME_S = 60.0  # timeout for a host to come: it may be an interpreter
BY_HAND_S = 3600.0  # the same, where a person starts it
STUCK_S = 30.0  # timeout for a host that reads nothing
END_S = 20.0  # timeout for a host to end after its link has ended
READY_S = 3.0  # simulated, for a host to start the stream
EMPTY_LOOKS = 10  # at a pseudo-terminal, one after the other, 10 ms apart, until it has been read
PLACES = ("can", "pty", "line", "bus", "node", "form", "results", "word_bits", "code_bits")


def expand(command: str, places: Mapping[str, str]) -> list[str]:
    """The words of a command with its places filled in. Raises BadInput for one that is not there."""
    try:
        words = shlex.split(command)
    except ValueError as e:
        raise BadInput(f"--command {command}: {e}") from e
    if not words:
        raise BadInput(expected("the host's command line", "none", "--command"))
    try:
        return [w.format_map(dict(places)) for w in words]
    except (KeyError, IndexError, ValueError) as e:
        known = ", ".join(f"{{{p}}}" for p in PLACES)
        raise BadInput(expected(f"{known}; a brace itself is {{{{ or }}}}", e, f"--command {command}")) from e


@dataclass(slots=True)
class Program:
    """A host that we start. What it tells goes to `results`, what it complains of to `errors`."""

    argv: list[str]
    results: Path
    errors: Path
    on_stdout: bool
    come_s: float = COME_S
    process: subprocess.Popen[bytes] | None = None
    killed: bool = False

    def start(self) -> None:
        """Raises BadInput when it cannot be started."""
        with self.results.open("wb") as out, self.errors.open("wb") as err:
            try:
                self.process = subprocess.Popen(
                    self.argv,
                    stdin=subprocess.DEVNULL,
                    stdout=out if self.on_stdout else err,
                    stderr=err,
                    start_new_session=True,
                )
            except OSError as e:
                raise input_error(self.argv[0], "a program", e) from e

    def gone(self) -> bool:
        return self.process is not None and self.process.poll() is not None

    def kill(self) -> None:
        """It and what it has started."""
        if self.process is not None and self.process.poll() is None:
            self.killed = True
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()

    def wait(self) -> int | None:
        """Its exit status; None: it had to be ended."""
        assert self.process is not None
        try:
            status = self.process.wait(END_S)
        except subprocess.TimeoutExpired:
            self.kill()
        return None if self.killed else status

    def told(self) -> Told:
        with self.results.open("rb") as lines:
            return results.read(lines)


@dataclass(slots=True)
class ByHand:
    """A host that somebody starts by hand and that tells into a file, which is emptied before each case.

    A case ends with its line "end"; Enter on the terminal skips one whose host has not come.
    """

    results: Path
    kept: Path  # a copy of what was reported
    invite: Callable[[], None]  # says that it is time
    terminal: TextIO | None = None  # where Enter is looked for
    come_s: float = BY_HAND_S

    def start(self) -> None:
        """Raises BadInput when the file is something else than what a host told."""
        if self.results.exists():
            with self.results.open("rb") as lines:
                if results.read(lines).bad_lines:
                    raise BadInput(expected("results of a host, or no file", "other lines", self.results))
        self.results.parent.mkdir(parents=True, exist_ok=True)
        self.results.write_bytes(b"")
        self.invite()

    def gone(self) -> bool:
        """Raises TimeOut when Enter was pressed."""
        if self.terminal and select.select([self.terminal], [], [], 0)[0] and self.terminal.readline():
            raise TimeOut("skipped with Enter")
        return False

    def kill(self) -> None:
        """There is nothing to end."""

    def wait(self) -> int | None:
        """0 when its end has been told, None when it does not come."""
        deadline_s = time.monotonic() + END_S
        while time.monotonic() < deadline_s:
            if self.told().of("end"):
                return 0
            time.sleep(0.05)
        return None

    def told(self) -> Told:
        if not self.results.exists():
            return Told()
        text = self.results.read_bytes()
        if self.kept != self.results:
            self.kept.write_bytes(text)
        return results.read(text.splitlines(keepends=True))


class Bridge(Protocol):
    """A bus port: stimulus_bus.BusBridge."""

    def serve(self, control: Control, host: Program | ByHand, for_s: float, cycle_s: float, leap_s: float) -> None: ...


@dataclass(slots=True)
class HostBench:
    """What a case plays on. speed: simulated seconds in one of the wall's, at most, while nothing is silent."""

    emulator: Emulator
    control: Control
    host: Program | ByHand
    speed: float = 1.0
    node: int = 5
    bridge: Bridge | None = None  # where the host is on the board's parallel bus
    pty: Path | None = None  # where it is on a pseudo-terminal
    stood_s: float = 0.0  # longest that simulated time has stood still against the wall's
    clock: list[tuple[float, float]] = field(default_factory=list)  # simulated and the wall's time, about each step
    marks: dict[str, float] = field(default_factory=dict)  # instants, simulated s, that a check wants to know

    @property
    def now_s(self) -> float:
        return self.control.call("time").t_ns * 1e-9

    def mark(self, name: str) -> None:
        self.marks[name] = self.now_s

    def run(self, for_s: float, *, speed: float | None = None) -> None:
        """Let simulated time pass; speed 0: as fast as the host reads."""
        pace = self.speed if speed is None else speed
        left_s = for_s
        while left_s > 1e-9:
            step_s = min(STEP_S if pace else 0.05, left_s)
            begun_s = time.monotonic()
            with _Watchdog(self.host):
                now_s = self.control.call("run", for_s=step_s).t_ns * 1e-9
            if pace and (rest_s := step_s / pace - (time.monotonic() - begun_s)) > 0:
                time.sleep(rest_s)
            ended_s = time.monotonic()
            self.stood_s = max(self.stood_s, ended_s - begun_s)
            self.clock += [(now_s - step_s, begun_s), (now_s, ended_s)]
            left_s -= step_s

    def serve(self, for_s: float, *, cycle_s: float, leap_s: float = 0.0) -> None:
        """Let the host's cycles on the bus be carried out; each moves simulated time by so much, nothing else does."""
        assert self.bridge is not None
        self.put(f"000#01{self.node:02X}")  # what the board sends on CAN is our witness
        self.run(0.005, speed=0.0)
        self.bridge.serve(self.control, self.host, for_s, cycle_s, leap_s)
        self.run(0.005, speed=0.0)

    def run_between(self) -> None:
        """To where a reading has been sent and the next is not yet there: the first ms in which nothing is sent."""
        before = -1
        while before != (before := self.sent()):
            self.run(0.001, speed=0.0)

    def run_to_quiet(self) -> None:
        """To 0.9 ms after a conversion: both halves of its sample have been sent, the next is not yet there."""
        self.control.call("run.until", event="DRD_A")
        self.run(0.0009)

    def fault(self, kind: str, point: str, **args: object) -> int:
        return int(self.control.call("fault.add", kind=kind, point=point, **args).result["id"])

    def clear(self) -> None:
        self.control.call("fault.clear")

    def put(self, frame: str) -> None:
        """A frame of somebody else on the bus, as cansend takes it."""
        self.control.call("can.put", frame=frame)

    def await_host(self) -> None:
        """Until it is on the bus; time stands still meanwhile. Raises TimeOut."""
        deadline_s = time.monotonic() + self.host.come_s
        while not self.control.call("frames").result["clients"]:
            if self.host.gone():
                raise TimeOut("the host ended before it had opened the bus")
            if time.monotonic() > deadline_s:
                raise TimeOut(f"the host was not on the bus after {self.host.come_s:g} s")
            time.sleep(0.005)

    def await_stream(self, busy: int = 50, ready_s: float = READY_S) -> bool:
        """Until more than so many frames come in 50 ms; False when they do not in so much simulated time."""
        sent = self.sent()
        for _ in range(round(ready_s / 0.05)):
            self.run(0.05, speed=1.0)
            before, sent = sent, self.sent()
            if sent - before > busy:
                return True
        return False

    def await_report(self) -> None:
        """Until the host has reported something, for so long as another has to start the stream."""
        for _ in range(round(READY_S / 0.05)):
            if self.host.results.exists() and self.host.results.stat().st_size:
                return
            self.run(0.05, speed=1.0)

    def await_read(self) -> None:
        """Until the host has read what was sent, if it is on a pseudo-terminal; simulated time stands still."""
        if self.pty:
            begun_s = time.monotonic()
            drain(self.pty)
            self.stood_s = max(self.stood_s, time.monotonic() - begun_s)

    def sent(self) -> int:
        """CAN frames of the board so far."""
        return int(self.control.call("counters", unit="a").result["can"]["tx_frames"])


def drain(pty: Path) -> None:
    """Wait until the host has read what is in a pseudo-terminal: it would be gone with its other end."""
    port = os.open(pty, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        empty, deadline_s = 0, time.monotonic() + END_S
        while (
            empty < EMPTY_LOOKS and time.monotonic() < deadline_s
        ):  # what is on its way through the kernel comes meanwhile
            held = struct.unpack("i", fcntl.ioctl(port, termios.FIONREAD, b"\0\0\0\0"))[0]
            empty = 0 if held else empty + 1
            time.sleep(0.01)
    finally:
        os.close(port)


class _Watchdog:
    """Ends a host that reads nothing while simulated time waits for it."""

    def __init__(self, host: Program | ByHand) -> None:
        self._timer = threading.Timer(STUCK_S, host.kill)

    def __enter__(self) -> None:
        self._timer.start()

    def __exit__(self, kind: type[BaseException] | None, e: BaseException | None, tb: TracebackType | None) -> None:
        self._timer.cancel()

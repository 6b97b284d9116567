"""The bus port: cycles of a board's parallel bus as lines of text, from the emulator's pty or a register-level bridge.

    with BusPort("/dev/pts/7") as port:
        port.who().names           # {0: "X", 1: "Y", ...}
        port.read(3).data          # a read cycle at address 3
        port.write(15, 0x0003)     # a write cycle

Lines as docs/busport.md has them: `R 3` is answered by `R 03h 8000 t=1234567`, or by `E not-ready R 03h t=...`.
Answers come in the order of the lines, so that many can be on their way: `ask` and `answer`.
"""

from __future__ import annotations

import os
import re
import select
import time
import tty
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from psabench.errors import CycleRefused, LinkError, expected, link_error

TIMEOUT_S = 5.0  # for an answer
QUANTUM_S = 0.001  # step of the bench's time while waiting for an answer
LOOK_S = 0.02  # real time that an answer which is there needs to come through
LINE_MAX = 4096  # characters without an end of line: that is no bus port

# Code words of a rejection by the board: its abort code over CAN (docs/reference/protocol_psd1.md) and meaning.
CODES: Mapping[str, tuple[int, str]] = {
    "no-address": (0x06090011, "nothing answers at this address"),
    "read-only": (0x06010002, "this register is read-only"),
    "write-only": (0x06010001, "this register is write-only"),
    "not-ready": (0x08000022, "too early: no word waits there"),
    "taken": (
        0x08000022,
        "too early: no word waits there; the board's built-in host takes each that comes, profile psd1_host has none",
    ),
    "too-short": (0x06090030, "the strobe is shorter than the board needs"),
    "busy": (0x08000022, "another cycle is under way"),
    "bad-value": (0x06090030, "the register does not take this value"),
    "off": (0x08000020, "the board has no power, or a reset has cut the cycle"),
}
CYCLE = re.compile(r"([RW]) ([0-9A-F]{1,2})h? ([0-9A-F]{4}) t=(\d+)")
WHO = re.compile(r"I (\S+)((?: [0-9A-F]{1,2}h?=\S+)*) t=(\d+)")
REFUSED = re.compile(r"E (\S+) ([RW?-]) ([0-9A-F]{1,2}h?|-) t=(\d+)")


@dataclass(frozen=True, slots=True)
class Cycle:
    """A cycle that was carried out; data: what was read, or written."""

    write: bool
    address: int
    data: int
    t_s: float  # end of the strobe, the board's time


@dataclass(frozen=True, slots=True)
class Who:
    """What is there: the board, and the names of its registers by address."""

    board: str
    names: Mapping[int, str]
    t_s: float


class BusPort(AbstractContextManager["BusPort"]):
    """One end of a bus port. Leaving its context closes it.

    advance: lets the bench's time pass, seconds, where it stands still unless told (step pace); None: it passes by
    itself. Raises CycleRefused for what the board rejects, LinkError where the other end has gone, is silent, or says
    what no bus port says.
    """

    def __init__(self, path: str | Path, advance: Callable[[float], object] | None = None) -> None:
        self.path = Path(path)
        self._advance = advance
        self._input = b""
        try:
            self._fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as e:
            raise link_error(path, "a bus port", e) from e
        if os.isatty(self._fd):
            tty.setraw(self._fd)

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close this end; again does nothing."""
        if self._fd >= 0:
            os.close(self._fd)
        self._fd = -1

    def read(self, address: int, strobe_ns: int | None = None) -> Cycle:
        """A read cycle. strobe_ns: length of its strobe; None: the board's own."""
        return self._cycle(f"R {address:X}", strobe_ns)

    def write(self, address: int, data: int, strobe_ns: int | None = None) -> Cycle:
        """A write cycle. data: 16 bits."""
        if not 0 <= data <= 0xFFFF:
            raise ValueError(expected("a 16-bit word", data, "data"))
        return self._cycle(f"W {address:X} {data:X}", strobe_ns)

    def who(self) -> Who:
        """Which board is there, and what it has at its addresses."""
        self.ask("?")
        answer = self.answer()
        if not isinstance(answer, Who):
            raise LinkError(expected("the board's name and registers", str(answer), self.path))
        return answer

    def _cycle(self, line: str, strobe_ns: int | None) -> Cycle:
        self.ask(line if strobe_ns is None else f"{line} {strobe_ns}")
        answer = self.answer()
        if not isinstance(answer, Cycle):
            raise LinkError(expected(f"an answer to {line!r}", str(answer), self.path))
        return answer

    def ask(self, line: str) -> None:
        """Send a line as it is; its answer is the next that has not been taken."""
        data = line.encode() + b"\n"
        deadline_s = time.monotonic() + TIMEOUT_S
        while data:
            try:
                data = data[os.write(self._fd, data) :]
            except BlockingIOError:
                self._ready(select.POLLOUT, deadline_s - time.monotonic())
            except OSError as e:
                raise self._gone() from e
            if data and time.monotonic() >= deadline_s:
                raise LinkError(f"{self.path}: no input accepted for {TIMEOUT_S:g} s")

    def answer(self, timeout_s: float = TIMEOUT_S) -> Cycle | Who:
        """The answer to the oldest line that has none yet."""
        return parse(self.answered(timeout_s))

    def answered(self, timeout_s: float = TIMEOUT_S) -> str:
        """As `answer`, but the line as it is. timeout_s: of real time, or of the bench's time where we move it."""
        left_s = timeout_s
        while b"\n" not in self._input:
            if len(self._input) > LINE_MAX:
                raise LinkError(expected("an end of line", f"{len(self._input)} characters without", self.path))
            if left_s <= 0.0:
                raise LinkError(f"{self.path}: no answer within {timeout_s:g} s")
            left_s -= self._receive(left_s)
        line, _, self._input = self._input.partition(b"\n")
        return line.rstrip(b"\r").decode("ascii", "replace")

    def _receive(self, left_s: float) -> float:
        """What has come, or what comes soon; returns the time that it took of the timeout."""
        if self._advance is None:
            begun_s = time.monotonic()
            self._take(left_s)
            return time.monotonic() - begun_s
        if self._take(LOOK_S):
            return 0.0
        self._advance(QUANTUM_S)
        return QUANTUM_S

    def _take(self, timeout_s: float) -> bool:
        if not self._ready(select.POLLIN, timeout_s):
            return False
        try:
            data = os.read(self._fd, LINE_MAX)
        except BlockingIOError:
            return False
        except OSError as e:  # EIO: a pty whose other end has gone
            raise self._gone() from e
        if not data:
            raise self._gone()
        self._input += data
        return True

    def _ready(self, what: int, timeout_s: float) -> bool:
        if self._fd < 0:
            raise LinkError(f"{self.path}: closed")
        poll = select.poll()
        poll.register(self._fd, what)
        return bool(poll.poll(max(0.0, timeout_s) * 1e3))

    def _gone(self) -> LinkError:
        return LinkError(f"{self.path}: the other end has gone")


def parse(line: str) -> Cycle | Who:
    """An answer. Raises CycleRefused for a rejection of the board, LinkError for one of the port or what is none."""
    if m := CYCLE.fullmatch(line):
        return Cycle(write=m[1] == "W", address=int(m[2], 16), data=int(m[3], 16), t_s=int(m[4]) * 1e-9)
    if m := WHO.fullmatch(line):
        pairs = (pair.split("=", 1) for pair in m[2].split())
        return Who(board=m[1], names={int(a.rstrip("h"), 16): name for a, name in pairs}, t_s=int(m[3]) * 1e-9)
    if m := REFUSED.fullmatch(line):
        code, what = m[1], f"{m[2]} {m[3]} at {int(m[4]) * 1e-9:.9f} s"
        if code in CODES:
            raise CycleRefused(what, *CODES[code])
        raise LinkError(f"{what}: rejected by the bus port: {code}")
    raise LinkError(expected("an answer of a bus port", repr(line)))

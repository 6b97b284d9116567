"""A bus port of our own between a host and the emulated board: each cycle is kept, and moves simulated time.

Lines and answers are those of docs/busport.md. Time stands still but for the host's own cycles, each of which takes so
much of it: what is checked is what the host does between two words, and not how fast it or this machine is.
"""

from __future__ import annotations

import os
import re
import select
import time
from dataclasses import dataclass, replace

import canopen

from psabench.boards.objects import BusObjects
from psabench.conform.host.stimulus import STUCK_S, ByHand, Program
from psabench.conform.host.stimulus_line import Pty
from psabench.errors import ControlError, TimeOut
from psabench.link.control import Control
from psabench.places import proto_file

CODES = {"address": "no-address", "value": "bad-value"}  # of the control socket; the others differ in their dashes
LONGEST = 80  # characters of a line
MOST_ADDRESS = 15
LEAP_CYCLES = 10
BUS_OBJECT = BusObjects.BUS


@dataclass(frozen=True, slots=True)
class BusCycle:
    """What a host did on the bus. code: why it was rejected, "": it was not; data: what was read or written."""

    write: bool
    address: int
    data: int
    code: str
    t_ns: int


@dataclass(frozen=True, slots=True)
class Asked:
    """A line of a host. op and address: "-" and -1 where it has none; code: why it is none, "": it is one."""

    op: str = "-"
    address: int = -1
    data: int = 0
    strobe_ns: int = 0
    code: str = ""


def parse(line: bytes) -> Asked:
    """Any bytes."""
    fields = line.decode("latin-1").split()
    if len(line) > LONGEST:
        return Asked(code="overlong")
    if not fields or fields[0].upper() not in ("R", "W", "?"):
        return Asked(code="syntax")
    asked = Asked(op=fields[0].upper())
    if asked.op == "?":
        return asked if len(fields) == 1 else replace(asked, code="syntax")
    if len(fields) < 2:
        return replace(asked, code="syntax")
    if (address := _number(re.sub(r"(?<=.)[hH]$", "", fields[1]), 16, 2)) is None:
        return replace(asked, code="number")
    asked = replace(asked, address=address)
    rest = fields[2:]
    if asked.op == "W":
        if not rest:
            return replace(asked, code="syntax")
        if (data := _number(rest.pop(0), 16, 4)) is None:
            return replace(asked, code="number")
        asked = replace(asked, data=data)
    if rest:
        if not (strobe_ns := _number(rest.pop(0), 10, 9)):
            return replace(asked, code="number")
        asked = replace(asked, strobe_ns=strobe_ns)
    return replace(asked, code="syntax") if rest else asked


def _number(text: str, base: int, most: int) -> int | None:
    digits = "0123456789abcdef"[:base]
    return int(text, base) if 0 < len(text) <= most and all(c in digits for c in text.lower()) else None


def refused(asked: Asked) -> str:
    """The answer to what is not carried out."""
    return f"E {asked.code} {asked.op} {'-' if asked.address < 0 else f'{asked.address:02X}h'}"


class BusBridge(Pty):
    """What the host asks for on it is carried out, one line after the other."""

    def __init__(self, family: str) -> None:
        super().__init__()
        self.cycles: list[BusCycle] = []
        self.family = family
        self._input = b""
        self._t_ns = 0

    def serve(self, control: Control, host: Program | ByHand, for_s: float, cycle_s: float, leap_s: float) -> None:
        """Until so much simulated time has passed, or the host has left; leap_s: passes besides, with each tenth cycle.

        Raises TimeOut when the host never asks.
        """
        begin_ns = self._t_ns = control.call("run", for_s=cycle_s).t_ns
        while self._t_ns - begin_ns < for_s * 1e9:
            line = self._line(host)
            if line is None:
                if not self.cycles:
                    raise TimeOut("the host did not open the bus port, or asked for nothing")
                host.kill()
                return
            answer = self._perform(control, line)
            leaps = leap_s > 0.0 and len(self.cycles) % LEAP_CYCLES == 0
            self._t_ns = control.call("run", for_s=cycle_s + leaps * leap_s).t_ns
            os.write(self._ours, f"{answer} t={self._t_ns}\n".encode())

    def _line(self, host: Program | ByHand) -> bytes | None:
        deadline_s = time.monotonic() + (STUCK_S if self.cycles else host.come_s)
        while b"\n" not in self._input:
            if select.select([self._ours], [], [], 0.05)[0]:
                self._input += os.read(self._ours, 4096)
            elif host.gone() or time.monotonic() > deadline_s:
                return None
        line, _, self._input = self._input.partition(b"\n")
        return line.strip()

    def _perform(self, control: Control, line: bytes) -> str:
        """One line; the answer but for its time."""
        asked = parse(line)
        if asked.code:
            return refused(asked)
        if asked.op == "?":
            return " ".join([f"I {self.family}", *(f"{a:02X}h={name}" for a, name in self._names())])
        args = {"strobe_ns": asked.strobe_ns} if asked.strobe_ns else {}
        data = asked.data
        try:
            if asked.address > MOST_ADDRESS:
                asked = replace(asked, code="no-address")
            elif asked.op == "W":
                control.call("bus.write", unit="a", address=asked.address, data=data, **args)
            else:
                data = int(control.call("bus.read", unit="a", address=asked.address, **args).result["data"])
        except ControlError as e:
            asked = replace(asked, code=CODES.get(e.code, e.code.replace("_", "-")))
        self.cycles.append(BusCycle(asked.op == "W", asked.address, data, asked.code, self._t_ns))
        return refused(asked) if asked.code else f"{asked.op} {asked.address:02X}h {data:04X}"

    def _names(self) -> list[tuple[int, str]]:
        bank = canopen.import_od(str(proto_file(f"{self.family}.eds")))[BUS_OBJECT]
        assert isinstance(bank, canopen.objectdictionary.ODRecord | canopen.objectdictionary.ODArray)
        return [(sub - 1, bank[sub].name) for sub in sorted(bank) if sub]

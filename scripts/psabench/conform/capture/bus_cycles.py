"""Cycles of the parallel bus as its lines show them: CS, RW, AB0..AB3, D0..D15 (docs/boards/psd1.md, Parallel bus)."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from psabench.boards.board import Bus
from psabench.boards.objects import BusObjects
from psabench.boards.registry import BOARDS
from psabench.conform.bus_host import port
from psabench.conform.capture.log import LineLog
from psabench.conform.dut import Dut
from psabench.conform.verdict import known, none_of
from psabench.link.signals import Ints

ADDRESS, DATA = tuple(f"AB{k}" for k in range(4)), tuple(f"D{k}" for k in range(16))
LINES = ("CS", "RW", *ADDRESS)
BUS = BusObjects.BUS
EACH_S = 20e-6  # that a cycle takes at the most without a strobe of its own
TAIL_S = 5e-3  # after what a recording of the lines must have: its end may lie behind the present


@dataclass(frozen=True, kw_only=True)
class Strobes:
    """n lows of CS. write: RW is low; address and data: as they stand at its end."""

    fall_ns: Ints
    rise_ns: Ints
    write: Ints
    address: Ints
    data: Ints

    def __len__(self) -> int:
        return len(self.fall_ns)

    def at(self, address: int) -> Strobes:
        """Those at one address."""
        keep = self.address == address
        return Strobes(**{f.name: getattr(self, f.name)[keep] for f in fields(self)})


def strobes(log: LineLog) -> Strobes:
    """All whole lows of CS. Raises Failed where the lines are not there."""
    none_of([n for n in (*LINES, *DATA) if n not in log], lambda name: f"no line {name}", "the lines of the bus")
    fall, rise = log.pulses("CS", 0)
    end = rise - 1

    def word(names: tuple[str, ...]) -> Ints:
        found: Ints = sum(
            (log[n].at(end).astype(np.int64) << k for k, n in enumerate(names)), np.zeros(len(end), np.int64)
        )
        return found

    write = 1 - log["RW"].at(end).astype(np.int64)
    return Strobes(fall_ns=fall, rise_ns=rise, write=write, address=word(ADDRESS), data=word(DATA))


def registers(s: Dut) -> dict[str, tuple[int, str]]:
    """Addresses and rights (ro, wo, rw) of the registers on the bus by name, as the EDS has them."""
    mine = [o for o in s.unit.node.objects() if o.index == BUS and o.sub]
    return {o.name: (o.sub - 1, o.access) for o in mine}


def harmless(s: Dut) -> tuple[int, int]:
    """Address of a register that may be written, and with what."""
    bus = _bus(s)
    address = registers(s)[bus.harmless][0]
    return address, s.unit.bus_read(address) if bus.harmless_word is None else bus.harmless_word


def quiet(s: Dut) -> int:
    """Address of a register that can be read at any time."""
    return registers(s)[_bus(s).quiet][0]


def _bus(s: Dut) -> Bus:
    return known(BOARDS[s.variant.family].bus, f"a {s.variant.family} has no parallel bus")


def say(s: Dut, *lines: str, dwell_s: float = 0.0) -> list[str]:
    """Lines all at once, and as many answers. dwell_s: that they take beyond a cycle each."""
    port(s).ask("\n".join(lines))
    if s.lockstep:
        s.run_for(len(lines) * EACH_S + dwell_s)
    return [port(s).answered() for _ in lines]


def tell(s: Dut) -> str:
    """One answer more: to a line that was sent before."""
    return port(s).answered()

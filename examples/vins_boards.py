"""A navigation computer's end of a PSD-1, PMKA or PIK, which tells what it takes as docs/conform_host.md says.

psabench conform host --board pik --command ".venv/bin/python examples/vins_boards.py pik socketcand:{can} {node}"
psabench conform host --board pik --command ".venv/bin/python examples/vins_boards.py pik {bus}"
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np
from psabench.boards.pik.device import Pik
from psabench.boards.pmka import estimate as est
from psabench.boards.pmka.device import Pmka
from psabench.boards.psd1.device import Psd1
from psabench.boards.readings import Readings
from psabench.errors import LinkError
from psabench.link.busport import BusPort
from psabench.link.can_host import CanHost, WallClock, open_bus

STATUS, FLAGS, FL2, BUS_ON = 3, 15, 0x01, 0x03  # of PSD-1: registers and bits; INT0 and FL1 active
SEQ, LATCH, PERIOD = 9, 11, 12  # of PIK
WORD = 1 << 16
ROWS = 1000  # readings that are decoded together, at most


def tell(**what: Any) -> None:
    print(json.dumps(what))


class Axes:
    """Which axes are beyond their range."""

    def __init__(self) -> None:
        self.over: set[str] = set()

    def watch(self, now: set[str]) -> None:
        for name, axes in (("over_range", now - self.over), ("in_range", self.over - now)):
            for axis in sorted(axes):
                tell(**{name: axis})
        self.over = now


def missing(seq: int, before: int | None, modulo: int) -> int:
    """Readings between two that came, told."""
    lost = 0 if before is None else (seq - before - 1) % modulo
    if lost:
        tell(lost=lost)
    return lost


class Psd1Words:
    """Words of each cycle; those of different conversions are not used."""

    def __init__(self) -> None:
        self.cnt: int | None = None

    def take(self, r: Readings) -> None:
        for i in range(len(r)):
            cnt = int(r["CNT"][i])
            missing(cnt, self.cnt, 256)
            self.cnt = cnt
            for flag in ("OVERRUN", "LATE", "MIXED"):
                if r[flag][i]:
                    tell(**{flag.lower(): 1})
            if not r["MIXED"][i]:
                tell(reading=cnt, **{a: int(r[a.upper()][i]) for a in "xyz"})

    def end(self) -> None:
        """Everything has been told."""


class PikSums:
    """Pulses since the first reading, from the totals: an increment that is lost is in the next one."""

    columns = ("PIK_TOTALS.X", "PIK_TOTALS.Y", "PIK_TOTAL_Z.Z")

    def __init__(self) -> None:
        self.axes = Axes()
        self.last: list[int] = []
        self.sums = [0, 0, 0]

    def take(self, r: Readings) -> None:
        for i in range(len(r)):
            self.axes.watch({a for a in "xyz" if r[f"SAT_{a.upper()}"][i]})
            self.add([int(r[c][i]) for c in self.columns], 1 << 32)
            tell(reading=int(r["SEQ"][i]), **dict(zip("xyz", self.sums, strict=True)))

    def add(self, totals: list[int], modulo: int) -> None:
        """Counters that wrap: the step is the one of less than half a turn."""
        before = self.last or totals
        steps = [(b - a + modulo // 2) % modulo - modulo // 2 for a, b in zip(before, totals, strict=True)]
        self.sums = [s + d for s, d in zip(self.sums, steps, strict=True)]
        self.last = totals

    def end(self) -> None:
        """Everything has been told."""


class PmkaIntegrals:
    """Volt seconds of each axis, by the article's equations, once the calibrations of a whole run are known.

    A reading that is missing or at a limit ends a run: the loss is unknown, and the next begins at 0.
    """

    def __init__(self, rom: est.Rom) -> None:
        self.rom, self.axes = rom, Axes()
        self.seq: int | None = None
        self.run: list[dict[str, float]] = []

    def take(self, r: Readings) -> None:
        for i in range(len(r)):
            row = {name: float(column[i]) for name, column in r.columns.items()}
            seq, bad = int(row["SEQ"]), int(row["SATURATED"]) | int(row["CLIPPED"])
            serves = [int(row[f"SERVES_{k}"]) for k in est.INTEGRATORS]
            over = {"xyz"[a - 1] for k, a in enumerate(serves) if a and bad >> k & 1}
            if missing(seq, self.seq, WORD) or bad:
                self.end()
            self.seq = seq
            self.axes.watch(over)
            if not bad:
                self.run.append(row)

    def end(self) -> None:
        rows, self.run = self.run, []
        try:
            columns = {name: np.array([row[name] for row in rows]) for name in rows[0]} if rows else {}
            vs = est.integrals_vs(est.periods_of(columns), self.rom) if rows else np.empty((0, 3))
        except ValueError as e:  # too short for the calibrations
            return tell(note=str(e))
        for row, (x, y, z) in zip(rows, vs.tolist(), strict=True):
            tell(reading=int(row["SEQ"]), x=x, y=y, z=z)


class Taker(Protocol):
    """What becomes of the readings."""

    def take(self, r: Readings) -> None: ...
    def end(self) -> None: ...


def on_can(board: str, address: str, node: int) -> None:
    with CanHost(open_bus(address), WallClock()) as bus:
        kind: type[Psd1 | Pmka | Pik] = Psd1 if board == "psd1" else Pmka if board == "pmka" else Pik
        unit = kind(bus, node)
        unit.serial()  # who is there
        taker: Taker = Psd1Words() if isinstance(unit, Psd1) else PikSums()
        if isinstance(unit, Pmka):
            taker = PmkaIntegrals(est.rom_of(unit.rom_words()))
        unit.frames.forget()
        unit.start()
        try:
            while True:
                bus.pump_until(lambda: len(unit.frames) >= ROWS, 0.05)
                taker.take(unit.frames.take())
                sys.stdout.flush()
        except LinkError:
            taker.take(unit.frames.take())
            taker.end()


def psd1_on_bus(port: BusPort) -> Iterable[None]:
    """Words by strobes of our own, X, Y, Z, as soon as FL2 says that one waits."""
    port.write(FLAGS, BUS_ON)
    for number in range(1 << 62):
        words = []
        for axis in range(3):
            status = 0
            while not (status & FL2 and status >> 1 & 3 == axis):
                status = port.read(STATUS).data
            words.append(port.read(axis).data)
        tell(reading=number, **dict(zip("xyz", words, strict=True)))
        yield


def pik_on_bus(port: BusPort) -> Iterable[None]:
    """Counters of 16 bits, latched when we say so, so that they are of one instant."""
    port.write(PERIOD, 0)
    sums = PikSums()
    while True:
        port.write(LATCH, 0)
        sums.add([port.read(axis).data for axis in range(3)], WORD)
        tell(reading=port.read(SEQ).data, **dict(zip("xyz", sums.sums, strict=True)))
        yield


def main() -> int:
    board, place = sys.argv[1:3]
    if len(sys.argv) > 3:
        on_can(board, place, int(sys.argv[3]))
    else:
        try:
            with BusPort(place) as port:
                for _ in (psd1_on_bus if board == "psd1" else pik_on_bus)(port):
                    sys.stdout.flush()
        except LinkError:
            pass
    tell(end=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""What PSD-1, PMKA and PIK sent: from the emulator's log, by rules of their protocol pages alone.

Written apart from `psabench.boards.readings`, so that what a host is judged by is not what our own host does.
"""

from __future__ import annotations

from dataclasses import dataclass

from psabench.conform.host.capture import XY, ZT, Bus, Frame, number, signed

FIRST, SECOND, THIRD = XY, ZT, 0x380  # TPDO 1, 2 and 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """PSD1_CYCLE."""

    cnt: int
    words: tuple[int, int, int]
    read: bool  # all three by a strobe
    overrun: bool
    late: bool
    mixed: bool


def cycles(bus: Bus) -> list[Cycle]:
    """Of PSD-1, from the first NMT start on."""
    return [
        Cycle(
            cnt=f.data[6],
            words=(number(f.data[0:2]), number(f.data[2:4]), number(f.data[4:6])),
            read=f.data[7] & 0x07 == 0x07,
            overrun=bool(f.data[7] & 0x08),
            late=bool(f.data[7] & 0x10),
            mixed=bool(f.data[7] & 0x20),
        )
        for f in _of(bus, FIRST)
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """PMKA_STATE. serves: axis 1..3 of each integrator, 0: none; bad: integrators that were saturated or clipped."""

    seq: int
    serves: tuple[int, int, int, int]
    bad: int

    @property
    def home(self) -> bool:
        """Each axis is on its own integrator, and was so for the whole period."""
        return self.serves == (1, 2, 3, 0)

    @property
    def over(self) -> frozenset[str]:
        """Axes whose integrator was at a limit."""
        return frozenset("xyz"[a - 1] for i, a in enumerate(self.serves) if a and self.bad >> i & 1)


def states(bus: Bus) -> list[State]:
    """Of PMKA, from the first NMT start on."""
    found = []
    for f in _of(bus, SECOND):
        bits = number(f.data)
        serves = tuple(bits >> (24 + 2 * i) & 3 for i in range(4))
        found.append(
            State(
                seq=bits & 0xFFFF,
                serves=(serves[0], serves[1], serves[2], serves[3]),
                bad=(bits >> 40 | bits >> 44) & 0x0F,
            )
        )
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Pulses:
    """A reading of PIK. totals: since power-up, 32 bits; over: channels that cannot keep up; told: PIK_COUNTS came."""

    seq: int
    totals: tuple[int, int, int]
    over: frozenset[str]
    told: bool


def pulses(bus: Bus) -> list[Pulses]:
    """Of PIK, from the first NMT start on; one whose PIK_COUNTS was lost is numbered after the one before."""
    found: list[Pulses] = []
    counts: Frame | None = None
    xy = (0, 0)
    for f in _after_start(bus):
        if len(f.data) != 8:
            continue
        if f.can_id == FIRST + bus.node:
            counts = f
        elif f.can_id == SECOND + bus.node:
            xy = signed(f.data[0:4]), signed(f.data[4:8])
        elif f.can_id == THIRD + bus.node:
            seq = counts.data[6] if counts else (found[-1].seq + 1) % 256 if found else 0
            over = frozenset(a for i, a in enumerate("xyz") if counts and counts.data[7] >> i & 1)
            found.append(Pulses(seq=seq, totals=(*xy, signed(f.data[0:4])), over=over, told=counts is not None))
            counts = None
    return found


def _after_start(bus: Bus) -> list[Frame]:
    begin_s = bus.starts[0] if bus.starts else float("inf")
    return [f for f in bus.frames if f.t_s > begin_s]


def _of(bus: Bus, service: int) -> list[Frame]:
    return [f for f in _after_start(bus) if f.can_id == service + bus.node and len(f.data) == 8]

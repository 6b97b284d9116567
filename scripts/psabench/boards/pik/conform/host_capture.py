"""What PIK, PIK-5 and PIK-6 sent to a host under test, from the emulator's log, by rules of its protocol page alone."""

from __future__ import annotations

from dataclasses import dataclass

from psabench.conform.host.capture import Bus, Frame, signed
from psabench.conform.host.capture_units import FIRST, SECOND, THIRD, after_start


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
    for f in after_start(bus):
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

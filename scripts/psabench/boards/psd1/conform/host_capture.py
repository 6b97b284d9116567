"""What PSD-1 sent to a host under test, from the emulator's log, by rules of its protocol page alone."""

from __future__ import annotations

from dataclasses import dataclass

from psabench.conform.host.capture import Bus, number
from psabench.conform.host.capture_units import FIRST, frames_of


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
        for f in frames_of(bus, FIRST)
    ]

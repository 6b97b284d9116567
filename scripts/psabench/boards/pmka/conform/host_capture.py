"""What PMKA sent to a host under test, from the emulator's log, by rules of its protocol page alone."""

from __future__ import annotations

from dataclasses import dataclass

from psabench.conform.host.capture import Bus, number
from psabench.conform.host.capture_units import SECOND, frames_of


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
    for f in frames_of(bus, SECOND):
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

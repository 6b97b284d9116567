"""What a unit sent, from the emulator's log, by rules of its protocol page alone: the part that all boards share.

Written apart from `psabench.boards.readings`, so that what a host is checked by is not what our own host does.
"""

from __future__ import annotations

from psabench.conform.host.capture import XY, ZT, Bus, Frame

FIRST, SECOND, THIRD = XY, ZT, 0x380  # TPDO 1, 2 and 3


def after_start(bus: Bus) -> list[Frame]:
    begin_s = bus.starts[0] if bus.starts else float("inf")
    return [f for f in bus.frames if f.t_s > begin_s]


def frames_of(bus: Bus, service: int) -> list[Frame]:
    return [f for f in after_start(bus) if f.can_id == service + bus.node and len(f.data) == 8]

"""What a unit of any board sent, by rules of its protocol page alone, and what its host must have told.

Written apart from `psabench.boards.readings`, so that what a host is checked by is not what our own host does. Checks
of one board are in boards/<name>/conform/host_checks.py.
"""

from __future__ import annotations

from psabench.conform.host.capture import XY, ZT, Bus, Frame
from psabench.conform.host.check import HostCapture
from psabench.conform.host.results import Reading
from psabench.conform.verdict import expect

FIRST, SECOND, THIRD = XY, ZT, 0x380  # TPDO 1, 2 and 3


def after_start(bus: Bus) -> list[Frame]:
    begin_s = bus.starts[0] if bus.starts else float("inf")
    return [f for f in bus.frames if f.t_s > begin_s]


def frames_of(bus: Bus, service: int) -> list[Frame]:
    return [f for f in after_start(bus) if f.can_id == service + bus.node and len(f.data) == 8]


def readings_told(e: HostCapture) -> list[Reading]:
    """Raises Failed where the host told none."""
    expect(e.streamed, f"no stream was started{e.last_words()}", "NMT start")
    expect(e.told.readings, f"no reading was reported{e.last_words()}", '{"reading": ...}')
    return e.told.readings

"""A bus that others fill: frames of the highest priority, so many that nothing else goes out meanwhile."""

from __future__ import annotations

from psabench.conform.capture.canbits import frame_bits
from psabench.conform.raw_can import Talk

FLOOD_ID, FLOOD_DATA = 0x001, bytes(range(0x55, 0x5D))
BIT_S, SPACE_BITS = 1e-6, 3  # of a bus of 1 Mbit/s; on a slower one they take longer
AHEAD, STEP_S = 60, 0.004  # frames that wait always; an emulator takes no more than 128 while its time stands still


def flood(t: Talk, dwell_s: float) -> None:
    """Fill the bus for this long, in real time for at least so long; the board's time passes."""
    frame_s = (frame_bits(FLOOD_ID, FLOOD_DATA) + SPACE_BITS) * BIT_S
    if not t.s.lockstep:
        for _ in range(round(dwell_s / frame_s)):
            t.host.send(FLOOD_ID, FLOOD_DATA)
        t.s.run_for(dwell_s)
        return
    sent, passed_s = 0, 0.0
    while passed_s < dwell_s:
        while sent < AHEAD + passed_s / frame_s:
            t.host.send(FLOOD_ID, FLOOD_DATA)
            sent += 1
        t.s.run_for(STEP_S)
        passed_s += STEP_S
    t.s.run_for(AHEAD * frame_s)

"""Scenes of PSA-2 and PSA-1."""

from __future__ import annotations

from psabench.conform.evidence import Evidence
from psabench.conform.plan import scene
from psabench.conform.subject import Subject

SETUP_S = 0.3  # Res to the first frame takes 0.19 s
STREAM_S = 0.4


@scene("power_on", boards=("psa2",))
def power_on(s: Subject) -> Evidence:
    """From Res on until frames come: the set-up on all lines, the boot-up message."""
    with s.take() as take:
        s.reset()
        take.marks["reset"] = s.bench.time_s
        s.run_for(SETUP_S)
    return s.evidence("power_on", take)


@scene("stream", boards=("psa2",))
def stream(s: Subject) -> Evidence:
    """Some hundred frames, on the lines and on CAN."""
    s.unit.wait_ready()
    with s.take() as take:
        s.unit.start()
        s.run_for(STREAM_S)
        s.unit.stop()
    return s.evidence("stream", take)

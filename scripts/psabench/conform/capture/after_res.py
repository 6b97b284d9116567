"""What came first after Res: the boot-up message, and how many readings may have passed before one was reported."""

from __future__ import annotations

from psabench.conform.capture.log import CanFrame, Evidence
from psabench.conform.verdict import TooLittle


def booted(e: Evidence, heartbeat: str) -> CanFrame:
    """The latest boot-up message. Raises TooLittle where none came."""
    log = [f for f in e.frames_of(heartbeat).frames if f.data == b"\0"]
    if not log:
        raise TooLittle("no boot-up message came after Res")
    return log[-1]


def late_readings(e: Evidence, heartbeat: str, name: str, first_s: float, period_s: float) -> int:
    """How many readings may have passed before the first that was reported, a host that starts it late being no fault.

    first_s: from Res to the first reading. The fact "prompt": the host was in time for it. Raises TooLittle.
    """
    boot = booted(e, heartbeat)
    told = [f for f in e.frames_of(name).frames if f.t_s > boot.t_s]
    if not told:
        raise TooLittle(f"no {name} came after the boot-up message")
    return 0 if e.facts.get("prompt") else max(0, round((told[0].t_s - boot.t_s - first_s) / period_s))

"""Stimuli of the receiver: from Res, and two seconds of solutions."""

from __future__ import annotations

from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut, Take
from psabench.conform.plan import stimulus
from psabench.conform.stimulus.streamed import from_res, recorded

START_S, STREAM_S = 0.5, 2.1


@stimulus("power_on", boards=("receiver",))
def power_on(s: Dut) -> Capture:
    """From Res to some solutions, streaming as soon as it has booted."""
    return from_res(s, START_S)


def until_ready(s: Dut) -> None:
    """With its first solutions after Res."""
    s.reset()
    s.run_for(START_S)


@recorded("stream", boards=("receiver",), before=until_ready, streaming=True)
def stream_for_two_seconds(s: Dut, take: Take) -> None:
    """Two seconds of solutions on CAN and on the lines."""
    s.run_for(STREAM_S)

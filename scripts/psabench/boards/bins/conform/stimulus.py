"""Stimuli of the inertial unit: from Res, and a second of readings."""

from __future__ import annotations

from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut, Take
from psabench.conform.plan import stimulus
from psabench.conform.stimulus.streamed import from_res, recorded

START_S, STREAM_S = 0.5, 1.0


@stimulus("power_on", boards=("bins",))
def power_on(s: Dut) -> Capture:
    """From Res to some readings, streaming as soon as it has booted."""
    return from_res(s, START_S)


def until_ready(s: Dut) -> None:
    """With its first readings after Res."""
    s.reset()
    s.run_for(START_S)


@recorded("stream", boards=("bins",), before=until_ready, streaming=True)
def stream_for_a_second(s: Dut, take: Take) -> None:
    """A second of readings on CAN and on the lines."""
    s.run_for(STREAM_S)

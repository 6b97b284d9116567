"""Stimuli of PIK, PIK-5 and PIK-6: from Res, a second on the lines, a minute of readings."""

from __future__ import annotations

from psabench.boards.objects import PikObjects as OD
from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut, Take
from psabench.conform.plan import stimulus
from psabench.conform.stimulus.streamed import from_res, recorded, while_streaming
from psabench.conform.verdict import conclusive

START_S, STREAM_S, MINUTE_S = 0.06, 1.0, 60.5
OFF_S = 0.02  # without power
BUS, PERIOD, SOON = OD.BUS, 0x0C, 20  # registers over CAN; 20 times 100 us
OVERDRIVE_DEG = -90.0  # there the accelerometer X gives more than its channel can follow


@stimulus("power_on", boards=("pik",))
def power_on(s: Dut) -> Capture:
    """From Res to some readings, streaming as soon as it has booted."""
    return from_res(s, START_S)


def _started(s: Dut) -> None:
    """With its first readings after Res."""
    s.reset()
    s.run_for(START_S)


@recorded("stream", boards=("pik",), before=_started, streaming=True)
def stream(s: Dut, take: Take) -> None:
    """A second of pulses and readings."""
    s.run_for(STREAM_S)


@recorded("minute", boards=("pik",), before=_started, lines=False, streaming=True)
def minute(s: Dut, take: Take) -> None:
    """A minute of readings at still inputs."""
    s.run_for(MINUTE_S)


@stimulus("overdrive", boards=("pik",))
def overdrive(s: Dut) -> Capture:
    """The accelerometer X turned by a dividing head until its channel cannot keep up, and back; a reading each 2 ms."""
    conclusive("head" in s.probes, "no dividing head was connected")
    _started(s)
    s.unit.node.write_raw(BUS, PERIOD + 1, SOON.to_bytes(2, "little"))
    head = s.bench.head
    rest_deg = head.angle_deg
    with s.take(lines=False) as take, while_streaming(s):
        head.turn(OVERDRIVE_DEG)
        s.run_for(0.2)
        with s.take() as looked:
            s.run_for(0.2)
        head.turn(rest_deg)
        s.run_for(0.4)
    take.lines = looked.lines
    _started(s)
    return s.capture("overdrive", take)


@recorded("power_cycle", boards=("pik",), before=_started)
def power_cycle(s: Dut, take: Take) -> None:
    """Readings, no power for a while, and its first periods afterwards."""
    s.power_cycle(OFF_S)
    s.run_for(START_S)

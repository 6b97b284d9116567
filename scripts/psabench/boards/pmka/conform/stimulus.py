"""Stimuli of PMKA: its start, a rotation on the lines, a minute of readings, strobes on its bus."""

from __future__ import annotations

from psabench.boards.pmka.device import Pmka
from psabench.conform.bus_host import line
from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut
from psabench.conform.plan import stimulus
from psabench.conform.requirements import requirements
from psabench.conform.stimulus.streamed import from_res, readings
from psabench.conform.verdict import Inconclusive
from psabench.link.busport import Cycle

BEAT, ZERO, RESETS = 200, 120, 78  # periods, as the board turns itself (PMKA-CAL-03)
SHORT = (40, 20, 12)  # a beat of a stimulus where the computer turns it
ROTATION, MINUTE = 5, 69  # beats; the minute begins and ends with the spare at rest, up to three beats from its ends
START_S = 0.02


def ts_s() -> float:
    return requirements()["PMKA-SAMP-01"].limit("ts_us") * 1e-6


def unit(s: Dut) -> Pmka:
    """Raises Inconclusive where it is none."""
    if not isinstance(s.unit, Pmka):
        raise Inconclusive("no PMKA")
    return s.unit


def turn(s: Dut, beats: int, lengths: tuple[int, int, int]) -> None:
    """Let beats pass; where the board leaves the calibration to the computer, be that one."""
    beat, zero, resets = lengths
    if s.variant["rotation"] != "program":
        s.run_for(beats * BEAT * ts_s())
        return
    for k in range(beats):
        tau = k % 5 + 1
        unit(s).command(tau)
        s.run_for(3 * ts_s())
        for cal, length in ((1, zero), (2, resets), (0, beat - zero - resets - 3)):
            unit(s).command(0, cal=cal)
            s.run_for(length * ts_s())


@stimulus("power_on", boards=("pmka",))
def power_on(s: Dut) -> Capture:
    """From Res to some readings, streaming as soon as it has booted."""
    return from_res(s, START_S + 6 * ts_s())


@stimulus("stream", boards=("pmka",))
def stream(s: Dut) -> Capture:
    """A rotation and some more, on the lines and on CAN."""
    return s.capture("stream", readings(s, START_S, lambda: turn(s, ROTATION + 1, SHORT)))


@stimulus("minute", boards=("pmka",))
def minute(s: Dut) -> Capture:
    """A minute of readings through many rotations, and the words of the ROM."""
    take = readings(s, START_S, lambda: turn(s, MINUTE, (BEAT, ZERO, RESETS)), lines=False)
    take.facts["rom"] = unit(s).rom_words()
    s.reset()
    s.run_for(START_S)
    return s.capture("minute", take)


@stimulus("strobes", boards=("pmka",))
def strobes(s: Dut) -> Capture:
    """Reads and writes of registers over the bus port, while readings come."""
    cycles: list[Cycle] = []

    def strobe() -> None:
        for k in range(40):
            cycles.append(line(s, f"R {k % 13 if k % 13 != 10 else 6:X} {800 + 100 * (k % 7)}"))
            cycles.append(line(s, f"W D {k % 8:X}"))
            s.run_for(0.3 * ts_s())

    take = readings(s, START_S, strobe)
    take.cycles += cycles
    return s.capture("strobes", take)

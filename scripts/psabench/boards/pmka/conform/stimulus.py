"""Stimuli of PMKA: its start, a rotation on the lines, a minute of readings, strobes on its bus."""

from __future__ import annotations

from psabench.boards.pmka.device import Pmka
from psabench.conform.bus_host import line
from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut, Take
from psabench.conform.plan import stimulus
from psabench.conform.requirements import requirements
from psabench.conform.stimulus.streamed import from_res, recorded, while_streaming
from psabench.conform.verdict import known

BEAT, ZERO, RESETS = 200, 120, 78  # periods, as the board turns itself (PMKA-CAL-03)
SHORT = (40, 20, 12)  # a beat of a stimulus where the computer turns it
ROTATION, MINUTE = 5, 69  # beats; the minute begins and ends with the spare at rest, up to three beats from its ends
START_S = 0.02


def ts_s() -> float:
    return requirements()["PMKA-SAMP-01"].limit("ts_us") * 1e-6


def unit(s: Dut) -> Pmka:
    """Raises Inconclusive where it is none."""
    return known(s.unit if isinstance(s.unit, Pmka) else None, "no PMKA")


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


def _started(s: Dut) -> None:
    """With its first readings after Res."""
    s.reset()
    s.run_for(START_S)


@recorded("stream", boards=("pmka",), before=_started, streaming=True)
def stream(s: Dut, take: Take) -> None:
    """A rotation and some more, on the lines and on CAN."""
    turn(s, ROTATION + 1, SHORT)


@stimulus("minute", boards=("pmka",))
def minute(s: Dut) -> Capture:
    """A minute of readings through many rotations, and the words of the ROM."""
    _started(s)
    with s.take(lines=False) as take, while_streaming(s):
        turn(s, MINUTE, (BEAT, ZERO, RESETS))
    take.facts["rom"] = unit(s).rom_words()
    _started(s)
    return s.capture("minute", take)


@recorded("strobes", boards=("pmka",), before=_started, streaming=True)
def strobes(s: Dut, take: Take) -> None:
    """Reads and writes of registers over the bus port, while readings come."""
    for k in range(40):
        take.cycles.append(line(s, f"R {k % 13 if k % 13 != 10 else 6:X} {800 + 100 * (k % 7)}"))
        take.cycles.append(line(s, f"W D {k % 8:X}"))
        s.run_for(0.3 * ts_s())

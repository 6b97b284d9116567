"""Stimuli of PSA-2 and PSA-1."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from psabench.conform.dut import Dut, Take
from psabench.conform.probes import PinProbe
from psabench.conform.stimulus.streamed import recorded

SETUP_S = 0.22  # Res to the first frames takes 0.19 s
STREAM_S = 0.4
PAIRS_S = 0.04
PERIOD_S, FRAME_TO_CAN_S, IN_FRAME_S, ON_BUS_S = 1e-3, 298e-6, 40e-6, 65e-6


def into_a_frame(s: Dut, take: Take, lead_s: float = 0.0) -> None:
    """Let time pass until a frame is under way on the line; only in lockstep can that be met."""
    s.run_for(10 * PERIOD_S)
    if not {"lockstep", "stamps"} <= s.probes or not take.frames:
        return
    fall_s = take.frames[-1].t_s / take.rate - FRAME_TO_CAN_S
    ahead_s = (fall_s + IN_FRAME_S - lead_s - s.bench.time_s) % PERIOD_S
    s.run_for(ahead_s)


@recorded("power_on", boards=("psa2",), before=Dut.wait_ready, streaming=True)
def power_on(s: Dut, take: Take) -> None:
    """Res in the middle of a frame, then until frames come: the set-up on all lines, boot-up, the first frames."""
    into_a_frame(s, take, ON_BUS_S)
    take.marks["reset"] = s.bench.time_s
    s.reset()
    s.run_for(0.01)
    s.unit.start()
    s.run_for(SETUP_S)


@recorded("power_cycle", boards=("psa2",), before=Dut.wait_ready, streaming=True)
def power_cycle(s: Dut, take: Take) -> None:
    """The supply off in the middle of a frame, and on again until frames come."""
    s.run_for(0.03)
    into_a_frame(s, take)
    take.marks["off"] = s.bench.time_s
    s.power_cycle(0.02)
    take.marks["on"] = s.bench.time_s
    s.run_for(0.01)
    s.unit.start()
    s.run_for(SETUP_S)


@recorded("stream", boards=("psa2",), before=Dut.wait_ready, streaming=True)
def stream(s: Dut, take: Take) -> None:
    """Some hundred frames, on the lines and on CAN."""
    s.run_for(STREAM_S)


@contextmanager
def _with_wires(s: Dut) -> Iterator[None]:
    """The probe has the wires of the pairs, too."""
    assert isinstance(s.probe, PinProbe)
    s.probe.pairs = True
    try:
        yield
    finally:
        s.probe.pairs = False


@recorded("pairs", boards=("psa2",), before=Dut.wait_ready, around=_with_wires, streaming=True)
def stream_with_wires(s: Dut, take: Take) -> None:
    """Some frames, with the wires of the pairs."""
    s.run_for(PAIRS_S)

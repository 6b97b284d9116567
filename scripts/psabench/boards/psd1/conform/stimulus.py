"""Stimuli of PSD-1: its set-up, its cycles, all its messages, strobes of another host."""

from __future__ import annotations

from dataclasses import replace

from psabench.boards.psd1.conform.host import (
    calm,
    has_host,
    kept_coefficients,
    messages_on,
    period_s,
    run_cycles,
    setup_s,
    word,
)
from psabench.conform.bus_host import line
from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut, Take
from psabench.conform.plan import stimulus
from psabench.conform.stimulus.streamed import from_res, recorded, while_streaming

CYCLES = 24  # of a stimulus
MANY, FAST_S = 1030, 0.002  # readings that a noise wants; a word sooner than that


@stimulus("power_on", boards=("psd1",))
def power_on(s: Dut) -> Capture:
    """From Res to the first cycles, streaming as soon as it has booted. facts: coefficients, as objects.

    Set up before: what moves in an earlier set-up would be taken for what follows Res.
    """
    calm(s)
    e = from_res(s, setup_s(s.variant))
    return replace(e, facts={**e.facts, "coefficients": kept_coefficients(s)})


@recorded("stream", boards=("psd1",), before=calm, streaming=True)
def stream(s: Dut, take: Take) -> None:
    """Cycles as the built-in host reads them, or as we do over the bus where there is none."""
    run_cycles(s, CYCLES)


@recorded("words", boards=("psd1",), before=calm, lines=False, streaming=True)
def words(s: Dut, take: Take) -> None:
    """A thousand words at still inputs where the board reads them itself and is not slow, a few elsewhere."""
    fast = has_host(s.variant) and period_s(s.variant) < FAST_S
    run_cycles(s, MANY if fast else 2 * CYCLES)


@stimulus("messages", boards=("psd1",))
def messages(s: Dut) -> Capture:
    """The same with all messages switched on, and the objects that they map read afterwards."""
    calm(s)
    with s.take() as take, while_streaming(s):
        run_cycles(s, 3)
        s.unit.stop()
        take.marks["on"] = s.bench.time_s
        take.facts["before"] = len(take.frames)
        messages_on(s, True)
        s.unit.start()
        run_cycles(s, CYCLES)
    messages_on(s, False)
    return s.capture("messages", take)


@stimulus("strobes", boards=("psd1",))
def strobes(s: Dut) -> Capture:
    """Reads of STATUS, and reads and writes of registers, all through some cycles; words are left waiting."""
    calm(s)
    own = has_host(s.variant)
    with s.take() as take:
        if not own:
            line(s, "W F 0003")
        for k in range(CYCLES * 4):
            take.cycles.append(line(s, f"R 3 {1000 + 700 * (k % 23)}"))
            if k % 6 == 0:
                take.cycles.append(line(s, f"W D {0x5A5A ^ k * 0x0421 & 0xFFFF:04X}"))
                take.cycles.append(line(s, "R D"))
            if k % 8 == 7 and not own:
                take.cycles.append(word(s, k // 8 % 3))
    if not own:
        calm(s)
    return s.capture("strobes", take)

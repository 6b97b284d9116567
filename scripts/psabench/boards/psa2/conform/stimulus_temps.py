"""Stimuli of the temperature converter of PSA-2 and PSA-1: silenced, calibrated, beside a chamber's temperature."""

from __future__ import annotations

from psabench.boards.objects import Psa2Objects as OD
from psabench.boards.psa2.conform.stimulus import PERIOD_S
from psabench.boards.psa2.conform.stimulus_can import (
    ACCEL,
    CONFIG0,
    FORM,
    OPCODE,
    RATES_HZ,
    SETTLE_PERIODS,
    TEMP,
    ask,
    changed,
    counters,
    cut,
    tell,
)
from psabench.conform.dut import Dut, Take
from psabench.conform.stimulus.streamed import recorded, while_streaming

HISTORY, HISTORY_LOOKS = OD.ERROR_HISTORY, 4


@recorded("trouble", boards=("psa2",), around=changed)
def trouble(s: Dut, take: Take) -> None:
    """The temperature converter silenced by its SYNC command without WAKEUP, a form rejected before it: two codes.

    facts: access, counters, history of errors.
    """
    _refused_form(s)
    take.facts["before"] = counters(s)
    cut(take, "stream")
    with while_streaming(s):
        s.run_for(20 * PERIOD_S)
        cut(take, "silent")
        take.facts["opcode"] = tell(s, OPCODE, 2, 0xFC)
        take.facts["access"] = ask(s, TEMP, 1)
        s.run_for(0.3)
    take.facts["after"] = counters(s, after=True)
    cut(take, "silent end")
    take.facts["history"] = [ask(s, HISTORY, sub) for sub in range(1, 1 + HISTORY_LOOKS)]


def _refused_form(s: Dut) -> None:
    """An emergency of another kind: pairs at 4000 SPS, asked for and rejected, then everything as it was."""
    tell(s, FORM, 0, 1)
    tell(s, ACCEL[0], CONFIG0, 0x46 | 4 << 3)
    s.run_for(SETTLE_PERIODS / RATES_HZ[4])
    tell(s, FORM, 0, 0)
    tell(s, ACCEL[0], CONFIG0, 0x46 | 2 << 3)
    s.run_for(SETTLE_PERIODS / RATES_HZ[2])
    tell(s, FORM, 0, 0)


@recorded("selfcal", boards=("psa2",), around=changed, lines=False)
def selfcal(s: Dut, take: Take) -> None:
    """SELFCAL to the temperature converter while it is scanned. Cuts "before", "selfcal"."""
    cut(take, "before")
    with while_streaming(s):
        s.run_for(0.08)
        cut(take, "selfcal")
        take.facts["opcode"] = tell(s, OPCODE, 2, 0xF0)
        s.run_for(0.15)


@recorded("chamber", boards=("psa2",), before=Dut.wait_ready, lines=False)
def chamber(s: Dut, take: Take) -> None:
    """Temperature codes beside the temperature of the chamber. facts: temp_degc."""
    take.facts["temp_degc"] = s.bench.chamber.temp_degc
    with while_streaming(s):
        s.run_for(0.1)

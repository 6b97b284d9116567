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
from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut
from psabench.conform.plan import stimulus
from psabench.conform.stimulus.streamed import while_streaming

HISTORY, HISTORY_LOOKS = OD.ERROR_HISTORY, 4


@stimulus("trouble", boards=("psa2",))
def trouble(s: Dut) -> Capture:
    """The temperature converter silenced by its SYNC command without WAKEUP, a form rejected before and after it.

    facts: access, counters, history of errors.
    """
    with changed(s), s.take() as take:
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
        _refused_form(s)
        take.facts["history"] = [ask(s, HISTORY, sub) for sub in range(1, 1 + HISTORY_LOOKS)]
    return s.capture("trouble", take)


def _refused_form(s: Dut) -> None:
    """An emergency of another kind: pairs at 4000 SPS, asked for and rejected, then everything as it was."""
    tell(s, FORM, 0, 1)
    tell(s, ACCEL[0], CONFIG0, 0x46 | 4 << 3)
    s.run_for(SETTLE_PERIODS / RATES_HZ[4])
    tell(s, FORM, 0, 0)
    tell(s, ACCEL[0], CONFIG0, 0x46 | 2 << 3)
    s.run_for(SETTLE_PERIODS / RATES_HZ[2])
    tell(s, FORM, 0, 0)


@stimulus("selfcal", boards=("psa2",))
def selfcal(s: Dut) -> Capture:
    """SELFCAL to the temperature converter while it is scanned. Cuts "before", "selfcal"."""
    with changed(s), s.take(lines=False) as take:
        cut(take, "before")
        with while_streaming(s):
            s.run_for(0.08)
            cut(take, "selfcal")
            take.facts["opcode"] = tell(s, OPCODE, 2, 0xF0)
            s.run_for(0.15)
    return s.capture("selfcal", take)


@stimulus("chamber", boards=("psa2",))
def chamber(s: Dut) -> Capture:
    """Temperature codes beside the temperature of the chamber. facts: temp_degc."""
    s.wait_ready()
    with s.take(lines=False) as take:
        take.facts["temp_degc"] = s.bench.chamber.temp_degc
        with while_streaming(s):
            s.run_for(0.1)
    return s.capture("chamber", take)

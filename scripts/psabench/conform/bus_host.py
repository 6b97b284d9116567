"""Cycles on a board's parallel bus, one after the other, without waiting longer than a cycle needs."""

from __future__ import annotations

from collections.abc import Callable

from psabench.conform.dut import Dut
from psabench.conform.verdict import Failed, known
from psabench.errors import DeviceError
from psabench.link.busport import BusPort, Cycle

SHORT_S = 50e-6  # a cycle and some more


def port(s: Dut) -> BusPort:
    """Raises Inconclusive where there is none."""
    return known(s.port, "no bus port was connected (--bus-port)")


def line(s: Dut, text: str) -> Cycle:
    """The cycle of a line to the bus port: "R 3", "W F 0003 400". Raises CycleRefused."""
    return burst(s, text)[0]


def burst(s: Dut, *lines: str) -> list[Cycle]:
    """Cycles as close as can be: all lines at once where time passes by itself, a moment for each in lockstep."""
    if not s.lockstep:
        port(s).ask("\n".join(lines))
    found = []
    for text in lines:
        if s.lockstep:
            port(s).ask(text)
            s.run_for(SHORT_S + _strobe_s(text))
        answer = port(s).answer()
        if not isinstance(answer, Cycle):
            raise Failed(f"{answer} as the answer to {text!r}", "that of a cycle")
        found.append(answer)
    return found


def _strobe_s(text: str) -> float:
    """That a line asks for: the word behind address and data."""
    words = text.split()
    at = 2 if words[0] == "R" else 3
    return int(words[at]) * 1e-9 if len(words) > at else 0.0


def refused(action: Callable[[], object], code: float, what: str) -> None:
    """An action that must be rejected with this abort code. Raises Failed."""
    due = f"a refusal with {int(code):08X}h"
    try:
        done = action()
    except DeviceError as e:
        if e.abort_code != int(code):
            raise Failed(f"{what}: {e}", due) from e
        return
    raise Failed(f"{what}: carried out, {done}" if isinstance(done, Cycle) else f"{what}: carried out", due)


def line_refused(s: Dut, text: str, code: float) -> None:
    """A line to the bus port that must be rejected with this abort code. Raises Failed."""
    refused(lambda: line(s, text), code, text)

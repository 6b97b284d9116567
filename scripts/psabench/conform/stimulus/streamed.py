"""What stimuli of boards that send readings have in common: from Res to some readings, and a while of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut, Take

BOOT_S = 0.002


@contextmanager
def while_streaming(s: Dut) -> Iterator[None]:
    """Readings flow within."""
    s.unit.start()
    yield
    s.unit.stop()


def from_res(s: Dut, dwell_s: float) -> Capture:
    """The stimulus power_on: Res, and readings from as soon as it has booted.

    facts: prompt, in lockstep alone: the start came before the first reading.
    """
    with s.take() as take:
        take.facts["prompt"] = s.lockstep
        s.reset()
        s.run_for(BOOT_S)
        with while_streaming(s):
            s.run_for(dwell_s)
    return s.capture("power_on", take)


def readings(s: Dut, begun_s: float, pass_time: Callable[[], object], *, lines: bool = True) -> Take:
    """Readings after a Res and begun_s while pass_time lets time pass."""
    s.reset()
    s.run_for(begun_s)
    with s.take(lines=lines) as take, while_streaming(s):
        pass_time()
    return take

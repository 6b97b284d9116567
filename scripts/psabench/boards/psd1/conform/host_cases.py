"""PSD-1 as a host meets it: on CAN, and on the parallel bus through a bus port."""

from __future__ import annotations

from psabench.conform.host.cases_can import NODE, Case
from psabench.conform.host.cases_units import scenario
from psabench.conform.host.check import limits
from psabench.conform.host.stimulus import HostBench

BUS = ("bus",)


def _lost_cycles(s: HostBench) -> None:
    """1, 2 and 100 of PSD1_CYCLE do not arrive."""
    for frames in (1, 2, 100):
        s.run(0.1)
        s.fault("link.drop", "a.can", frames=frames, can_id=0x180 + NODE)
    s.run(0.3)


def _strobed(s: HostBench) -> None:
    """The bench strobes the words itself: in time, late, after the next conversion, and for a while not at all."""
    late_s = 1.5e-6 * float(limits("HOST-PSD1-02").limit("late_us"))
    s.run(0.2)
    _cycle(s, write=15, data=3)  # INT0 and FL1
    for _ in range(40):  # until what is read goes out: the host has started the stream
        before = s.sent()
        _strobe(s, 20)
        s.run(0.05)
        if s.sent() - before >= 20:
            break
    for wait_s in (0.0, late_s, 0.0, 0.002, 0.0, late_s, 0.0) * 3:
        for axis in range(3):
            _await_word(s, axis)
            if axis == 1:
                s.run(wait_s, speed=0.0)
            _cycle(s, read=axis)
    s.run(0.02)
    _strobe(s, 20)


def _strobe(s: HostBench, cycles: int) -> None:
    """Words read as soon as they wait."""
    for _ in range(cycles):
        for axis in range(3):
            _await_word(s, axis)
            _cycle(s, read=axis)


def _cycle(s: HostBench, *, read: int | None = None, write: int = 0, data: int = 0) -> int:
    if read is not None:
        return int(s.control.call("bus.read", unit="a", address=read).result["data"])
    s.control.call("bus.write", unit="a", address=write, data=data)
    return data


def _await_word(s: HostBench, axis: int) -> None:
    for _ in range(5000):
        status = _cycle(s, read=3)
        if status & 1 and status >> 1 & 3 == axis:
            return
        s.run(0.000005, speed=0.0)


CASES = (
    Case(
        name="psd1_good",
        title="a good board, over the wraps of CNT",
        play=lambda s: s.run(1.0),
        boards=("psd1",),
        scenario=scenario(),
        ends=True,
    ),
    Case(
        name="psd1_lost",
        title="1, 2 and 100 cycles are lost",
        play=_lost_cycles,
        boards=("psd1",),
        scenario=scenario(),
    ),
    Case(
        name="psd1_flags",
        title="words read late, after the next conversion, and not at all",
        play=_strobed,
        boards=("psd1",),
        profile="psd1_host",
        scenario=scenario(),
        busy=0,
    ),
    Case(
        name="psd1_bus",
        title="words that wait for the strobe of the host",
        play=lambda s: s.serve(0.05, cycle_s=4e-6),
        boards=("psd1",),
        scenario=scenario(),
        links=BUS,
        ends=True,
    ),
)

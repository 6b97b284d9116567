"""PIK, PIK-5 and PIK-6 as a host meets it: on CAN, and on the parallel bus through a bus port."""

from __future__ import annotations

from psabench.conform.host.cases_can import NODE, Case
from psabench.conform.host.cases_units import scenario
from psabench.conform.host.check import limits
from psabench.conform.host.stimulus import HostBench

PIKS = ("pik", "pik5", "pik6")
NEAR_RANGE_V = float(limits("HOST-PIK-02").limit("input_v"))
BEYOND_V = float(limits("HOST-PIK-03").limit("input_v"))
BUS = ("bus",)


def _pik_lost(s: HostBench) -> None:
    """Increments are lost with their frames: one, two in a row, thirty."""
    for frames in (1, 2, 30):
        s.run(0.3)
        s.fault("link.drop", "a.can", frames=frames, can_id=0x180 + NODE)
    s.run(1.0)


def _pik_over(s: HostBench) -> None:
    for axis in "xyz":
        for sign in (1, -1):
            s.fault("sensor.stuck", f"a.sensor.{axis}", out_v=sign * BEYOND_V)
            s.run(0.6)
            s.clear()
            s.run(0.6)


CASES = (
    Case(
        name="pik_lost",
        title="increments are lost with their frames",
        play=_pik_lost,
        boards=PIKS,
        scenario=scenario(),
        busy=12,
        ends=True,
    ),
    Case(
        name="pik_over",
        title="each channel beyond its range, both ways",
        play=_pik_over,
        boards=PIKS,
        scenario=scenario(),
        busy=12,
    ),
    Case(
        name="pik_bus",
        title="a minute at 9 V by registers of 16 bits",
        play=lambda s: s.serve(float(limits("HOST-PIK-02").limit("duration_s")), cycle_s=0.0005, leap_s=0.1),
        boards=PIKS,
        scenario=scenario((NEAR_RANGE_V, -NEAR_RANGE_V, NEAR_RANGE_V / 2)),
        links=BUS,
        ends=True,
    ),
)

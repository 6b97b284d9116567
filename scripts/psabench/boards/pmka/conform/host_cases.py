"""PMKA as a host meets it: on CAN, and on the parallel bus through a bus port."""

from __future__ import annotations

from psabench.conform.host.cases_can import STREAM, Case
from psabench.conform.host.cases_units import INPUT_V, scenario
from psabench.conform.host.check import limits
from psabench.conform.host.stimulus import HostBench

ROM_S = 30.0  # simulated, for a host to read the correction ROM word by word
COLD_DEGC = float(limits("HOST-PMKA-02").limit("cold_degc"))
WARM_DEGC = float(limits("HOST-PMKA-01").limit("warm_degc"))


def _minute(s: HostBench) -> None:
    """And as long before and after as the rotation takes to bring every axis back to its own integrator."""
    s.run(float(limits("HOST-PMKA-01").limit("duration_s")) + 6.0, speed=0.0)


def _pmka_lost(s: HostBench) -> None:
    for readings in (1, 3):
        s.run(0.5)
        s.run_between()
        s.fault("link.drop", "a.can", frames=2 * readings, **STREAM)
    s.run(0.5)
    s.fault("sensor.stuck", "a.sensor.x", out_v=float(limits("HOST-PMKA-03").limit("input_v")))
    s.run(0.5)
    s.clear()
    s.run(0.5)


CASES = (
    Case(
        name="pmka_warm",
        title="a minute of rotation at 45 °C",
        play=_minute,
        boards=("pmka",),
        scenario=scenario(degc=WARM_DEGC),
        busy=15,
        ready_s=ROM_S,
    ),
    Case(
        name="pmka_cold",
        title="a minute of rotation at -10 °C, inputs the other way round",
        play=_minute,
        boards=("pmka",),
        scenario=scenario((-INPUT_V[0], -INPUT_V[1], -INPUT_V[2]), COLD_DEGC),
        busy=15,
        ready_s=ROM_S,
    ),
    Case(
        name="pmka_lost",
        title="readings are lost, an input is beyond the range",
        play=_pmka_lost,
        boards=("pmka",),
        scenario=scenario(),
        busy=15,
        ready_s=ROM_S,
        ends=True,
    ),
)

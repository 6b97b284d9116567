"""Tests of a converter board with the fixture `bench`. docs/tools/pytest.md."""

import pytest
from psabench import Bench


@pytest.mark.scenario("quiet", seed=7)
def test_x_on_the_head_turned_by_90_deg(bench: Bench) -> None:
    bench.unit.wait_ready()
    bench.head.turn(90.0)
    bench.wait(0.1)  # the filters settle
    assert bench.unit.stream(10).axis("x").mean() == pytest.approx(1.5, abs=1e-3)


@pytest.mark.scenario("stream", seed=7)
def test_halves_of_samples_that_a_gateway_loses_are_counted(bench: Bench) -> None:
    bench.unit.wait_ready()
    bench.fault("link.drop", "bus.can0", can_id=0x285, frames=3)
    bench.unit.stream(20)
    assert bench.unit.frames.counters.torn == 3

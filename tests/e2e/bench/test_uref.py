"""UREF of a PSA-2 and the bench's supply, common mode at its converters: what a host reads over CAN."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from psabench import Bench
from psabench.boards.psa2.device import Psa2

pytestmark = pytest.mark.host

SCENARIO = """\
seed: 3
supply: {volt_v: 12, brownout_v: 9}
units:
  - name: a
    board: psa2
    adc_noise_scale: 0
    temp_noise_scale: 0
    profile_set: {uref_ppm_per_pct: 2, uref_dropout_ratio: 0.85, common_mode_v: [0, 1.0, -1.0]}
    axes: {x: {sensor: mems, u0_v: 5}, y: {sensor: mems, u0_v: 5}, z: {sensor: mems, u0_v: 5}}
"""
FILTER = 1.000169  # gain of the published filter (docs/boards/psa2.md)
CODE_V = 1.2e-6


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    scenario = tmp_path / "uref.yaml"
    scenario.write_text(SCENARIO)
    with Bench.start(scenario) as b:
        b.unit.wait_ready()
        yield b


def volts(b: Bench) -> list[float]:
    b.wait(0.1)
    assert isinstance(b.unit, Psa2)
    return [float(v) for v in b.unit.stream(10).u_v.mean(axis=0)]


@pytest.mark.parametrize(
    ("supply_v", "uref"),
    [(12.0, 1.0), (12.6, 1 + 10e-6), (10.8, 1 - 20e-6), (10.2, 1 - 30e-6), (9.6, (1 - 40e-6) * 0.8 / 0.85)],
)
def test_codes_are_relative_to_what_the_supply_leaves_of_uref(supply_v: float, uref: float, bench: Bench) -> None:
    bench.supply.set(supply_v)
    assert volts(bench)[0] == pytest.approx(5 * FILTER / uref, abs=2 * CODE_V)


def test_a_common_mode_beyond_the_range_is_counted(bench: Bench) -> None:
    """0.3125 V of signal on each input: 1.3125 V is beyond 1.25 V, -1.3125 V is not beyond -1.8 V."""
    _, y, z = volts(bench)
    assert y == pytest.approx(4.5 * FILTER, abs=2 * CODE_V)
    assert z == pytest.approx(5 * FILTER, abs=2 * CODE_V)
    counters = bench.control.call("counters", unit="a").result
    assert counters["adc_y"]["range_exceeded"] > 100
    assert counters["adc_x"]["range_exceeded"] == counters["adc_z"]["range_exceeded"] == 0

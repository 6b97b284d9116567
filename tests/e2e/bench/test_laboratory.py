"""The instruments of `psabench.instruments` on the emulator: each setting, each reading, each refusal, in lockstep."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from psabench import Bench
from psabench.errors import BenchError, InstrumentError, TimeOut
from psabench.estimate.face import Face

pytestmark = pytest.mark.host

SITE_G_MPS2 = 9.8094
LABORATORY = f"""\
seed: 3
site: {{g_mps2: {SITE_G_MPS2}}}
head: {{resolution_arcsec: 0, setting_error_arcsec_rms: 0, periodic_arcsec: 0, mount_error_arcsec_rms: 0, turn_s: 0.25}}
table: {{axes: 2}}
chamber: {{start_degc: 25, ramp_k_per_min: 10}}
supply: {{volt_v: 12, slew_v_per_s: 100, brownout_v: 9, hysteresis_v: 0.5}}
units:
  - {{name: a, on: table, axes: {{x: {{sensor: mems, u0_v: 2.5, kx_v_per_g: 1.0}}}}}}
"""


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    scenario = tmp_path / "laboratory.yaml"
    scenario.write_text(LABORATORY)
    with Bench.start(scenario) as b:
        yield b


def test_all_of_them_are_there_and_say_what_they_are(bench: Bench) -> None:
    models = [i.identity.split(",")[1] for i in (bench.head, bench.table, bench.chamber, bench.supply)]
    assert len(set(models)) == 4


def test_the_head_turns_as_long_as_it_takes(bench: Bench) -> None:
    assert bench.head.turn(45.0) == pytest.approx(45.0, abs=1e-9)
    assert 0.25 <= bench.time_s <= 0.25 + bench.head.poll_s
    bench.head.mount(Face.SIDE)
    assert bench.head.face is Face.SIDE


def test_a_table_goes_to_an_angle_and_stands_there(bench: Bench) -> None:
    bench.table.position(30.0, rate_dps=20.0)
    bench.table.position(-10.0, axis=2)
    for axis, angle_deg in ((1, 30.0), (2, -10.0)):
        s = bench.table.read(axis=axis)
        assert (s.mode, s.at_rest) == ("position", True)
        assert s.angle_deg == pytest.approx(angle_deg, abs=1e-3)
        assert s.rate_dps == pytest.approx(0.0, abs=1e-3)
    assert bench.time_s > 1.5  # 30 deg at 20 deg/s at most


def test_a_table_turns_at_a_rate_that_the_unit_feels(bench: Bench) -> None:
    bench.table.rate(90.0)
    bench.wait(5.0)
    assert bench.table.rate_dps() == pytest.approx(90.0, abs=0.01)
    w_radps = bench.truth_state()["unit"]["w_radps"]
    assert math.hypot(*w_radps) == pytest.approx(math.radians(90.0), rel=1e-6)
    from_deg = bench.table.angle_deg()
    bench.wait(0.5)
    assert bench.table.angle_deg() - from_deg == pytest.approx(45.0, abs=0.01)
    assert not bench.table.read().at_rest
    with pytest.raises(TimeOut, match=r"rest of axis 1 not reached within 0\.3 s"):
        bench.table.wait_rest(limit_s=0.3)
    bench.table.stop()
    assert bench.table.read().at_rest


def test_a_table_swings_and_runs_through_rates(bench: Bench) -> None:
    bench.table.sine(2.0, 0.5)
    angles_deg = []
    for _ in range(40):
        bench.wait(0.1)
        angles_deg.append(bench.table.angle_deg())
    assert max(angles_deg[20:]) == pytest.approx(2.0, abs=0.1)
    assert min(angles_deg[20:]) == pytest.approx(-2.0, abs=0.1)
    bench.table.stop()
    start_deg = bench.table.angle_deg()
    bench.table.profile([1.0, 2.0, 3.0], [10.0, 10.0, 0.0])
    bench.wait(4.0)
    assert bench.table.read().mode == "profile"
    assert bench.table.angle_deg() - start_deg == pytest.approx(5.0 + 10.0 + 5.0, abs=0.01)


def test_a_zero_moves_the_readout_and_not_the_table(bench: Bench) -> None:
    bench.table.position(10.0)
    before = bench.truth_state()["unit"]["f_mps2"]
    bench.table.zero(100.0)
    assert bench.table.angle_deg() == pytest.approx(100.0, abs=1e-3)
    assert bench.truth_state()["unit"]["f_mps2"] == before


def test_a_chamber_ramps_to_its_set_point(bench: Bench) -> None:
    bench.chamber.ramp(5.0)
    assert bench.chamber.ramp_k_per_min == 5.0
    bench.chamber.set(30.0)
    assert bench.chamber.setpoint_degc == 30.0
    assert not bench.chamber.stable
    bench.wait(30.0)
    assert bench.chamber.temp_degc == pytest.approx(27.5, abs=0.1)
    bench.chamber.wait_stable(limit_s=3600.0)
    assert bench.chamber.temp_degc == pytest.approx(30.0, abs=0.5)
    assert bench.status().temp_degc == pytest.approx(30.0, abs=0.5)


def test_a_supply_feeds_the_boards_and_does_not(bench: Bench) -> None:
    bench.unit.wait_ready()
    bench.supply.set(12.5)
    bench.wait(0.2)
    assert bench.supply.volt_v == 12.5
    assert bench.supply.measured_v == pytest.approx(12.5, abs=0.05)
    from_s = bench.time_s
    bench.supply.set(5.0)
    assert bench.run_until("POWER_DOWN", limit_s=1.0) - from_s == pytest.approx(0.035, abs=1e-6)  # 3.5 V at 100 V/s
    bench.supply.set(12.0)
    bench.run_until("POWER_UP", limit_s=1.0)
    bench.unit.wait_ready()
    bench.supply.output(False)
    assert not bench.supply.is_on
    bench.wait(0.2)
    assert bench.supply.measured_v == pytest.approx(0.0, abs=0.01)
    bench.supply.output(True)
    bench.wait(0.2)
    bench.supply.ripple(0.1, 50.0)
    seen_v = set()
    for _ in range(20):
        bench.wait(0.003)
        seen_v.add(bench.supply.measured_v)
    assert 0.1 < max(seen_v) - min(seen_v) < 0.3


REFUSED: list[tuple[Callable[[Bench], object], int, str]] = [
    (lambda b: b.head.turn(1e6), -222, "angle_deg"),
    (lambda b: b.table.rate(1e9), -222, "rate_dps"),
    (lambda b: b.table.rate(1.0, axis=3), -114, "axis"),
    (lambda b: b.chamber.set(1000.0), -222, "temp_degc"),
    (lambda b: b.supply.set(-1.0), -222, "volt_v"),
    (lambda b: b.supply.write("VOLT 5 M"), -131, "volt_v"),
    (lambda b: b.table.write("FROBNICATE"), -113, "FROBNICATE"),
    (lambda b: b.table.query("FROBNICATE?"), -113, "FROBNICATE"),
]


@pytest.mark.parametrize(("call", "number", "says"), REFUSED)
def test_a_refusal_is_raised_where_it_was_asked_and_changes_nothing(
    bench: Bench, call: Callable[[Bench], object], number: int, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("psabench.instruments.REPLY_S", 1.0)  # a question that is not understood has no answer
    before = bench.truth_state()
    with pytest.raises(InstrumentError, match=says) as refused:
        call(bench)
    assert refused.value.number == number
    assert bench.truth_state() == before
    bench.supply.set(12.0)  # nothing is left in a queue


def test_what_a_scenario_has_not_is_said() -> None:
    with (
        Bench.start("quiet") as b,
        pytest.raises(BenchError, match="bench: no table: the scenario has no section table"),
    ):
        _ = b.table

"""Other sensors on the board of a bench that runs: to the bit those of a bench that was started with them."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from psabench import Bench
from psabench.errors import BenchError
from psabench.native.quartz_model import Readings, Schedule
from psabench.quartz import run_in, run_in_wire
from psabench.quartz.batch import QUANTITIES, load_batch
from psabench.quartz.run_in import RunIn
from scipy import stats

pytestmark = pytest.mark.host

WHAT = RunIn(schedule=Schedule(cycles=1), batch=load_batch(), seed=3)
UNITS = 12


def exact_head(serial: int) -> dict[str, Any]:
    """The unit on a head without errors: they differ from fork to fork."""
    found = run_in_wire.make_scenario(WHAT, serial)
    found["head"]["setting_error_arcsec_rms"] = 0
    return found


def course(bench: Bench) -> list[tuple[float, list[float]]]:
    """Instants and what the sensors give at two angles, through a thermal cycle without power."""
    found = []
    for degc in (30.0, -60.0, 30.0, 85.0, 30.0):
        bench.supply.output(False)
        run_in_wire.bring_chamber(bench, degc)
        bench.wait_away(3600.0)
        bench.supply.output(True)
        for angle_deg in (270.0, 0.0):
            bench.head.turn(angle_deg)
            bench.wait_away(1.0)
            found.append((bench.time_s, bench.truth_state()["unit"]["sensor_a"]))
    return found


@pytest.mark.parametrize("on", [True, False], ids=["on", "off"])
def test_sensors_are_to_the_bit_those_of_a_start_with_their_number(on: bool) -> None:
    """Exchanged under power they have been started once; without, their first start is yet to come."""
    with run_in_wire.start_bench(exact_head(1), WHAT.seed) as bench:
        bench.supply.output(on)
        bench.exchange_sensors(9)
        bench.supply.output(True)
        axes, exchanged = bench.truth()["units"]["a"]["axes"], course(bench)
    with run_in_wire.start_bench(exact_head(9), WHAT.seed) as bench:
        assert bench.truth()["units"]["a"]["axes"] == axes
        assert course(bench) == exchanged


def test_sensors_from_the_shelf_have_no_cycle_and_no_play_of_this_chamber() -> None:
    """After a cycle: as new as a start, but for the time."""
    with run_in_wire.start_bench(exact_head(1), WHAT.seed) as bench:
        for degc in (-60.0, 85.0, 40.0, 30.0):
            run_in_wire.bring_chamber(bench, degc)
            bench.wait_away(4 * 3600.0)
        bench.exchange_sensors(9)
        late = course(bench)
    with run_in_wire.start_bench(exact_head(9), WHAT.seed) as bench:
        bench.wait_away(2.0)
        early = course(bench)
    for a, b in zip(late, early, strict=True):
        np.testing.assert_allclose(a[1], b[1], rtol=0, atol=1e-14)  # 1e-11 g: what is left of the lags after 4 h


def test_a_child_with_other_sensors_is_saved_and_restored(tmp_path: Path) -> None:
    path = tmp_path / "child.snapshot"
    with run_in_wire.start_bench(run_in_wire.make_scenario(WHAT), WHAT.seed) as bench:
        bench.unit.wait_ready()
        with bench.fork(seed=5) as child:
            child.exchange_sensors(7)
            child.run_for(0.1)
            child.snapshot(path)
            truth, goes_on = child.truth()["units"], child.unit.stream(30).u_v
    with Bench.restore(path) as again:
        assert again.truth()["units"] == truth
        assert truth["a"]["sensors_serial"] == 7
        assert np.array_equal(again.unit.stream(30).u_v, goes_on)


REFUSALS: list[tuple[str, Mapping[str, object], str]] = [
    ("no batch", {"spread": {}}, "its sensors are of no batch: expected spread: true"),
    ("moving", {"moving": True}, "the chamber is on its way to its set point"),
    ("fault", {"fault": True}, "one of its sensors has a fault"),
]


@pytest.mark.parametrize(("changes", "words"), [r[1:] for r in REFUSALS], ids=[r[0] for r in REFUSALS])
def test_what_cannot_be_exchanged_is_refused_and_stays(changes: Mapping[str, object], words: str) -> None:
    scenario = run_in_wire.make_scenario(WHAT)
    scenario["spread"] = changes.get("spread", scenario["spread"])
    with run_in_wire.start_bench(scenario, WHAT.seed) as bench:
        if "moving" in changes:
            bench.chamber.set(40.0)
        if "fault" in changes:
            bench.fault("sensor.stuck", "a.sensor.x")
        was = bench.truth()
        with pytest.raises(BenchError, match=words):
            bench.exchange_sensors(9)
        assert bench.truth() == was


def test_a_number_that_no_sensor_has_is_refused() -> None:
    with run_in_wire.start_bench(run_in_wire.make_scenario(WHAT), WHAT.seed) as bench:
        for serial in (0, 2**32):
            with pytest.raises(BenchError, match="serial: expected 1 to 4294967295"):
                bench.exchange_sensors(serial)


# ---- a batch of children beside a batch of starts


def started_units(first: int, count: int) -> Readings:
    """Each on an emulator of its own; the head's errors are of the seed and its turns: each begins elsewhere."""
    found = []
    for serial in range(first, first + count):
        with run_in_wire.start_bench(run_in_wire.make_scenario(WHAT, serial), WHAT.seed) as bench:
            bench.unit.wait_ready()
            for _ in range(3 * serial):
                bench.head.turn(0.0)
            found.append(run_in_wire.read_unit(bench, WHAT))
    return Readings(mean_a=np.stack([r.mean_a for r in found]), sd_a=np.stack([r.sd_a for r in found]))


def off_model(values: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Changes from start to start less those of the sensor model, over their uncertainty: (units, 3)."""
    model, of_model = run_in.measure_model(WHAT, 1, UNITS)
    u = np.sqrt(np.sum(noise**2 + of_model**2, axis=1))
    return np.asarray((np.diff(values, axis=1) - np.diff(model, axis=1))[:, 0] / u)


def test_children_measure_what_starts_with_the_same_sensors_measure() -> None:
    """Unit by unit within the uncertainties, and as a batch by Kolmogorov and Smirnov at 1e-4; seeds are fixed."""
    forked = off_model(*run_in_wire.measure_wire(WHAT, 1, UNITS))
    values, noise = run_in.estimate_units(started_units(1, UNITS))
    head = np.array([0.0, 0.0, run_in_wire.HEAD_ARCSEC / np.sqrt(2.0)])
    started = off_model(values, np.hypot(noise, head))
    for k, q in enumerate(QUANTITIES):
        rms = [float(np.sqrt(np.mean(z[:, k] ** 2))) for z in (forked, started)]
        found = stats.ks_2samp(forked[:, k], started[:, k])
        print(f"{q}: forked {rms[0]:.2f}, started {rms[1]:.2f} u, p {found.pvalue:.3f}", file=sys.stderr)
        assert max(rms) < 1.6, (q, rms)
        assert found.pvalue > 1e-4
        assert forked[:, k].std(ddof=1) > 0.5, q  # children of one seed would share the errors of the head

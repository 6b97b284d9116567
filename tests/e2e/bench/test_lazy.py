"""Units that no one looks at sleep: a bench that is saved, restored or forked goes on to the same bytes."""

from pathlib import Path

import pytest
from psabench import Bench

pytestmark = pytest.mark.host


def future(bench: Bench) -> list[tuple[int, ...]]:
    """Raw codes of ten readings from here on."""
    readings = bench.unit.stream(10)
    return [tuple(int(v * 1e12) for v in readings.axis(a)) for a in "xyz"]


def life(tmp_path: Path, scenario: str, name: str, *extra: str) -> tuple[str, list[list[tuple[int, ...]]]]:
    """The snapshot's text, then what comes after it: here, in a fork, restored."""
    path = tmp_path / name
    with Bench.start(scenario, extra=extra) as bench:
        if scenario == "quartz_chamber":
            bench.chamber.set(-20.0)
        bench.run_for(3.2104567)
        bench.head.turn(70.0)
        bench.run_for(1.7001)
        bench.snapshot(path)
        with bench.fork() as fork:
            fork.run_for(2.0)
            forked = future(fork)
        bench.run_for(2.0)
        here = future(bench)
    with Bench.restore(path) as again:
        again.run_for(2.0)
        restored = future(again)
    return path.read_text(), [here, forked, restored]


@pytest.mark.parametrize("scenario", ["calibrate", "quartz_chamber"])
def test_lazy_and_eager_go_on_to_the_same_bytes(tmp_path: Path, scenario: str) -> None:
    lazy, futures = life(tmp_path, scenario, "lazy.snapshot")
    eager, others = life(tmp_path, scenario, "eager.snapshot", "--eager")
    assert lazy == eager
    assert all(f == futures[0] for f in [*futures, *others])


SENSOR = "{sensor: mems, u0_v: 2.5, kx_v_per_g: 1.0}"
LONE = f"axes: {{x: {SENSOR}, y: {SENSOR}, z: {SENSOR}}}"
SLOW = "{sensor: quartz, afe: {input: current}, quartz: {natural_hz: 20}}"
PSD1 = "skipping its read cycles is not built, and its gyros integrate step by step"
UNITS = {
    "still": ("on: fixed", None),
    "arm": ("on: fixed, lever_arm_m: [0.1, 0, 0]", None),
    "head": ("on: head", None),
    "swing": ("on: head, lever_arm_m: [0.1, 0, 0]", "its mount accelerates it"),
    "slow": ("adc_chain: modulator", "a converter's filter has no finite memory"),
    "warm": ("profile: ungated", "bursts for the temperature converter reach the others"),
    "psd": ("board: psd1", PSD1),
    "loop": (f"on: fixed, axes: {{x: {SLOW}}}", "the loop of a quartz sensor remembers long"),
    "pmka": ("board: pmka", "its integrators hold the past"),
}


def test_units_say_why_they_do_not_sleep(tmp_path: Path) -> None:
    path = tmp_path / "units.yaml"
    units = "".join(
        f"  - {{name: {n}, node: {k}, serial: {k}, {said}{'' if 'axes' in said else ', ' + LONE}}}\n"
        for k, (n, (said, _)) in enumerate(UNITS.items(), 5)
    )
    path.write_text(f"units:\n{units}")
    with Bench.start(path, can="none") as bench:
        bench.run_for(1.0)
        said = {u["name"]: u["eager"] for u in bench.control.call("units").result["units"]}
    assert said == {n: why for n, (_, why) in UNITS.items()}

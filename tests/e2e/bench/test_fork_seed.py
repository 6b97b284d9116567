"""A child of `fork` with a seed: the same bench with other noise from here on, in law that of another start."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from psabench import Bench
from psabench.boards.psa2.frames import Frames
from psabench.errors import BenchError
from psabench.link.vcd import read_vcd
from scipy import stats

pytestmark = pytest.mark.host

BOARDS = ("psa2", "psd1", "pmka", "pik")
SENSOR = "{sensor: mems, kx_v_per_g: 0.5}"  # silent: the noise is that of the boards
NOISY_PIK = "board: pik\nname: noisy\nnoise_v_rthz: 0.01\n"  # more than a pulse in a reading
CALIBRATED = "seed: 1\nunits: [{name: a, axes: {x: {sensor: mems, u0_v: 2.5, reading_noise_v: 1.0e-4}}}]\n"
READINGS = 30
FILTERS_S = 0.1  # what a filter holds of the past: 66 readings of a PSA-2


def every_board(folder: Path) -> Path:
    """A unit of each, all axes alike."""
    axes = f"axes: {{x: &s {SENSOR}, y: *s, z: *s}}"
    (folder / "pik.yaml").write_text(NOISY_PIK, encoding="utf-8")
    profile = {"pik": f", profile: {folder / 'pik.yaml'}"}
    rows = [f"  - {{name: {b}, {axes}, board: {b}{profile.get(b, '')}}}\n" for b in BOARDS]
    path = folder / "boards.yaml"
    path.write_text("seed: 3\nunits:\n" + "".join(rows), encoding="utf-8")
    return path


def columns(bench: Bench) -> dict[str, np.ndarray]:
    """By board and axis: what READINGS readings say."""
    found = {}
    for name, unit in bench.units.items():
        got = unit.stream(READINGS)
        for i, axis in enumerate("XYZ"):
            found[f"{name} {axis}"] = got.u_v[:, i] if isinstance(got, Frames) else got[axis]
    return found


def changed(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> set[str]:
    return {name for name in a if not np.array_equal(a[name], b[name])}


def test_a_seed_changes_the_noise_of_every_axis_of_every_board(tmp_path: Path) -> None:
    with Bench.start(every_board(tmp_path)) as bench:
        bench.run_for(0.5)
        with bench.fork() as child:
            parents = columns(child)
        with bench.fork(seed=7) as child:
            seventh = columns(child)
            truth = child.truth()
        with bench.fork(seed=7) as child:
            again = columns(child)
            assert child.truth() == truth
        with bench.fork(seed=8) as child:
            eighth = columns(child)
        assert changed(columns(bench), parents) == set()
    assert changed(seventh, again) == set()
    assert changed(seventh, parents) == changed(seventh, eighth) == changed(eighth, parents) == set(parents)


def test_a_child_with_a_seed_is_saved_and_restored_like_any_bench(tmp_path: Path) -> None:
    path = tmp_path / "child.snapshot"
    with Bench.start("stream") as bench:
        bench.run_for(0.3)
        with bench.fork(seed=5) as child:
            child.run_for(0.1)
            child.snapshot(path)
            goes_on = child.unit.stream(READINGS).u_v
    with Bench.restore(path) as again:
        assert np.array_equal(again.unit.stream(READINGS).u_v, goes_on)


def test_a_seed_that_is_no_number_is_refused_and_there_is_no_child(tmp_path: Path) -> None:
    with Bench.start("stream") as bench:
        with pytest.raises(BenchError, match="seed"):
            bench.control.call("fork", control=str(tmp_path / "c"), seed=-1)
        assert not (tmp_path / "c").exists()


def test_slow_noise_keeps_the_value_that_it_has_reached(tmp_path: Path) -> None:
    """Of a unit that is off, too: no one has looked at it for minutes."""
    path = tmp_path / "slow.yaml"
    sensor = "{sensor: mems, u0_v: 2.5, bias_instability_v: 1.0e-3, walk_v_rts: 1.0e-4}"
    path.write_text(f"supply: {{volt_v: 12}}\nunits: [{{name: a, axes: {{x: {sensor}}}}}]\n", encoding="utf-8")
    with Bench.start(path) as bench:
        bench.run_for(1.0)
        bench.control.call("supply.output", on=False)
        bench.run_for(100.0)
        with bench.fork(seed=5) as child:
            now = child.truth_state()
            child.run_for(10.0)
            later = child.truth_state()
        assert now == bench.truth_state()
        bench.run_for(10.0)
        assert later["unit"]["zero_moved_v"] != bench.truth_state()["unit"]["zero_moved_v"]


def reading_figures(bench: Bench) -> tuple[float, float]:
    """Mean and scatter of X, V, once the filters have forgotten what was before."""
    bench.run_for(FILTERS_S)
    x = bench.unit.stream(READINGS).axis("x")
    return float(x.mean()), float(x.std(ddof=1))


@pytest.mark.parametrize("children", [60])
def test_a_batch_of_children_has_the_law_of_a_batch_of_starts(tmp_path: Path, children: int) -> None:
    """Means and scatters of both batches by Kolmogorov and Smirnov, each at 1e-4; seeds are fixed."""
    path = tmp_path / "one.yaml"
    path.write_text(CALIBRATED, encoding="utf-8")
    with Bench.start(path, seed=1) as bench:
        bench.run_for(0.5)
        forked = []
        for seed in range(2, 2 + children):
            with bench.fork(seed=seed) as child:
                forked.append(reading_figures(child))
    started = []
    for seed in range(1002, 1002 + children):
        with Bench.start(path, seed=seed) as bench:
            bench.run_for(0.5)
            started.append(reading_figures(bench))
    for a, b in zip(zip(*forked, strict=True), zip(*started, strict=True), strict=True):
        found = stats.ks_2samp(a, b)
        print(f"statistic {found.statistic:.3f}, p {found.pvalue:.3f}", file=sys.stderr)
        assert found.pvalue > 1e-4
        assert len(set(a)) > 0.9 * children  # readings are codes, so that two may be equal


# What is drawn in faults that are active at the fork: noise, which frames are lost, when pulses come.
DRAWN: dict[str, tuple[str, dict[str, float]]] = {
    "sensor.noise": ("a.sensor.x", {"rms_v": 1e-3}),
    "link.drop": ("a.can", {"probability": 0.3, "can_id": 0x185}),
    "line.noise": ("a.line.Res", {"rate_hz": 2000, "width_ns": 100}),
}


def effect(bench: Bench, kind: str, vcd: Path) -> list[float]:
    """What the fault does from now on, without what a board of silent sensors and a quiet line adds."""
    if kind == "line.noise":
        with bench.trace(vcd):
            bench.run_for(0.02)
        return [float(t) for t in read_vcd(vcd).wires["Res"].t_ns]
    bench.run_for(FILTERS_S)
    got = bench.unit.stream(READINGS)
    if kind == "link.drop":
        return [float(n) for n in got.seq]
    return list(got.axis("x"))


@pytest.mark.parametrize("kind", DRAWN)
def test_a_seed_reaches_what_is_drawn_in_active_faults(tmp_path: Path, kind: str) -> None:
    point, args = DRAWN[kind]
    with Bench.start("stream") as bench:
        bench.run_for(0.1)
        with bench.fault(kind, point, **args):
            bench.run_for(0.1)
            found = []
            for n, seed in enumerate((None, 5, 5, 6)):
                with bench.fork(seed=seed) as child:
                    found.append(effect(child, kind, tmp_path / f"{n}.vcd"))
    parents, fifth, again, sixth = found
    assert fifth == again
    if kind == "sensor.noise":
        assert abs(np.corrcoef(fifth, sixth)[0, 1]) < 0.6
        assert abs(np.corrcoef(fifth, parents)[0, 1]) < 0.6
    assert parents != fifth != sixth != parents

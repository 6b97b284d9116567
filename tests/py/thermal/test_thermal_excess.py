"""What is more than noise: pooled with its sign over quantities that share the cause."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from psabench.budget.accuracy import EXACT, BenchAccuracy
from psabench.thermal.excess import Excess, MeanSquare, excess_lines, excess_of
from psabench.thermal.measure import RunStart, ThermalWatch, measure_schedule
from psabench.thermal.result import estimate_run
from psabench.thermal.schedule import schedule_of_dict
from thermal_bench import FakeThermalBench

DOF, GAIN, TRIALS = 6, 2.0, 1000


def square(value: float, *, noise: float = 1.0, source: str = "", drawn: bool = False) -> MeanSquare:
    return MeanSquare(value=value, dof=DOF, noise=noise, gain=GAIN, drawn=drawn, source=source)


def group_of(values: np.ndarray) -> dict[str, MeanSquare]:
    return {f"q{k}": square(float(v), source=f"q{k}") for k, v in enumerate(values)}


def test_where_there_is_nothing_it_is_as_often_below_zero() -> None:
    rng = np.random.default_rng(1)
    found = [excess_of(group_of(rng.chisquare(DOF, 3) / DOF))["q0"] for _ in range(TRIALS)]
    x = np.array([e.square for e in found])
    variance = 2.0 / DOF / GAIN**2 / 3.0
    assert abs(x.mean()) < 3.0 * math.sqrt(variance / TRIALS)
    assert np.var(x) == pytest.approx(variance, rel=0.15)
    assert min(e.variance for e in found) == pytest.approx(variance)  # where it is 0 or below
    alone = np.maximum((rng.chisquare(DOF, TRIALS) / DOF - 1.0) / 2.0, 0.0)
    assert np.maximum(x, 0.0).mean() < 0.65 * alone.mean()  # by the root of three, but for groups that came apart


@pytest.mark.parametrize("drawn", [False, True])
def test_an_excess_that_is_there_is_found_without_bias(drawn: bool) -> None:
    rng, x, noise = np.random.default_rng(2), 0.8, 1.0
    shift = math.sqrt(2.0 * x / noise)  # of each normal number: the same in each run, or drawn
    sizes = rng.standard_normal((TRIALS, 3, DOF))
    sums = (sizes * math.sqrt(1.0 + shift**2) if drawn else sizes + shift) ** 2
    each = [{f"q{k}": square(float(v), source=f"q{k}", drawn=drawn) for k, v in enumerate(row)} for row in sums.mean(2)]
    found = [excess_of(group)["q0"] for group in each]
    assert np.mean([e.square for e in found]) == pytest.approx(x, rel=0.05)
    assert np.var([e.square for e in found]) == pytest.approx(np.mean([e.variance for e in found]), rel=0.25)


@pytest.mark.parametrize("drawn", [False, True])
def test_one_that_has_clearly_more_stands_alone(drawn: bool) -> None:
    values = {"a": 1.0, "b": 1.1, "c": 30.0}
    found = excess_of({n: square(v, source=n, drawn=drawn) for n, v in values.items()})
    assert {n: e.square for n, e in found.items()} == pytest.approx({"a": 0.0, "b": 0.05, "c": 14.5})
    alike = excess_of({n: square(v, source=n, drawn=drawn) for n, v in {"a": 1.0, "b": 1.1, "c": 1.9}.items()})
    assert alike["a"] == alike["c"]


def test_the_one_with_less_noise_says_more() -> None:
    found = excess_of({"quiet": square(0.012, noise=0.01, source="a"), "loud": square(90.0, noise=100.0, source="b")})
    assert found["loud"].square == pytest.approx(0.001, rel=0.01)


def test_what_one_source_draws_counts_once() -> None:
    both = [excess_of({"a": square(1.0, source="tilt"), "b": square(1.0, source=s)}) for s in ("tilt", "other")]
    assert both[0]["a"].variance == pytest.approx(2.0 * both[1]["a"].variance)
    assert both[0]["a"].variance == pytest.approx(excess_of({"a": square(1.0)})["a"].variance)


def test_without_noise_each_stands_as_it_is() -> None:
    found = excess_of({"a": square(1.0, noise=0.0, source="a"), "b": square(4.0, noise=0.0, source="b")})
    assert {n: (e.square, e.variance) for n, e in found.items()} == {"a": (0.5, 0.0), "b": (2.0, 0.0)}
    assert excess_of({"a": square(0.0, noise=0.0)})["a"] == Excess(square=0.0, variance=0.0)


@pytest.mark.parametrize(
    ("squares", "left"),
    [
        ((3.0, 1.0), (3.0, 1.0)),
        ((3.0, -1.0), (2.0, 0.0)),
        ((-1.0, 3.0), (0.0, 2.0)),
        ((1.0, -3.0), (0.0, 0.0)),
        ((-1.0, -1.0), (0.0, 0.0)),
    ],
)
def test_what_is_negative_is_taken_off_the_other_line(squares: tuple[float, float], left: tuple[float, float]) -> None:
    lines = dict(zip("ab", (Excess(square=x, variance=0.5) for x in squares), strict=True))
    found = list(excess_lines(lines))
    assert [c.u**2 for c in found] == pytest.approx(left)
    variance = 0.5 if min(squares) > 0.0 else 1.0  # of a difference of both
    for c, x in zip(found, left, strict=True):
        assert x == 0.0 or c.dof == pytest.approx(2.0 * x**2 / variance)


def test_the_misfit_of_a_curve_is_pooled_over_the_methods_that_measured_it() -> None:
    """A second method that leaves the same doubles what is known of it; a quantity of its own kind alone does not."""
    schedule = schedule_of_dict(
        {"low_c": 20, "high_c": 50, "degree": 1, "soak": {"temperatures_c": [20, 35, 50], "ramp_k_per_min": 20}},
        "test",
        "three points",
    )
    bench = FakeThermalBench(noise_v=2e-7)
    recordings = measure_schedule(bench, schedule, RunStart(origin_s=0.0, chamber_degc=25.0), ThermalWatch())
    found = estimate_run(recordings, schedule, 9.81, BenchAccuracy(**EXACT)).budget
    f = found.fitted["soak", "zero_x_ug"]
    alone, twice = (
        next(c for c in replace(found, fitted=each).estimate_at("soak", "zero_x_ug", 35.0).budget if c.name == "misfit")
        for each in ({f.key: f}, {f.key: f, ("sweep-1", "zero_x_ug"): replace(f, method="sweep-1")})
    )
    assert twice.u == pytest.approx(alone.u)
    assert twice.dof == pytest.approx(2.0 * alone.dof)

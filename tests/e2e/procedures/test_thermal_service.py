"""Compensation in service, through the wire: fresh units in a profile of temperature that no fit has seen, with other
noise, gain what their fits promise."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
from psabench import Bench, cli
from psabench.passport.entry import runs_of_result
from psabench.thermal.apply import Compensator
from psabench.thermal.compensation import Array, Compensation
from psabench.thermal.reduce import ARCSEC

pytestmark = pytest.mark.host

ROOT = Path(__file__).resolve().parents[3]
UNIT = ROOT / "examples/thermal/small_unit.yaml"
SCHEDULE = """
low_c: 20
high_c: 50
degree: 3
record_s: 0.2
sweep: {rates_k_per_min: [6], every_s: 6, rest_s: 240, turn_s: 180, ramp_k_per_min: 20}
"""
SEED = int(os.environ.get("TEST_SEED", "2411"))
RATE_K_PER_MIN, TURNS_C = 5.0, (48.0, 23.0, 35.0)  # the fit's sweep: 6 K/min, 20 to 50 degC and back
EVERY_S, LOOKS, READINGS = 12.0, 25, 250
PLAIN_C = 30.0


def error_g(read: Array, truth: dict[str, list[float]]) -> Array:
    """Of the mean reading, (3,)."""
    f_mps2 = np.array(truth["f_mps2"])
    return np.asarray(read.mean(axis=0) + f_mps2 / math.hypot(*f_mps2))


def plain_g(u_v: Array, at: dict[str, float]) -> Array:
    """By the numbers of one temperature, (n, 3)."""
    return np.stack([u_v[:, i] / at[f"scale_{a}_v_per_g"] - at[f"zero_{a}_ug"] * 1e-6 for i, a in enumerate("xyz")], 1)


def served_errors(curves: dict[str, Compensation], seed: int) -> tuple[Array, Array]:
    """Of a unit in its profile: compensated and plain, (looks, 3) each, g."""
    compensated, plain = [], []
    with Bench.start(UNIT, seed=seed) as bench:
        bench.unit.wait_ready()
        gain = bench.unit.filter_gain
        compensator = Compensator(curves, gain)
        at = {name: float(c.value_at(PLAIN_C)) for name, c in curves.items()}
        bench.control.call("reseed", seed=seed + 1000)
        bench.chamber.ramp(RATE_K_PER_MIN)
        for turn_c in TURNS_C:
            bench.chamber.set(turn_c)
            for _ in range(LOOKS):
                bench.unit.host.advance(EVERY_S)
                frames = bench.unit.stream(READINGS)
                truth = bench.truth_state()["unit"]
                compensated.append(error_g(compensator.accelerations_g(frames), truth))
                plain.append(error_g(plain_g(frames.u_v / gain, at), truth))
        assert compensator.clamped == 0
    return np.array(compensated), np.array(plain)


def residual_g(curves: dict[str, Compensation]) -> Array:
    """What the fits leave with y against gravity, rms, (3,): of the zero, and of scale or base error beside it."""
    zero_g = np.array([curves[f"zero_{a}_ug"].rms * 1e-6 for a in "xyz"])
    scale_g = curves["scale_y_v_per_g"].rms / float(curves["scale_y_v_per_g"].value_at(PLAIN_C))
    base_g = [curves[f"base_{a}y_arcsec"].rms / ARCSEC for a in "xz"]
    return np.asarray(np.hypot(zero_g, [base_g[0], scale_g, base_g[1]]))


def rms(x: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(x**2, axis=0)))


def test_the_zero_of_fresh_units_improves_as_the_residual_predicts(tmp_path: Path) -> None:
    """Over units and axes, geometric means: the factor by which the error falls, and the one of the fits' residuals.

    The play is in the readings of service, not in the residuals of a sweep: seeds 2411, 2501, 2601, 2701 and the two
    after each give 0.83, 0.73, 0.75, 0.72."""
    print(f"TEST_SEED={SEED}")
    gained, promised, schedule = [], [], tmp_path / "sweep.yaml"
    schedule.write_text(SCHEDULE, encoding="utf-8")
    for seed in range(SEED, SEED + 3):
        out = tmp_path / str(seed)
        words = ["--scenario", str(UNIT), "--schedule", str(schedule), "--seed", str(seed), "--out", str(out)]
        assert cli.main(["run", "thermal", *words]) in (0, 1)
        curves = {run.method: run for run in runs_of_result(out / "result.json")}["thermal sweep-1"].curves
        compensated, plain = served_errors(curves, seed)
        gained += list(rms(plain) / rms(compensated))
        promised += list(rms(plain) / residual_g(curves))
    print("gained", np.round(gained, 1), "promised", np.round(promised, 1))
    assert min(gained) > 5.0
    ratio = np.exp(np.mean(np.log(np.array(gained) / np.array(promised))))
    assert 0.7 < ratio < 1.0, ratio

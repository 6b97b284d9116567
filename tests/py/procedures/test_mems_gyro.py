"""`psabench run mems-gyro` through the model of the sensor: recovery, noise, coverage, doubts."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import physics
import pytest
from psabench.errors import BenchError
from psabench.mems_gyro import model
from psabench.mems_gyro.fit import estimate_gyro, expected_values
from psabench.mems_gyro.noise import allan_deviations, allan_law, fit_noise, term_kernels
from psabench.mems_gyro.params import MemsGyroParams
from psabench.mems_gyro.plan import ATTITUDES, Dwell
from psabench.mems_gyro.wire import measure_gyro
from psabench.procedures.head_bench import Silent

from tests.coverage import mems_gyro as coverage

SHORT = MemsGyroParams(series=1, dwell_s=4, rest_s=300)
QUIET = {"noise_dps_rthz": 0.0, "bias_instability_dps": 0.0, "walk_dps_rts": 0.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(tmp_path_factory.mktemp("gyro"))


def dwells_of(folder: str, p: MemsGyroParams, seed: int, **changed: float) -> tuple[list[Dwell], dict[str, float]]:
    """Of a drawn gyro with a chain and a mounting without error where p says so; what the estimates should be."""
    bench = coverage.ModelBench(coverage.library(folder), p, seed, changed)
    dwells: list[Dwell] = []
    measure_gyro(bench, p, Silent(), dwells.append)
    right = expected_values(bench.truth)
    right["zero_v"] += float(np.mean(bench.moved_v))
    return dwells, right


EXACT: dict[str, Any] = {
    name: 0.0 for name in MemsGyroParams.__dataclass_fields__ if name.startswith(("chain_", "rate_", "mount_"))
}


def test_without_noise_every_parameter_is_found(folder: str) -> None:
    p = replace(SHORT, **EXACT)
    dwells, right = dwells_of(folder, p, 3, **QUIET)
    rng = np.random.default_rng(1)
    touched = [replace(d, blocks_v=d.blocks_v + 1e-10 * rng.standard_normal(len(d.blocks_v))) for d in dwells]
    for e in estimate_gyro(touched, p).estimates:
        wobble_mrad = 0.011 if e.name.startswith("cross") else 0.0  # 1" of each of two axes
        assert e.value == pytest.approx(right[e.name], rel=2e-5, abs=3e-5 + wobble_mrad), e.name


@pytest.mark.parametrize("channel", "xyz")
def test_each_channel_has_its_own_axes(folder: str, channel: str) -> None:
    """Rate and gravity of a dwell against the table's own model, on the case's axes in the channel's order."""
    p = replace(SHORT, axis=channel, azimuth_deg=0.0)
    lab = physics.Lab(
        coverage.library(folder),
        latitude_rad=math.radians(p.latitude_deg),
        axes=[[2.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    )
    for middle_deg, inner_deg in (*ATTITUDES, (30.0, 200.0)):
        for axis, deg in ((0, 40.0), (1, middle_deg), (2, inner_deg)):
            lab.lib.bridge_position(lab.lab, axis, deg, 500.0, physics.ns(1.0))
        f, w = lab.kinematics(physics.TABLE, 100.0)
        still = Dwell(
            middle_deg=middle_deg,
            inner_deg=inner_deg,
            heading_deg=40.0,
            rate_dps=0.0,
            t_s=0.0,
            duration_s=1.0,
            blocks_v=np.zeros(1),
        )
        w_dps, a_g = model.felt_motion(still, p)
        assert np.roll(w_dps, p.channel) == pytest.approx(np.degrees(w), abs=1e-9)
        assert np.roll(a_g, p.channel) == pytest.approx(-f / lab.g_mps2, abs=1e-6)


def test_the_earth_s_rate_is_averaged_over_a_turn() -> None:
    turning = Dwell(
        middle_deg=-90.0,
        inner_deg=0.0,
        heading_deg=25.0,
        rate_dps=70.0,
        t_s=0.0,
        duration_s=3.0,
        blocks_v=np.zeros(1),
    )
    parts = 3000
    step_s = turning.duration_s / parts
    each = [
        model.felt_motion(replace(turning, heading_deg=25.0 + 70.0 * k * step_s, duration_s=step_s), SHORT)[0]
        for k in range(parts)
    ]
    assert model.felt_motion(turning, SHORT)[0] == pytest.approx(np.mean(each, axis=0), abs=1e-9)


@pytest.mark.parametrize("v", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.3, 2.0, 1e-3)])
@pytest.mark.parametrize("tau_s", [1.0, 30.0, 400.0])
def test_covariances_of_means_give_the_allan_law(v: tuple[float, float, float], tau_s: float) -> None:
    parts = term_kernels(np.array([0.0, tau_s, 5000.0]), np.array([tau_s, tau_s, 1.0]))
    c = sum((x * k for x, k in zip(v, parts, strict=True)), np.zeros((3, 3)))
    allan = math.sqrt(0.5 * (c[0, 0] + c[1, 1] - 2.0 * c[0, 1]))
    assert allan == pytest.approx(float(allan_law(np.array(v), np.array([tau_s]))[0]), rel=1e-6)


def test_allan_deviation_of_a_ramp_and_of_white_noise() -> None:
    tau_s, ramp = allan_deviations(0.1 * np.arange(4096.0), 1.0)
    assert ramp == pytest.approx(0.1 * tau_s / math.sqrt(2.0))
    assert tau_s[-1] == 1024.0
    _, white = allan_deviations(np.random.default_rng(2).standard_normal(4096), 1.0)
    assert white[:5] == pytest.approx(1.0 / np.sqrt(tau_s[:5]), rel=0.12)


def test_the_terms_of_the_noise_are_found() -> None:
    """Mean and standard deviation of the powers over drawn recordings are those that the fit says."""
    t_s, duration_s = np.arange(0.0, 1200.0, 10.0), np.full(120, 10.0)
    parts = term_kernels(t_s, duration_s)
    right = np.array([1.0, 0.5, 2e-3])
    root = np.linalg.cholesky(sum(x * k for x, k in zip(right, parts, strict=True)))
    rng, ones = np.random.default_rng(3), np.ones((120, 1))
    fits = [fit_noise(root @ rng.standard_normal(120), ones, parts) for _ in range(60)]
    white = np.array([f.v[0] for f in fits])
    said = float(np.mean([f.sd[0] for f in fits]))
    assert white.mean() == pytest.approx(1.0, abs=4.0 * said / math.sqrt(len(fits)) + 0.05)
    assert 0.6 < white.std() / said < 1.4
    assert np.mean([f.v[1] for f in fits]) == pytest.approx(0.5, abs=0.2)


def test_u_contains_the_truth_as_often_as_it_says(folder: str) -> None:
    """60 drawn gyros, 540 numbers of the model; docs/procedures/mems_gyro.md has 200, by tests/coverage."""
    p = MemsGyroParams(rest_s=600)
    runs = [coverage.through_the_model(seed, p, folder) for seed in range(5001, 5061)]
    en = np.array([[run[q][0] for q in run if not q.endswith(("_rth", "degph"))] for run in runs])
    share = float(np.mean(np.abs(en) <= 1.0))
    print(f"{en.size} values, {share:.4f} within U")
    assert en.shape == (60, 9)
    assert 0.93 <= share <= 0.98
    each = np.mean(np.abs(en) <= 1.0, axis=0)
    assert np.all(each >= 0.85), each  # 4 standard deviations of 60 runs below 95.45 %


def test_a_dwell_that_the_others_do_not_predict_is_a_doubt(folder: str) -> None:
    dwells, _ = dwells_of(folder, SHORT, 4)
    at = next(k for k, d in enumerate(dwells) if d.rate_dps > 100.0)
    assert not estimate_gyro(dwells, SHORT).doubts
    dwells[at] = replace(dwells[at], blocks_v=dwells[at].blocks_v + 0.02)
    doubts = estimate_gyro(dwells, SHORT).doubts
    assert any(d.startswith(f"{dwells[at].rate_dps:+.1f} °/s at -90°, 0°: +") for d in doubts), doubts


def test_an_output_at_its_limit_is_a_doubt(folder: str) -> None:
    dwells, _ = dwells_of(folder, SHORT, 4)
    limited = [replace(d, blocks_v=np.minimum(d.blocks_v, 3.5)) for d in dwells]
    doubts = estimate_gyro(limited, SHORT).doubts
    assert any("the output has no noise" in d for d in doubts), doubts


def test_an_output_that_never_moves_is_an_error(folder: str) -> None:
    dwells, _ = dwells_of(folder, SHORT, 4)
    stuck = [replace(d, blocks_v=np.full_like(d.blocks_v, 2.5)) for d in dwells]
    rng = np.random.default_rng(1)
    noisy = [replace(d, blocks_v=2.5 + 1e-3 * rng.standard_normal(len(d.blocks_v))) for d in dwells]
    for readings in (stuck, noisy):
        with pytest.raises(BenchError, match="mems-gyro: expected an output that follows the table's rate, got one"):
            estimate_gyro(readings, SHORT)


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("axis", "w", "axis: expected x, y or z, got 'w'"),
        ("rest_s", 10, "rest_s: expected at least 300 s"),
        ("series", 0, "series: expected at least 1, got 0"),
        ("dwell_s", 1, "dwell_s: expected at least 2 s, got 1"),
        ("mount_arcsec", -1.0, "mount_arcsec: expected 0 or more, got -1.0"),
    ],
)
def test_parameters_out_of_range_are_refused(name: str, value: object, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        MemsGyroParams(**{name: value})  # type: ignore[arg-type]


def test_the_model_s_derivatives_are_those_of_its_values() -> None:
    theta = np.array([2.5, 0.0125, 0.01, -0.02, 0.1, -0.2, 0.05, 2e-5, 5e-7])
    rows = np.array([[100.0, 3.0, -50.0, 1.0, 0.0, 0.2], [-20.0, 90.0, 1.0, 0.1, -1.0, 0.0]])
    j = model.model_jacobian(theta, rows)
    for k in range(model.SIZE):
        step = np.zeros(model.SIZE)
        step[k] = 1e-6 * max(abs(theta[k]), 1e-6)
        change = (model.predict_v(theta + step, rows) - model.predict_v(theta - step, rows)) / (2.0 * step[k])
        assert j[:, k] == pytest.approx(change, rel=1e-4), k

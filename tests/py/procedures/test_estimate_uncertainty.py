"""Confidence that can be checked: coverage, identifiability, the figures of sources instruments 2.3-2.4.

Thousands of calibrations are one matrix here. Seeds are printed; TEST_SEED replays or varies them.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from fake_bench import seeded
from psabench.estimate import harmonics, model, uncertainty
from psabench.estimate.face import Face
from psabench.estimate.model import Array, Sensor

ALPHA_RAD = np.tile(np.radians(5.0 * np.arange(80)), 5)  # 5 realisations x 80 positions
T_S = np.arange(400.0)
TRUTH = Sensor(u0_v=2.50, alpha0_rad=np.radians(0.1121), kx_v_per_g=1.0, ky_v_per_g=0.0098, kxy_v_per_g2=0.0010)
ONE_FACE = np.array([2.50, np.radians(0.1121), 1.0, 0.0098, 0.0010])


def fits(
    rng: np.random.Generator, sigma_v: float, runs: int, drift: bool, face: Face = Face.DIRECT
) -> harmonics.HarmonicFit:
    """`runs` calibrations of the article's sensor at once."""
    clean_v = harmonics.evaluate(model.harmonics_of(TRUTH, face), ALPHA_RAD)
    u_v = clean_v[:, None] + sigma_v * rng.standard_normal((400, runs))
    return harmonics.fit(ALPHA_RAD, u_v, T_S if drift else None)


def interval_half(jacobian: Array, unit_cov: Array, sigma_v: Array, dof: int) -> Array:
    """95 % half widths (q, runs)."""
    var = np.einsum("iir->ir", uncertainty.propagate(jacobian, unit_cov))
    half: Array = uncertainty.t_quantile(dof) * np.sqrt(var) * sigma_v
    return half


@pytest.mark.parametrize("drift", [False, True])
@pytest.mark.parametrize("sigma_v", [10e-6, 2e-6, 1e-6])
def test_alpha0_is_within_10_percent_as_often_as_gauss_says(sigma_v: float, drift: bool) -> None:
    """0.22, 0.83, 0.99 (sources instruments 2.3: 0.24, 0.83, 0.99). At 2 uV at least 80 % is the acceptance figure."""
    f = fits(seeded("within_10_percent"), sigma_v, 20_000, drift)
    share = float(np.mean(np.abs(model.one_face(f.c_v)[1] / TRUTH.alpha0_rad - 1) < 0.1))
    sd_rad = sigma_v * math.sqrt(f.unit_cov[4, 4]) / (2 * 5e-4)  # alpha0 = C4 / (2 C3), C3 = 0.5 mV
    print(f"{sigma_v=} {drift=} {share=}")
    assert share == pytest.approx(math.erf(0.1 * TRUTH.alpha0_rad / (sd_rad * math.sqrt(2))), abs=0.014)  # 4 sd
    assert sigma_v != 2e-6 or share >= 0.80


@pytest.mark.parametrize(
    ("sigma_v", "sd_alpha0_deg", "sd_ky", "sd_sum"), [(50e-6, 0.20, 3.5e-3, 3.5e-6), (2e-6, 0.008, 1.4e-4, 0.14e-6)]
)
def test_scatter_of_one_face_is_that_of_the_facts(
    sigma_v: float, sd_alpha0_deg: float, sd_ky: float, sd_sum: float
) -> None:
    """alpha0 and ky scatter together by a thousand times more than their sum does: correlation -1."""
    f = fits(seeded("scatter_one_face"), sigma_v, 4000, drift=False)
    est = model.one_face(f.c_v)
    assert np.degrees(est[1].std()) == pytest.approx(sd_alpha0_deg, rel=0.06)
    assert est[3].std() == pytest.approx(sd_ky, rel=0.06)
    assert f.c_v[2].std() == pytest.approx(sd_sum, rel=0.06)
    assert np.corrcoef(est[1], est[3])[0, 1] < -0.999


@pytest.mark.parametrize("drift", [False, True])
@pytest.mark.parametrize("sigma_v", [6e-9, 5e-6, 78e-6])
def test_intervals_of_one_face_cover_the_truth_in_93_to_97_percent(sigma_v: float, drift: bool) -> None:
    """20 000 calibrations: the share is known to 0.15 %."""
    f = fits(seeded("coverage"), sigma_v, 20_000, drift)
    half = interval_half(model.one_face_jacobian(f.c_v), f.unit_cov, f.sigma_v, f.dof)
    covered = np.mean(np.abs(model.one_face(f.c_v) - ONE_FACE[:, None]) <= half, axis=1)
    print("coverage", dict(zip(model.ONE_FACE, covered, strict=True)))
    alpha0_linear = sigma_v < 50e-6  # kx of (18) is quadratic in the error of alpha0: only where that is small
    checked = covered if alpha0_linear else covered[[0, 1, 3]]
    assert ((checked > 0.93) & (checked < 0.97)).all()


def test_interval_of_alpha0_still_covers_at_1_mv() -> None:
    """sources instruments 2.4: delta method 0.948-0.952 for 5 uV..1 mV. kx has no interval by then: it is flagged."""
    f = fits(seeded("coverage_1mv"), 1e-3, 20_000, drift=False)
    half = interval_half(model.one_face_jacobian(f.c_v), f.unit_cov, f.sigma_v, f.dof)
    covered = np.mean(np.abs(model.one_face(f.c_v) - ONE_FACE[:, None]) <= half, axis=1)
    assert 0.93 < covered[1] < 0.97
    measured = np.abs(model.measured(f.c_v) - model.measured(model.harmonics_of(TRUTH))[:, None])
    half = interval_half(model.measured_jacobian(f.c_v), f.unit_cov, f.sigma_v, f.dof)
    for row in (0, 1, 2):  # kx_eff, angle, ky_sum are measured at any noise
        assert 0.93 < np.mean(measured[row] <= half[row]) < 0.97


@pytest.mark.parametrize(("sigma_v", "sd_alpha0_deg", "sd_ky"), [(1e-3, 0.0028, 4.8e-5), (78e-6, 0.00022, 3.8e-6)])
@pytest.mark.parametrize("drift", [False, True])
def test_reversal_scatter_and_coverage(sigma_v: float, sd_alpha0_deg: float, sd_ky: float, drift: bool) -> None:
    """sources instruments 2.4 and the acceptance figures: at 1 mV sd(alpha0) <= 0.004 deg, sd(ky) <= 6e-5 V/g."""
    rng = seeded("reversal")
    direct, reverse = (fits(rng, sigma_v, 4000, drift, face) for face in (Face.DIRECT, Face.REVERSED))
    c = np.concatenate([direct.c_v, reverse.c_v])
    est = model.reversal(c)
    assert np.degrees(est[1].std()) == pytest.approx(sd_alpha0_deg, rel=0.06)
    assert est[3].std() == pytest.approx(sd_ky, rel=0.06)
    assert sigma_v != 1e-3 or (np.degrees(est[1].std()) <= 0.004 and est[3].std() <= 6e-5)
    zero = np.zeros((5, 5))
    unit_cov = np.block([[direct.unit_cov, zero], [zero, reverse.unit_cov]])
    sigma = np.sqrt((direct.sigma_v**2 + reverse.sigma_v**2) / 2)
    half = interval_half(model.reversal_jacobian(c), unit_cov, sigma, 2 * direct.dof)
    covered = np.mean(np.abs(est - np.append(ONE_FACE, 0.0)[:, None]) <= half, axis=1)
    print("coverage", dict(zip(model.REVERSAL, covered, strict=True)))
    assert ((covered > 0.93) & (covered < 0.97)).all()


def test_delta_method_is_the_covariance_of_the_estimates() -> None:
    f = fits(seeded("delta"), 5e-6, 20_000, drift=True)
    j = model.one_face_jacobian(model.harmonics_of(TRUTH)[:, None])[..., 0]
    want = uncertainty.propagate(j, f.unit_cov * 25e-12)
    got = np.cov(model.one_face(f.c_v))
    scale = np.sqrt(np.outer(np.diag(want), np.diag(want)))
    np.testing.assert_allclose(got / scale, want / scale, atol=0.04)


@pytest.mark.parametrize(
    ("value_deg", "half_deg", "kxy", "bound", "doubt"),
    [
        (0.1121, 0.05, 1e-3, 1e-6, ""),
        (0.1121, 0.1122, 1e-3, 1e-6, "wider than the value"),
        (0.1121, 0.05, 1e-3, None, "cannot exclude"),
        (0.1121, 0.05, 1e-3, 3.8e-6, ""),  # 2 kxy alpha0 = 3.91 uV/g^2
        (0.1121, 0.05, 1e-3, 4.0e-6, "only known to be below"),
        (-0.1121, 0.05, -1e-3, 4.0e-6, "only known to be below"),
    ],
)
def test_flag_of_alpha0(value_deg: float, half_deg: float, kxy: float, bound: float | None, doubt: str) -> None:
    e = uncertainty.Estimate(
        name="alpha0_deg", symbol="", unit="deg", value=value_deg, sd=half_deg / 1.966, ci_half=half_deg
    )
    said = uncertainty.alpha0_doubt(e, kxy, bound)
    assert doubt in said
    assert bool(said) == bool(doubt)


def test_student_quantile_against_the_printed_table() -> None:
    for dof, want in ((1, 12.706), (4, 2.776), (12, 2.179), (75, 1.992), (394, 1.966)):
        assert uncertainty.t_quantile(dof) == pytest.approx(want, abs=6e-4)


def test_lack_of_fit_sees_what_repeats_and_is_silent_on_noise() -> None:
    rng = seeded("lack_of_fit")
    groups = np.tile(np.arange(80.0), 5)
    p = [uncertainty.lack_of_fit_p(rng.standard_normal(400), groups, 0) for _ in range(400)]
    assert np.mean([v is not None and v < 0.05 for v in p]) == pytest.approx(0.05, abs=0.04)
    third = np.sin(3 * ALPHA_RAD) + rng.standard_normal(400)
    assert (uncertainty.lack_of_fit_p(third, groups, 0) or 0.0) < 1e-6
    assert uncertainty.lack_of_fit_p(rng.standard_normal(80), np.arange(80.0), 5) is None  # nothing repeated

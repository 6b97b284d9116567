"""Least squares of eqs (14)-(17): exact on exact data, the right covariance, a drift column, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from fake_bench import seeded
from psabench.estimate import harmonics

TURN_RAD = np.radians(5.0 * np.arange(80))  # the article's positions: 0..395 deg
C_V = np.array([2.5, -0.99998, -0.011756, 5e-4, 1.957e-6])


def test_exact_data_give_exact_coefficients_and_no_residual() -> None:
    fit = harmonics.fit(TURN_RAD, harmonics.evaluate(C_V, TURN_RAD))
    np.testing.assert_allclose(fit.c_v, C_V, atol=1e-15)
    assert np.abs(fit.residual_v).max() < 5e-15
    assert fit.dof == 75


def test_design_of_the_article_has_the_condition_and_multipliers_of_the_facts() -> None:
    """sources instruments 2.1: cond 1.523, sd multipliers .113 .165 .156 .161 .159 for one series of 80."""
    fit = harmonics.fit(TURN_RAD, np.zeros(80))
    assert fit.condition == pytest.approx(1.523, abs=5e-4)
    np.testing.assert_allclose(np.sqrt(np.diag(fit.unit_cov)), [0.113, 0.165, 0.156, 0.161, 0.159], atol=5e-4)


def test_full_circle_is_orthogonal() -> None:
    fit = harmonics.fit(np.radians(5.0 * np.arange(72)), np.zeros(72))
    np.testing.assert_allclose(fit.unit_cov, np.diag([1 / 72, *[2 / 72] * 4]), atol=1e-15)


def test_scatter_over_many_series_is_the_covariance_and_sigma_is_the_noise() -> None:
    rng = seeded("harmonics_scatter")
    u_v = harmonics.evaluate(C_V, TURN_RAD)[:, None] + 1e-3 * rng.standard_normal((80, 20_000))
    fit = harmonics.fit(TURN_RAD, u_v)
    np.testing.assert_allclose(np.cov(fit.c_v) / 1e-6, fit.unit_cov, atol=8e-4)  # 4 sd of a sample covariance
    assert (fit.sigma_v**2).mean() == pytest.approx(1e-6, rel=5e-3)


def test_drift_column_takes_a_linear_drift_out_whole() -> None:
    t_s = 10.0 * np.arange(80, dtype=np.float64)
    u_v = harmonics.evaluate(C_V, TURN_RAD) + 3e-8 * (t_s - t_s.mean())
    fit = harmonics.fit(TURN_RAD, u_v, t_s)
    np.testing.assert_allclose(fit.c_v, C_V, atol=1e-14)
    assert fit.drift_vps == pytest.approx(3e-8, rel=1e-6)
    without = harmonics.fit(TURN_RAD, u_v)
    assert abs(without.c_v[1] - C_V[1]) > 1e-6  # and it is needed


@pytest.mark.parametrize(
    ("alpha_rad", "u_v", "t_s", "why"),
    [
        (
            np.radians(np.arange(5) * 72.0),
            np.zeros(5),
            None,
            "expected at least 6 readings for 5 unknowns and a residual, got 5",
        ),
        (
            np.radians(np.arange(6) * 60.0),
            np.zeros(6),
            np.arange(6.0),
            "expected at least 7 readings for 6 unknowns and a residual, got 6",
        ),
        (np.zeros(20), np.zeros(20), None, "expected angles that separate the harmonics"),
        (
            np.radians(np.arange(20) * 90.0),
            np.zeros(20),
            None,
            "expected angles that separate the harmonics",
        ),  # sin 2a is 0 at all
        (TURN_RAD, np.full(80, np.nan), None, "finite"),
        (TURN_RAD, np.zeros(80), np.zeros(80), "different times"),
    ],
)
def test_what_cannot_be_fitted_is_refused_with_the_reason(
    alpha_rad: harmonics.Array, u_v: harmonics.Array, t_s: harmonics.Array | None, why: str
) -> None:
    with pytest.raises(ValueError, match=why):
        harmonics.fit(alpha_rad, u_v, t_s)

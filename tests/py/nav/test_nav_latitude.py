"""What a latitude that is not quite right does to a gyrocompassing, and what the library says of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from nav_reference import DEG, Floats, positions
from psabench.native import nav, nav_mc
from psabench.native.nav import ARCMIN, DEGPH, Flag, Method, Noise
from scipy import stats

SD = 20 * ARCMIN
OTHER = Noise(window_sd_radps=0.003 * DEGPH)
TURNS = {Method.CLOSED3: (0, 90, 180)}
RUNS = 400


def errors(latitude_rad: float, method: Method, *, sd_rad: float, seed: int) -> tuple[Floats, Floats]:
    """Errors of alpha [rad] and drift [0.001 deg/h], and normalised squares; each run draws its latitude."""
    rng = np.random.default_rng(seed)
    noise = replace(OTHER, latitude_sd_rad=sd_rad)
    deltas = np.radians(TURNS.get(method, (0, 90, 200, 280, 330)))
    found, squares = np.empty((RUNS, 2)), np.empty(RUNS)
    unit = np.array([1.0, 1e-3 * DEGPH])
    for k in range(RUNS):
        alpha, given = rng.uniform(-np.pi, np.pi), latitude_rad + SD * rng.standard_normal()
        rows = positions(latitude_rad, alpha, deltas, tilt=(5 * DEG, -4 * DEG), given_rad=given)
        rows = [replace(p, s_radps=p.s_radps + OTHER.window_sd_radps * rng.standard_normal()) for p in rows]
        r = nav.gyrocompass(rows, latitude_rad=given, method=method, noise=noise)
        found[k] = np.array([math.remainder(r.alpha1_rad - alpha, 2 * np.pi), r.drift1_radps - 25 * DEGPH]) / unit
        squares[k] = found[k] @ np.linalg.solve(r.cov[:2, :2] / np.outer(unit, unit), found[k])
    return found, squares


@pytest.mark.parametrize("latitude_deg", [-60, 0, 50, 70])
@pytest.mark.parametrize("method", Method)
def test_the_error_of_the_latitude_is_in_the_covariance(latitude_deg: float, method: Method) -> None:
    """Normalised squares of alpha and drift in the band of chi-square; far above it when the fit is not told."""
    low, high = stats.chi2.ppf([0.0005, 0.9995], 2 * RUNS) / RUNS
    _, told = errors(latitude_deg * DEG, method, sd_rad=SD, seed=31)
    assert low < np.mean(told) < high
    _, silent = errors(latitude_deg * DEG, method, sd_rad=0.0, seed=31)
    assert np.mean(silent) > 1.5 * high


def test_on_the_circle_weights_that_know_of_it_are_better_ones() -> None:
    """Free, its share looks like s and c; on the circle it is distinguished from them (a third of the spread, N)."""
    wise, _ = errors(50 * DEG, Method.GLS_CONSTRAINED, sd_rad=SD, seed=32)
    blind, _ = errors(50 * DEG, Method.GLS_CONSTRAINED, sd_rad=0.0, seed=32)
    assert np.std(wise[:, 0]) < 0.5 * np.std(blind[:, 0])
    free, _ = errors(50 * DEG, Method.GLS, sd_rad=SD, seed=32)
    assert np.std(free[:, 0]) == pytest.approx(np.std(blind[:, 0]), rel=0.2)


@pytest.mark.parametrize("latitude_deg", [-50, 0, 50])
def test_it_turns_the_heading_by_the_tilt_towards_east_times_it_and_level_by_nothing(latitude_deg: float) -> None:
    """dlat gamma_i adds up to dlat gamma of a platform whose x axis points east, wherever position 1 is."""
    latitude, pitch, roll = latitude_deg * DEG, 5 * DEG, -4 * DEG
    noise = Noise(latitude_sd_rad=60 * ARCMIN)

    def sd(alpha_rad: float, tilt: tuple[float, float], method: Method) -> float:
        rows = positions(latitude, alpha_rad, np.radians([0, 90, 180]), tilt=tilt, betas_rad=[0.0] * 3)
        r = nav.gyrocompass(rows, latitude_rad=latitude, method=method, noise=noise)
        assert Flag.NO_NOISE not in r.flags
        return r.alpha1_sd_rad

    east = nav.gamma(alpha_rad=0.0, psi_rad=0.7, pitch_rad=pitch, roll_rad=roll)  # psi of positions()
    for alpha in np.arange(0, 2 * np.pi, 0.5):
        assert sd(alpha, (pitch, roll), Method.CLOSED3) == pytest.approx(abs(east) * 60 * ARCMIN, rel=0.01)
        assert sd(alpha, (0.0, 0.0), Method.CLOSED3) < 1e-9
    # a constrained fit takes a wrong Earth rate for a direction where the positions are not spread evenly
    assert (sd(0.3, (0.0, 0.0), Method.CONSTRAINED) > 1 * ARCMIN) is (latitude_deg != 0)


def test_figures_without_it_are_as_they_were_and_bad_ones_are_refused() -> None:
    rows = positions(50 * DEG, 0.3, np.radians([0, 90, 180]), tilt=(5 * DEG, -4 * DEG))
    for bad, status in ((-1e-9, nav.Status.RANGE), (1.0, nav.Status.RANGE), (math.nan, nav.Status.NOT_FINITE)):
        with pytest.raises(nav.Refused) as refused:
            nav.gyrocompass(rows, latitude_rad=50 * DEG, noise=Noise(latitude_sd_rad=bad))
        assert refused.value.status is status
    cfg = replace(nav_mc.McConfig(), method=Method.GLS_CONSTRAINED, noise=replace(OTHER, latitude_sd_rad=ARCMIN))
    nav_mc.samples(cfg, 1, runs=1)
    with pytest.raises(nav.Refused):
        nav_mc.closed(cfg, 1, runs=1)

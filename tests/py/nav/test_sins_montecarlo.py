"""Calibrations of units drawn from the article's priors, with nonlinear truth: errors beside what the filter claims."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import sins_truth as truth
from psabench.native import sins
from psabench.native.nav import Floats
from psabench.native.sins import SinsConfig
from sins_truth import ARTICLE, DEG, DEGPH, Errors, Table, rotation_vector, turned

SAMPLE_S, STAND_HZ = 0.05, 10.0


@dataclass
class Outcome:
    """Of one unit: NEES of both passes, each by its own covariance; error by error in standard deviations."""

    first: float
    second: float
    normal: Floats
    nis: float


def errors_of(state: sins.State, e: Errors, c_end: Floats, stand: bool) -> Floats:
    """Estimate less truth, in the order of the state; the attitude's error is true less estimate."""
    p = state.params
    gamma = np.array([(p.gamma - e.gamma)[k] for k in ARTICLE])
    found = [
        -rotation_vector(state.c_nb @ c_end.T),
        p.nu_radps - e.nu,
        (p.theta - e.theta).ravel(),
        p.df_mps2 - e.df,
        gamma,
    ]
    if stand:
        found += [p.delta_rad - e.delta, np.array([p.tau_s - e.tau])]
    return np.concatenate(found)


def calibrated(seed: int, accel_noise_multiplier: float, stand: bool) -> Outcome:
    """One unit on the article's plan, from drawn errors to estimates."""
    rng = np.random.default_rng(seed)
    e, table = truth.drawn(rng), Table(truth.placed(), truth.article_plan())
    noise = {"gyro": 0.1 * DEGPH, "accel": 0.001 * accel_noise_multiplier}
    d = truth.measured(table, e, SAMPLE_S, **noise, seed=seed + 1000)
    cfg = SinsConfig(
        sample_s=SAMPLE_S,
        clone=True,
        accel_noise_multiplier=accel_noise_multiplier,
        stand=stand,
        stand_noise_rate_hz=50.0,
        stand_interval_s=1.0 / STAND_HZ,
    )
    sd = cfg.stand_sd_rad * np.sqrt(STAND_HZ / 50.0)
    angles = truth.angles(table, e, 1.0 / STAND_HZ, sd_rad=sd, seed=seed + 5000) if stand else None
    start = turned(rng.normal(0, 1, 3) * np.array([1.0, 1.0, 3.0]) * DEG) @ truth.placed()
    done = sins.calibrate_unit(cfg, start, d.dtheta, d.dv, stand=angles)
    n = 28 if stand else 24
    first, p = (np.ascontiguousarray(c[:n, :n]) for c in (done.first_covariance, done.covariance))
    last = errors_of(done.state, e, d.c_end, stand)
    return Outcome(
        first=sins.error_nees(errors_of(done.first, e, d.c_end, stand), first),
        second=sins.error_nees(last, p),
        normal=last / np.sqrt(np.diag(p)),
        nis=done.state.nis_accel,
    )


@pytest.mark.parametrize(("stand", "seed"), [(False, 0), (True, 0)])
def test_a_unit_is_found_within_what_is_claimed(stand: bool, seed: int) -> None:
    """chi^2 of 24 and 28 degrees: 99.9 % lie below 51 and 57."""
    done = calibrated(seed, 4.0, stand)
    assert done.second < (57.0 if stand else 51.0)
    assert np.max(np.abs(done.normal)) < 4.0
    assert done.first < 57.0 or not stand  # 71 when the first pass takes no products of unknown angles into account
    assert done.nis == pytest.approx(1.0, abs=0.02)  # 81,000 innovations


@pytest.mark.parametrize(
    ("multiplier", "first"), [(4.0, 32.0), (1.0, 50.3)], ids=["B", "A"]
)  # of the first pass by its own covariance; by the second's, as sources instruments 5.3 has them: 31 and 58
def test_two_passes_are_consistent_and_one_is_not(multiplier: float, first: float) -> None:
    """24 states, 40 units: the mean of NEES is 24 +- 1.1 when errors are what the covariance says."""
    done = [calibrated(seed, multiplier, False) for seed in range(40)]
    assert np.mean([d.second for d in done]) == pytest.approx(24.0, abs=3.0)
    assert np.mean([d.first for d in done]) == pytest.approx(first, abs=1.0)
    rms = np.sqrt(np.mean([d.normal**2 for d in done], axis=0))
    assert np.all((rms > 0.65) & (rms < 1.4))  # of 40: 1 +- 0.11


def test_the_stand_is_consistent_too() -> None:
    """28 states, 16 units: 28 +- 1.9."""
    done = [calibrated(seed, 4.0, True) for seed in range(16)]
    assert np.mean([d.second for d in done]) == pytest.approx(28.0, abs=5.6)
    assert np.mean([d.first for d in done]) == pytest.approx(32.3, abs=1.0)

"""Coloured errors of the receiver: states of the filter, and what a filter without them makes of such a receiver."""

from __future__ import annotations

import math

import numpy as np
import pytest
from koi_flight import LEGS, ON_GROUND_LEGS, Drawn, Truth
from psabench.native.flight_model import Flight
from psabench.native.koi import Kind, Koi, KoiConfig, Reason, UnitClass, koi_default, koi_layout, koi_prior
from psabench.native.nav import Refused
from psabench.native.sins import error_nees
from scipy import stats

UNITS = 40
SLOW_M, SLOW_MPS, WHITE_MPS = (3.0, 2.0, 5.0), (0.1, 0.1, 0.15), 0.05


def coloured(unit_class: UnitClass = UnitClass.BINS) -> KoiConfig:
    cfg = koi_default(unit_class)
    cfg.velocity_sd_mps[:] = [WHITE_MPS] * 3
    cfg.slow_r_sd_m[:], cfg.slow_v_sd_mps[:] = SLOW_M, SLOW_MPS
    return cfg


@pytest.fixture(scope="module")
def whole() -> Truth:
    path = Flight(LEGS, heading_deg=30.0)
    return Truth.of(path, 0, path.end_ns // 10**9 * 10**9)


@pytest.fixture(scope="module")
def ground() -> Truth:
    path = Flight(LEGS, heading_deg=30.0)
    return Truth.of(path, 0, path.leg_ns[ON_GROUND_LEGS] // 10**9 * 10**9)


def flown(cfg: KoiConfig, truth: Truth, seed: int, seconds: int) -> tuple[Drawn, Koi]:
    d = Drawn.of(cfg, truth, koi_prior(cfg, truth.state(0)), seed, coloured())
    koi = d.start()
    d.fly(koi, 0, seconds)
    return d, koi


def mean_nees(cfg: KoiConfig, truth: Truth, units: int) -> tuple[float, int]:
    found = []
    for seed in range(units):
        d, koi = flown(cfg, truth, seed, len(truth) // 100)
        found.append(error_nees(koi.x - d.true_x(koi, len(truth)), koi.p))
    return float(np.mean(found)), koi.n


def test_errors_are_what_the_covariance_says_where_the_colour_is_in_the_state(whole: Truth) -> None:
    mean, n = mean_nees(coloured(), whole, UNITS)
    low, high = (float(x) / UNITS for x in stats.chi2.interval(0.999, UNITS * n))
    print(f"NEES {mean:.1f} of {n}, band {low:.1f} to {high:.1f}")
    assert n == 39
    assert low < mean < high


def test_a_filter_that_takes_the_colour_for_white_is_too_sure_of_itself(whole: Truth) -> None:
    """One standard deviation for both parts: several times the squared errors that the covariance says."""
    cfg = koi_default(UnitClass.BINS)
    cfg.velocity_sd_mps[:] = [math.hypot(WHITE_MPS, slow) for slow in SLOW_MPS]
    mean, n = mean_nees(cfg, whole, 6)
    print(f"NEES {mean:.1f} of {n}")
    assert mean > 1.8 * n


def test_a_filter_with_noise_of_the_same_spectrum_at_zero_is_not(whole: Truth) -> None:
    """Variance white + slow 2 tau/T, without states: nearly as good, but its innovations are far too small for it."""
    cfg = koi_default(UnitClass.BINS)
    for sd, slow, white in (("position_sd_m", SLOW_M, (5.0, 5.0, 8.0)), ("velocity_sd_mps", SLOW_MPS, [WHITE_MPS] * 3)):
        getattr(cfg, sd)[:] = [math.hypot(w, s * math.sqrt(2.0 * cfg.slow_s)) for w, s in zip(white, slow, strict=True)]
    mean, n = mean_nees(cfg, whole, 6)
    _, koi = flown(cfg, whole, 7, 600)
    taken = koi.state.taken[Kind.VELOCITY]
    print(f"NEES {mean:.1f} of {n}, innovations {taken.nis_sum / taken.nis_dof:.3f}")
    assert mean < 1.3 * n
    assert taken.nis_sum / taken.nis_dof < 0.05


def test_innovations_are_white_by_the_states(ground: Truth) -> None:
    _, koi = flown(coloured(), ground, 3, 270)
    for kind in (Kind.POSITION, Kind.VELOCITY):
        taken = koi.state.taken[kind]
        low, high = (float(x) / taken.nis_dof for x in stats.chi2.interval(0.999, taken.nis_dof))
        assert low < taken.nis_sum / taken.nis_dof < high
        assert taken.counts[Reason.GATED] < 4


def test_slow_errors_decay_and_are_driven_as_gauss_markov_ones(ground: Truth) -> None:
    cfg, at = coloured(), ground.state(0)
    cfg.slow_s = 40.0
    rows, p, koi = koi_layout(cfg), koi_prior(cfg, at), Koi(cfg, 0.0, at)
    koi.push(ground.dtheta_rad[:10], ground.dv_mps[:10])
    phi, q = koi.jacobians()
    keep = math.exp(-cfg.step_s / 40.0)
    for name, sd in (("slow_r", SLOW_M), ("slow_v", SLOW_MPS)):
        assert np.sqrt(np.diag(p)[rows[name]]) == pytest.approx(sd)
        assert np.diag(phi)[rows[name]] == pytest.approx(keep, rel=1e-12)
        assert np.diag(q)[rows[name]] == pytest.approx(np.square(sd) * (1.0 - keep**2), rel=1e-9)
        assert np.diag(koi.p)[rows[name]] == pytest.approx(np.square(sd), rel=1e-9)  # stationary
    assert np.count_nonzero(phi[rows["slow_r"].start : rows["slow_v"].stop]) == 6


def test_a_correction_leaves_the_receivers_errors_in_the_filter(ground: Truth) -> None:
    _, koi = flown(coloured(), ground, 4, 100)
    x, hybrid, own = koi.x, koi.state.hybrid.row(), slice(koi.layout["slow_r"].start, koi.layout["slow_v"].stop)
    assert x[own].all()
    koi.correct(np.ones(koi.n, bool))
    assert np.array_equal(koi.x[own], x[own])
    assert not koi.x[:9].any()
    assert koi.state.hybrid.row() == pytest.approx(hybrid, abs=1e-9)


def test_only_what_is_set_is_in_the_state() -> None:
    cfg = koi_default()
    assert koi_layout(cfg)["slow_v"].stop == koi_layout(cfg)["baro"].stop
    cfg.slow_v_sd_mps[2] = 0.1
    rows = koi_layout(cfg)
    assert (rows["slow_r"].stop - rows["slow_r"].start, rows["slow_v"].stop - rows["slow_v"].start) == (0, 3)
    cfg.slow_s = 0.0
    with pytest.raises(Refused, match="slow_s"):
        koi_layout(cfg)

"""The estimators of the gyrocompass library against rotation matrices and NumPy: noise-free, covariance, weights."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from nav_reference import DEG, SOME_NOISE, Floats, off_deg, positions
from psabench.native import nav
from psabench.native.nav import ARCMIN, DEGPH, EARTH_RADPS, Flag, Method, Noise, Position
from scipy import optimize, stats

FREE = (Method.LSQ, Method.GLS)
FIT_ANY = (Method.LSQ, Method.CONSTRAINED, Method.GLS, Method.GLS_CONSTRAINED)


# ---- noise-free ----


@pytest.mark.parametrize("latitude_deg", [-80, -50, 0, 30, 60, 80])
@pytest.mark.parametrize("tilt_deg", [(0, 0), (5, 5), (5, -5), (-5, 5), (-5, -5)])
def test_three_positions_give_north_for_every_step_latitude_and_tilt(
    latitude_deg: float, tilt_deg: tuple[float, float]
) -> None:
    latitude = latitude_deg * DEG
    tilt = (tilt_deg[0] * DEG, tilt_deg[1] * DEG)
    worst = 0.0
    for step_deg, alpha_deg in itertools.product((30, 45, 60, 75, 90, 105, 120, 150), range(-180, 180, 40)):
        rows = positions(latitude, alpha_deg * DEG, np.arange(3) * step_deg * DEG, tilt=tilt)
        for method in Method:
            r = nav.gyrocompass(rows, latitude_rad=latitude, method=method, noise=SOME_NOISE)
            worst = max(worst, off_deg(r, alpha_deg * DEG))
            assert r.drift1_radps == pytest.approx(25 * DEGPH, abs=1e-9 * DEGPH)
            assert r.quality < 1e-9
    assert worst < 1e-9


@pytest.mark.parametrize("seed", range(20))
def test_positions_of_any_number_and_order_give_north_and_a_ramp(seed: int) -> None:
    rng = np.random.default_rng(seed)
    latitude, alpha = rng.uniform(-80, 80) * DEG, rng.uniform(-np.pi, np.pi)
    turns = np.r_[0.0, rng.uniform(-400, 400, rng.integers(4, 63)) * DEG]
    ramp = rng.normal() * 1e-3 * DEGPH
    tilt = (rng.uniform(-5, 5) * DEG, rng.uniform(-5, 5) * DEG)
    rows = positions(latitude, alpha, turns, ramp_radps2=ramp, tilt=tilt)
    for method in FIT_ANY:
        r = nav.gyrocompass(rows, latitude_rad=latitude, method=method, ramp=True, noise=SOME_NOISE)
        assert off_deg(r, alpha) < 1e-9
        assert r.ramp_radps2 == pytest.approx(ramp, abs=1e-9 * DEGPH)
        assert r.drift1_radps == pytest.approx(25 * DEGPH, abs=1e-9 * DEGPH)
        assert r.residual_rms_radps < 1e-9 * DEGPH


def test_the_printed_solution_is_wrong_by_up_to_half_a_turn() -> None:
    alphas = np.arange(-180, 180, 5) * DEG
    errors = []
    for alpha in alphas:
        rows = positions(50 * DEG, alpha, np.arange(3) * 90 * DEG)
        printed, drift = nav.gyrocompass_printed(rows, 50 * DEG)
        errors.append(abs(math.degrees(math.remainder(printed - alpha, 2 * math.pi))))
        assert drift == pytest.approx(50 * DEGPH, rel=0.001)
    assert max(errors) > 150.0
    assert np.median(errors) > 30.0


@pytest.mark.parametrize(("beta_arcmin", "want_deg"), [(10.0, 0.0206), (0.5, 0.00103)])
def test_simplified_coefficients_cost_in_proportion_to_beta(beta_arcmin: float, want_deg: float) -> None:
    """(14) leaves sin(gamma) sin(beta) out, 7 deg by beta. A loop with m1 = 1 rests half an arc minute off level."""
    worst = 0.0
    for alpha_deg, signs in itertools.product(range(0, 360, 15), ((5, 5), (5, -5), (-5, 5))):
        tilt = (signs[0] * DEG, signs[1] * DEG)
        turns = np.arange(3) * 90 * DEG
        rows = positions(50 * DEG, alpha_deg * DEG, turns, tilt=tilt, betas_rad=[beta_arcmin * ARCMIN] * 3)
        r = nav.gyrocompass(rows, latitude_rad=50 * DEG, method=Method.CLOSED3, simplified=True)
        worst = max(worst, off_deg(r, alpha_deg * DEG))
        assert Flag.SIMPLIFIED in r.flags
    assert worst == pytest.approx(want_deg, rel=0.01)


# ---- noise ----


def simulated_cov(noise: Noise, latitude_rad: float, rows: list[Position], alpha_rad: float) -> tuple[Floats, Floats]:
    """Covariance of S, and standard deviation of S by each angle: integrals by the midpoint rule."""
    n, fine = len(rows), 200
    t = np.array([[p.t_mid_s + p.window_s * ((k + 0.5) / fine - 0.5) for k in range(fine)] for p in rows])
    cov = np.empty((n, n))
    for i, j in itertools.product(range(n), repeat=2):
        lag = np.abs(t[i][:, None] - t[j][None, :])
        cov[i, j] = noise.gm_sigma_radps**2 * np.exp(-lag / noise.gm_tau_s).mean()
    cov += np.diag([noise.white_radps_rts**2 / p.window_s for p in rows])
    wz, we = EARTH_RADPS * math.sin(latitude_rad), EARTH_RADPS * math.cos(latitude_rad)
    cov += np.eye(n) * (noise.window_sd_radps**2 + (wz * noise.level_sd_rad) ** 2)
    slope = np.array([we * math.cos(alpha_rad + p.delta_rad) for p in rows])
    return cov, slope * noise.angle_sd_rad


@pytest.mark.parametrize("method", Method)
def test_the_covariance_is_consistent(method: Method) -> None:
    """Normalised squared error of alpha and drift within the band of chi-square, whatever the weights."""
    noise = Noise(
        gm_sigma_radps=0.1 * DEGPH,
        gm_tau_s=300.0,
        white_radps_rts=0.1 * DEGPH,
        window_sd_radps=0.02 * DEGPH,
        angle_sd_rad=1.0 * ARCMIN,
        level_sd_rad=1.0 * ARCMIN,
    )
    rng = np.random.default_rng(7)
    latitude, runs = 50 * DEG, 1500
    deltas = (np.arange(3) if method is Method.CLOSED3 else np.array([0, 2, 1, 3, 0, 2, 1, 3])) * 90 * DEG
    nees, platform_errors, sds = [], [], []
    for alpha in rng.uniform(-np.pi, np.pi, 10):
        rows = positions(latitude, alpha, deltas)
        cov, angle = simulated_cov(noise, latitude, rows, alpha)
        root = np.linalg.cholesky(cov)
        for _ in range(runs // 10):
            z = rng.standard_normal(len(rows))
            noisy = np.array([p.s_radps for p in rows]) + root @ rng.standard_normal(len(rows)) + angle * z
            moved = [replace(p, s_radps=s) for p, s in zip(rows, noisy, strict=True)]
            r = nav.gyrocompass(moved, latitude_rad=latitude, method=method, noise=noise)
            error = np.array(
                [math.remainder(r.alpha1_rad - alpha, 2 * math.pi), (r.drift1_radps - 25 * DEGPH)]
            ) / np.array([1.0, DEGPH])
            p = r.cov[:2, :2] / np.outer([1.0, DEGPH], [1.0, DEGPH])
            nees.append(error @ np.linalg.solve(p, error))
            platform_errors.append(error[0] - noise.angle_sd_rad * z[0])
            sds.append(r.platform_sd_rad)
            assert r.alpha1_half95_rad == pytest.approx(1.96 * math.sqrt(r.cov[0, 0]), rel=1e-4)
    low, high = stats.chi2.ppf([0.0005, 0.9995], 2 * runs) / runs
    assert low < np.mean(nees) < high
    assert np.std(platform_errors) == pytest.approx(np.sqrt(np.mean(np.square(sds))), rel=0.1)


def numpy_gls(rows: list[Position], latitude_rad: float, noise: Noise) -> tuple[Floats, float]:
    """(s, c, drift) of the free weighted fit and alpha on the circle, weights with cos^2 = 1/2 for the angles."""
    we = EARTH_RADPS * math.cos(latitude_rad)
    a, b = [], []
    for p in rows:
        sgsb = math.sin(p.gamma_rad) * math.sin(p.beta_rad)
        a.append(we * (math.cos(p.delta_rad) * math.cos(p.gamma_rad) - math.sin(p.delta_rad) * sgsb))
        b.append(we * (math.sin(p.delta_rad) * math.cos(p.gamma_rad) + math.cos(p.delta_rad) * sgsb))
    design, s = np.column_stack([a, b, np.full(len(a), we)]), np.array([p.s_radps for p in rows])
    cov = simulated_cov(noise, latitude_rad, rows, 0.0)[0] + 0.5 * (we * noise.angle_sd_rad) ** 2 * np.eye(len(rows))
    white = np.linalg.inv(np.linalg.cholesky(cov)) * we
    free = np.linalg.lstsq(white @ design / we, white @ s / we, rcond=None)[0]

    def left(x: Floats) -> Floats:
        residual = white @ (design @ np.array([math.sin(x[0]), math.cos(x[0]), x[1]]) - s) / we
        return np.asarray(residual, dtype=np.float64)

    start = np.array([math.atan2(free[0], free[1]), free[2]])
    return free * np.array([1, 1, we]), float(
        optimize.least_squares(left, start, xtol=1e-15, ftol=1e-15, gtol=1e-15).x[0]
    )


@pytest.mark.parametrize("seed", range(8))
def test_the_weighted_fits_are_those_of_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    noise = Noise(gm_sigma_radps=0.1 * DEGPH, gm_tau_s=100.0, white_radps_rts=0.2 * DEGPH,
                  window_sd_radps=0.03 * DEGPH, angle_sd_rad=5 * ARCMIN, level_sd_rad=5 * ARCMIN)  # fmt: skip
    alpha = rng.uniform(-np.pi, np.pi)
    rows = positions(50 * DEG, alpha, rng.uniform(-np.pi, np.pi, 7), tilt=(3 * DEG, -4 * DEG))
    rows = [replace(p, s_radps=p.s_radps + rng.normal() * 0.5 * DEGPH) for p in rows]
    free, on_circle = numpy_gls(rows, 50 * DEG, noise)
    r = nav.gyrocompass(rows, latitude_rad=50 * DEG, method=Method.GLS, noise=noise)
    assert (r.s, r.c, r.drift1_radps / DEGPH) == pytest.approx((free[0], free[1], free[2] / DEGPH), abs=1e-5)
    c = nav.gyrocompass(rows, latitude_rad=50 * DEG, method=Method.GLS_CONSTRAINED, noise=noise)
    assert math.remainder(c.alpha1_rad - on_circle, 2 * math.pi) == pytest.approx(0.0, abs=1e-5)
    assert c.quality == r.quality


def test_an_angles_error_counts_once_for_the_heading_and_otherwise_for_the_platform() -> None:
    """Sources instruments 1.5: 3' of each angle are 0.0395 deg of heading and 0.053 deg of the platform."""
    found = [
        nav.gyrocompass(positions(50 * DEG, a, np.arange(3) * 90 * DEG), latitude_rad=50 * DEG, method=Method.CLOSED3,
                        noise=Noise(angle_sd_rad=3 * ARCMIN))
        for a in np.arange(0, 2 * np.pi, 0.1)
    ]  # fmt: skip
    assert math.degrees(np.sqrt(np.mean([r.alpha1_sd_rad**2 for r in found]))) == pytest.approx(0.0395, abs=0.0003)
    assert math.degrees(np.sqrt(np.mean([r.platform_sd_rad**2 for r in found]))) == pytest.approx(0.0530, abs=0.0003)


def test_weights_by_the_drifts_covariance_help_as_much_as_they_should() -> None:
    """Sources instruments 1.7: nothing for three positions, 19 % for four in a row."""
    noise = Noise(gm_sigma_radps=0.2 * DEGPH, angle_sd_rad=0.5 * ARCMIN)
    for count, gain in ((3, 0.0), (4, 0.19)):
        rows = positions(50 * DEG, 0.3, np.arange(count) * 90 * DEG)
        sd = {}
        for method in FREE:
            cov = [
                nav.gyrocompass(positions(50 * DEG, a, np.arange(count) * 90 * DEG), latitude_rad=50 * DEG,
                                method=method, noise=noise).cov[0, 0]
                for a in np.arange(0, 2 * np.pi, 0.2)
            ]  # fmt: skip
            sd[method] = math.sqrt(np.mean(cov))
        assert 1 - sd[Method.GLS] / sd[Method.LSQ] == pytest.approx(gain, abs=0.03), rows


@pytest.mark.parametrize(
    ("a_s", "b_s", "gap_s"), [(10, 10, 0), (10, 10, 20), (5, 30, 40), (600, 900, 800), (0.01, 0.01, 1)]
)
def test_the_window_covariance_is_the_integral(a_s: float, b_s: float, gap_s: float) -> None:
    t_a, t_b = (np.arange(2000) + 0.5) / 2000 - 0.5, (np.arange(1999) + 0.5) / 1999 - 0.5
    lag = np.abs(a_s * t_a[:, None] - (gap_s + (b_s if gap_s else a_s) * t_b[None, :]))
    want = np.exp(-lag / 1000).mean()
    assert nav.gm_window_cov(1.0, 1000.0, a_s, b_s if gap_s else a_s, gap_s) == pytest.approx(want, rel=1e-5)


@pytest.mark.parametrize(("hours", "from_zero", "want_deg"), [(4.0, False, 0.288), (4.0, True, 0.282)])
def test_the_integrated_drift_of_four_hours(hours: float, from_zero: bool, want_deg: float) -> None:
    sd = nav.gm_integral_sd_rad(0.2 * DEGPH, 1000.0, hours * 3600, from_zero=from_zero)
    assert math.degrees(sd) == pytest.approx(want_deg, abs=0.001)
    hold = nav.Hold(
        heading_sd_rad=0.1 * DEG, drift_sd_radps=0.05 * DEGPH, gm_sigma_radps=0.2 * DEGPH, gm_from_zero=from_zero
    )
    assert math.degrees(nav.hold_sd_rad(hold, hours * 3600)) == pytest.approx(math.hypot(0.1, 0.2, want_deg), abs=0.001)

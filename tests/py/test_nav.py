"""The gyrocompass library against rotation matrices and NumPy: estimators, attitude, noise, refusals."""

from __future__ import annotations

import ctypes as c
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from nav_reference import DEG, SOME_NOISE, Floats, off_deg, platform, positions, vehicle
from psabench import nav, nav_mc
from psabench.errors import BadInput
from psabench.nav import ARCMIN, DEGPH, EARTH_RADPS, Flag, Method, Noise, Position, Rest, Status
from psabench.navlib import McHoldStruct, McStruct, library
from scipy import optimize, stats

from tests.bench import numpy_gyrocompass

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


# ---- attitude, gimbal, azimuth ----


def test_block_1_is_the_geometry_of_the_gimbals() -> None:
    """x_p is perpendicular to the outer axis z_c, whatever alpha, beta and the attitude."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        alpha, psi = rng.uniform(-np.pi, np.pi, 2)
        beta, pitch, roll = rng.uniform(-10, 10, 3) * DEG
        gamma = nav.gamma(alpha_rad=alpha, beta_rad=beta, psi_rad=psi, pitch_rad=pitch, roll_rad=roll)
        x_p = platform(alpha, beta, gamma)[:, 0]
        assert abs(x_p @ vehicle(psi, pitch, roll)[:, 2]) < 1e-14


def test_alpha_heading_and_attitude_come_back_from_the_gimbal() -> None:
    rng = np.random.default_rng(2)
    for _ in range(100):
        psi = rng.uniform(0, 2 * np.pi)
        pitch, roll, bias = rng.uniform(-8, 8) * DEG, rng.uniform(-8, 8) * DEG, rng.uniform(-20, 20) * ARCMIN
        q = rng.uniform(-np.pi, np.pi) + np.array([0, 1.4, 3.0, 4.2])
        beta = rng.uniform(-20, 20, 4) * ARCMIN
        alpha, gamma = np.empty(4), np.empty(4)
        for i in range(4):
            alpha[i] = nav.alpha(psi_rad=psi, q_rad=q[i], beta_rad=beta[i], pitch_rad=pitch, roll_rad=roll)
            gamma[i] = nav.gamma(alpha_rad=alpha[i], beta_rad=beta[i], psi_rad=psi, pitch_rad=pitch, roll_rad=roll)
            c_lc = vehicle(psi, pitch, roll)
            x_p = math.cos(q[i]) * c_lc[:, 0] + math.sin(q[i]) * c_lc[:, 1]
            assert platform(alpha[i], beta[i], gamma[i])[:, 0] == pytest.approx(x_p, abs=1e-14)
            back = nav.heading(alpha[i], q[i], beta_rad=beta[i], pitch_rad=pitch, roll_rad=roll)
            assert math.remainder(back - psi, 2 * math.pi) == pytest.approx(0.0, abs=1e-13)
        told = nav.attitude_from_level(q, gamma, beta)
        assert (told.pitch_rad, told.roll_rad) == pytest.approx((pitch, roll), abs=1e-13)
        biased = nav.attitude_from_level(q, gamma + bias, beta, bias=True)
        assert (biased.pitch_rad, biased.roll_rad, biased.gamma_bias_rad) == pytest.approx(
            (pitch, roll, bias), abs=3e-5
        )
        delta = nav.cardan(q, pitch_rad=pitch, roll_rad=roll, beta_rad=beta)
        assert np.exp(1j * delta) == pytest.approx(np.exp(1j * (alpha - alpha[0])), abs=1e-12)
        assert np.abs(delta - (q - q[0])).max() < 0.1


@pytest.mark.parametrize(("tilt_deg", "want_arcmin"), [(5, 26.2), (2, 4.2), (1, 1.05)])
def test_a_quarter_turn_of_a_tilted_gimbal_is_wrong_by_so_much(tilt_deg: float, want_arcmin: float) -> None:
    tilt = tilt_deg * DEG
    worst = 0.0
    for first in np.arange(0, 360, 5) * DEG:
        steps = nav.cardan(first + np.arange(3) * 90 * DEG, pitch_rad=tilt, roll_rad=tilt)
        worst = max(worst, abs(steps[1] - 90 * DEG) / ARCMIN)
        assert steps[2] == pytest.approx(math.pi, abs=1e-14)
    assert worst == pytest.approx(want_arcmin, rel=0.01)


def test_the_azimuth_torquer_tells_the_other_drift() -> None:
    latitude = 50 * DEG
    earth = EARTH_RADPS * np.array([0.0, math.cos(latitude), math.sin(latitude)])
    rng = np.random.default_rng(3)
    for _ in range(50):
        alpha, (beta, gamma) = rng.uniform(-np.pi, np.pi), rng.uniform(-5, 5, 2) * DEG
        s_az = float(platform(alpha, beta, gamma)[:, 2] @ earth) + 25 * DEGPH
        found = nav.azimuth_drift(s_az, latitude_rad=latitude, alpha_rad=alpha, beta_rad=beta, gamma_rad=gamma)
        assert found == pytest.approx(25 * DEGPH, abs=1e-12 * DEGPH)
        wrong = nav.azimuth_drift(
            s_az, latitude_rad=latitude, alpha_rad=alpha, beta_rad=beta, gamma_rad=gamma + 10 * ARCMIN
        )
        sd = nav.azimuth_drift_sd(latitude_rad=latitude, alpha_rad=alpha, beta_sd_rad=0.0, gamma_sd_rad=10 * ARCMIN)
        assert abs(wrong - found) == pytest.approx(sd, abs=0.005 * DEGPH)
    sd = nav.azimuth_drift_sd(latitude_rad=latitude, alpha_rad=math.pi / 2, beta_sd_rad=0.0, gamma_sd_rad=10 * ARCMIN)
    assert sd / DEGPH == pytest.approx(0.028, abs=0.0005)
    assert nav.transport_radps(500 / 3.6, latitude) / DEGPH == pytest.approx(5.36, abs=0.005)


# ---- the loop at rest ----


def closed_loop(
    s_true: float, m1: float, noise_rad: float, count: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """beta_n and the command of a levelling loop, 100 Hz, that has been at work for 8 s."""
    beta, measured, commands = -s_true / m1, np.empty(count + 800), np.empty(count + 800)
    for k in range(count + 800):
        measured[k] = beta + noise_rad * rng.standard_normal()
        commands[k] = -m1 * measured[k]
        beta += 0.01 * (commands[k] - s_true)
    return measured[800:], commands[800:]


def test_the_slope_of_a_window_obeys_its_noise_law_and_the_mean_its_own() -> None:
    """White noise of 1' a sample, 10 s, m1 = 1: 0.66 deg/h by the slope, 0.6 by the mean (sources instruments 1.4)."""
    rng = np.random.default_rng(4)
    s_true = 30 * DEGPH
    slopes, means = [], []
    for _ in range(400):
        measured, commands = closed_loop(s_true, 1.0, ARCMIN, 1000, rng)
        slopes.append(nav.window_slope(measured, commands, 0.01) / DEGPH)
        means.append(commands.mean() / DEGPH)
    assert np.std(slopes) == pytest.approx(0.66, rel=0.1)
    assert np.std(means) == pytest.approx(0.60, rel=0.1)
    assert np.mean(slopes) == pytest.approx(30.0, abs=0.12)
    for seconds, want in ((20, 0.23), (30, 0.127), (60, 0.045)):
        quiet = [
            nav.window_slope(*closed_loop(s_true, 1.0, ARCMIN, 100 * seconds, rng), 0.01) / DEGPH for _ in range(150)
        ]
        assert np.std(quiet) == pytest.approx(want, rel=0.2)
    measured, commands = closed_loop(s_true, 1.0, 0.0, 1000, rng)
    assert nav.window_slope(measured, commands, 0.01) == pytest.approx(s_true, rel=1e-9)


def test_rest_is_where_the_equations_balance() -> None:
    """(7) with nothing moving: torque of x against the Earth's rate by matrices, with every error of the device."""
    rng = np.random.default_rng(5)
    for _ in range(50):
        at = Rest(
            latitude_rad=rng.uniform(-1, 1),
            alpha_rad=rng.uniform(-np.pi, np.pi),
            gamma_rad=rng.uniform(-5, 5) * DEG,
            drift1_radps=25 * DEGPH,
            m1_per_s=rng.uniform(0.5, 2),
            latitude_error_rad=rng.normal() * ARCMIN,
            torquer_scale1=rng.normal() * 1e-3,
            beta_error_rad=rng.normal() * 10 * ARCMIN,
            gamma_error_rad=rng.normal() * 10 * ARCMIN,
        )
        s, beta = nav.rest_s_radps(at)
        beta_n, gamma_n = beta + at.beta_error_rad, at.gamma_rad + at.gamma_error_rad
        assert s == pytest.approx(-at.m1_per_s * beta_n, abs=1e-15)
        wz_n = EARTH_RADPS * math.sin(at.latitude_rad + at.latitude_error_rad)
        torque = (s - wz_n * math.cos(beta_n) * math.sin(gamma_n)) * (1 + at.torquer_scale1) - at.drift1_radps
        earth = EARTH_RADPS * np.array([0.0, math.cos(at.latitude_rad), math.sin(at.latitude_rad)])
        assert torque == pytest.approx(float(platform(at.alpha_rad, beta, at.gamma_rad)[:, 0] @ earth), abs=1e-18)


# ---- refusals and flags ----


def good() -> list[Position]:
    return positions(50 * DEG, 0.5, np.arange(4) * 90 * DEG)


@pytest.mark.parametrize(
    ("rows", "options", "status", "word"),
    [
        (good()[:2], {}, Status.TOO_FEW, "too few"),
        ([], {}, Status.TOO_FEW, "too few"),
        (good(), {"method": Method.CLOSED3}, Status.TOO_FEW, "exactly three"),
        (good()[:3], {"ramp": True, "method": Method.LSQ}, Status.TOO_FEW, "four with a ramp"),
        (good() * 17, {}, Status.TOO_FEW, "64 at most"),
        ([good()[0], good()[2], good()[0]], {}, Status.COINCIDENT, "coincide"),
        ([replace(p, delta_rad=0.3 * DEG * i) for i, p in enumerate(good())], {}, Status.COINCIDENT, "coincide"),
        (good(), {"latitude_rad": 90 * DEG}, Status.LATITUDE, "85 degrees"),
        (good(), {"latitude_rad": -85.1 * DEG}, Status.LATITUDE, "85 degrees"),
        (good(), {"latitude_rad": math.nan}, Status.NOT_FINITE, "not finite"),
        ([replace(p, gamma_rad=math.inf) for p in good()], {}, Status.NOT_FINITE, "not finite"),
        ([replace(p, gamma_rad=1.0) for p in good()], {}, Status.RANGE, "tilt beyond"),
        (good(), {"noise": Noise(angle_sd_rad=-1.0)}, Status.RANGE, "negative noise"),
        ([replace(p, t_mid_s=0.0) for p in good()], {"noise": SOME_NOISE}, Status.TIMES, "follow one another"),
        ([replace(p, window_s=30.0) for p in good()], {"noise": SOME_NOISE}, Status.TIMES, "follow one another"),
        ([replace(p, window_s=0.0) for p in good()], {"noise": SOME_NOISE}, Status.TIMES, "follow one another"),
    ],
)  # fmt: skip
def test_what_cannot_be_answered_is_refused_in_words(
    rows: list[Position], options: dict[str, object], status: Status, word: str
) -> None:
    with pytest.raises(nav.Refused, match=word) as refused:
        nav.gyrocompass(rows, **({"latitude_rad": 50 * DEG} | options))  # type: ignore[arg-type]
    assert refused.value.status is status
    assert isinstance(refused.value, BadInput)


def test_the_other_functions_refuse_too() -> None:
    with pytest.raises(nav.Refused, match="coincide"):
        nav.attitude_from_level([0.0, math.pi, 2 * math.pi], [0.1, -0.1, 0.1])
    with pytest.raises(nav.Refused, match="too few"):
        nav.attitude_from_level([0.0, 1.0], [0.1, 0.1], bias=True)
    with pytest.raises(nav.Refused, match="not finite"):
        nav.cardan([0.0, math.nan], pitch_rad=0.0, roll_rad=0.0)
    with pytest.raises(nav.Refused, match="too few"):
        nav.window_slope([1.0, 2.0], [1.0, 2.0], 0.01)
    with pytest.raises(nav.Refused, match="too few"):
        nav.gyrocompass_printed(good(), 50 * DEG)
    with pytest.raises(ValueError, match="as many"):
        nav.window_slope([1.0, 2.0, 3.0], [1.0, 2.0], 0.01)


@pytest.mark.parametrize(
    ("step_deg", "warned"), [(30, True), (39, True), (41, False), (90, False), (170, False), (178, True)]
)
def test_a_poor_geometry_is_flagged(step_deg: float, warned: bool) -> None:
    rows = positions(50 * DEG, 0.5, np.arange(3) * step_deg * DEG)
    r = nav.gyrocompass(rows, latitude_rad=50 * DEG, method=Method.CLOSED3)
    step = step_deg * DEG
    assert r.geometry == pytest.approx(abs(4 * math.sin(step / 2) ** 2 * math.sin(step)), rel=1e-3)
    assert (Flag.POOR_GEOMETRY in r.flags) is warned
    assert any("below 40" in w for w in r.warnings) is warned


def test_a_wrong_latitude_is_seen_when_it_is_large() -> None:
    """hypot(s, c) is cos(true)/cos(given): half a degree at 50 deg is 1 %; heading does not suffer."""
    rows = positions(50 * DEG, 0.5, np.arange(3) * 90 * DEG)
    near = nav.gyrocompass(rows, latitude_rad=50.3 * DEG, method=Method.CLOSED3)
    far = nav.gyrocompass(rows, latitude_rad=50.7 * DEG, method=Method.CLOSED3)
    assert Flag.POOR_QUALITY not in near.flags
    assert Flag.POOR_QUALITY in far.flags
    assert far.quality == pytest.approx(math.cos(50 * DEG) / math.cos(50.7 * DEG) - 1, rel=1e-3)
    assert off_deg(far, 0.5) < 0.01


# ---- Monte-Carlo: the two models and Python ----


def same_struct(a: c.Structure, b: c.Structure) -> None:
    for name, *_ in a._fields_:
        x, y = getattr(a, name), getattr(b, name)
        if isinstance(x, c.Structure):
            same_struct(x, y)
        elif isinstance(x, c.Array):
            assert list(x) == pytest.approx(list(y), abs=1e-15), name
        else:
            assert x == pytest.approx(y, rel=1e-14, nan_ok=True), name


def test_the_defaults_of_python_are_those_of_the_library() -> None:
    default = McStruct()
    library().mc_default(c.byref(default))
    same_struct(nav_mc.config_struct(nav_mc.McConfig()), default)
    hold = McHoldStruct()
    library().mc_hold_default(c.byref(hold))
    same_struct(nav_mc.hold_struct(nav_mc.HoldConfig()), hold)


@pytest.mark.parametrize("model", [nav_mc.closed, nav_mc.samples])
def test_threads_and_batches_change_no_number(model: object) -> None:
    assert callable(model)
    whole = model(nav_mc.McConfig(), 3, runs=1001)
    split = model(nav_mc.McConfig(), 3, runs=1001, threads=3)
    tail = model(nav_mc.McConfig(), 3, first_run=777, runs=224)
    assert np.array_equal(whole.heading_rad, split.heading_rad)
    assert np.array_equal(whole.drift_radps[777:], tail.drift_radps)


def test_results_go_into_arrays_that_exist() -> None:
    first = nav_mc.closed(nav_mc.McConfig(), 3, runs=100)
    heading = first.heading_rad.copy()
    again = nav_mc.closed(nav_mc.McConfig(), 3, first_run=100, runs=100, into=first)
    assert again.heading_rad is first.heading_rad
    assert not np.array_equal(heading, again.heading_rad)
    with pytest.raises(ValueError, match="want arrays of 50"):
        nav_mc.closed(nav_mc.McConfig(), 3, runs=50, into=first)


R0 = nav_mc.McConfig()
TURNED = tuple(np.radians([0.0, 180.0, 90.0, 270.0] * 2))
BELIEF = Noise(gm_sigma_radps=0.2 * DEGPH, angle_sd_rad=0.5 * ARCMIN)
AGREE = {
    "article": R0,
    "no drift": replace(R0, gm_sigma_radps=0.0, simplified=False),
    "from zero, no sign": replace(R0, gm_from_zero=True, random_sign=False),
    "zero 300 s before": replace(R0, gm_from_zero=True, gm_before_s=300.0),
    "increments": replace(R0, angle_sys=nav_mc.AngleSys.INCREMENT),
    "accumulating": replace(R0, angle_sys=nav_mc.AngleSys.ACCUMULATES),
    "per sample": replace(R0, gm_sigma_radps=0.02 * DEGPH, per_sample=True),
    "gimbal uncorrected": replace(R0, gm_sigma_radps=0.02 * DEGPH, cardan=nav_mc.Cardan.UNCORRECTED),
    "gimbal corrected": replace(R0, gm_sigma_radps=0.02 * DEGPH, cardan=nav_mc.Cardan.CORRECTED),
    "corners, scale": replace(R0, tilt=nav_mc.Tilt.CORNERS, torquer_scale=1e-3),
    "level sensors alone": replace(
        R0, gm_sigma_radps=0.0, angle_sys=nav_mc.AngleSys.NONE, angle_random_rad=0.0, gamma_random_rad=0.0,
        beta_random_rad=0.0, gamma_sys_rad=5 * ARCMIN, angles_rad=tuple(np.radians([0.0, 50.0, 130.0])),
    ),
    "fast drift": replace(R0, gm_tau_s=25.0, gap_s=7.0, window_s=3.33),
    "white, constrained": replace(
        R0, white_radps_rts=0.15 * DEGPH, method=Method.CONSTRAINED, latitude_error_rad=10 * ARCMIN
    ),
    "eight, weighted": replace(
        R0, angles_rad=TURNED, method=Method.GLS, noise=BELIEF, angle_random_rad=0.5 * ARCMIN, simplified=False
    ),
    "eight, weighted, circle, ramp": replace(
        R0, angles_rad=TURNED, method=Method.GLS_CONSTRAINED, noise=BELIEF, ramp=True, slew_radps=0.5, settle_s=7.0
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", AGREE)
def test_the_closed_form_and_the_samples_agree(name: str) -> None:
    """Kolmogorov and Smirnov on headings, platform errors, drifts and quality, fixed seeds."""
    many = nav_mc.closed(AGREE[name], 11, runs=200_000)
    few = nav_mc.samples(AGREE[name], 12, runs=3000)
    for field in ("heading_rad", "platform_rad", "drift_radps", "quality", "alpha1_rad"):
        p = stats.ks_2samp(getattr(few, field), getattr(many, field)).pvalue
        assert p > 0.001, f"{field}: p = {p:.2g}"


def test_numpys_version_of_the_model_has_the_same_distribution() -> None:
    """tests/bench/numpy_gyrocompass.py, written from the equations: what the library is timed beside."""
    rng = np.random.default_rng(1)
    batches = [numpy_gyrocompass.batch(R0, 1000, rng) for _ in range(4)]
    for model, runs in ((nav_mc.closed, 200_000), (nav_mc.samples, 8000)):
        ours = model(R0, 13, runs=runs)
        for field in ("heading_rad", "platform_rad", "drift_radps"):
            theirs = np.concatenate([getattr(b, field) for b in batches])
            assert stats.ks_2samp(theirs, getattr(ours, field)).pvalue > 0.001, field


def test_random_numbers_are_gaussian_far_into_the_tails() -> None:
    """White noise alone makes the drift's error a sum of Gaussian numbers."""
    cfg = replace(R0, gm_sigma_radps=0.0, gamma_sys_rad=0.0, beta_sys_rad=0.0, gamma_random_rad=0.0,
                  angle_random_rad=0.0, angle_sys=nav_mc.AngleSys.NONE, simplified=False,
                  white_radps_rts=1e-6, latitude_error_rad=0.0, tilt_rad=0.0)  # fmt: skip
    drift = nav_mc.closed(cfg, 1, runs=4_000_000).drift_radps
    z = drift / (1e-6 / math.sqrt(10) / math.sqrt(2))
    assert np.mean(z) == pytest.approx(0.0, abs=0.003)
    assert np.std(z) == pytest.approx(1.0, abs=0.002)
    for limit in (1, 2, 3, 4, 5):
        want = 2 * stats.norm.sf(limit) * len(z)
        assert abs(np.sum(np.abs(z) > limit) - want) < 5 * math.sqrt(want) + 3
    assert abs(np.corrcoef(z[:-1], z[1:])[0, 1]) < 0.003


def test_monte_carlo_refuses_in_words() -> None:
    with pytest.raises(nav.Refused, match="too few"):
        nav_mc.closed(replace(R0, angles_rad=(0.0, 1.0)), 1, runs=1)
    with pytest.raises(nav.Refused, match="coincide"):
        nav_mc.samples(replace(R0, angles_rad=(0.0, math.pi, 0.0)), 1, runs=1)
    with pytest.raises(nav.Refused, match="schedule"):
        nav_mc.closed(replace(R0, window_s=0.0), 1, runs=1)
    with pytest.raises(ValueError, match="64 at most"):
        nav_mc.closed(replace(R0, angles_rad=tuple(range(65))), 1, runs=1)
    with pytest.raises(ValueError, match="not negative"):
        nav_mc.closed(R0, -1, runs=1)

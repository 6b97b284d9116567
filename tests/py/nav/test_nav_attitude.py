"""Attitude, gimbal, azimuth axis and the loop at rest, against rotation matrices and the equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from nav_reference import DEG, Floats, platform, vehicle
from psabench.native import nav
from psabench.native.nav import ARCMIN, DEGPH, EARTH_RADIUS_M, EARTH_RADPS, Rest

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


def test_python_and_the_library_have_one_earth() -> None:
    at = Rest(latitude_rad=math.radians(60.0), alpha_rad=math.pi / 2)
    assert nav.rest_s_radps(at)[0] / EARTH_RADPS == pytest.approx(0.5, rel=1e-12)
    assert 1.0 / nav.transport_radps(1.0, math.pi / 4) == pytest.approx(EARTH_RADIUS_M, rel=1e-12)


# ---- the loop at rest ----


def closed_loop(
    s_true: float, m1: float, noise_rad: float, count: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """beta_n and the command of a levelling loop, 100 Hz, that has been at work for 8 s."""
    beta, measured, commands = -s_true / m1, list[float](), list[float]()
    for noise in (noise_rad * rng.standard_normal(count + 800)).tolist():  # plain floats: ten times faster than numpy's
        measured.append(beta + noise)
        commands.append(-m1 * measured[-1])
        beta += 0.01 * (commands[-1] - s_true)
    return np.array(measured[800:]), np.array(commands[800:])


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
    assert nav.window_slope(measured, commands, 0.01) == pytest.approx(s_true, rel=1e-9, abs=0.0)


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

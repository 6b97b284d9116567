"""Heading and levelling drift from the windows that count: the attitude, the turns of alpha, the equations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from psabench.estimate.angles import wrapped
from psabench.native import nav
from psabench.native.nav import ARCMIN
from psabench.procedures.gyrocompass_params import METHODS, GyrocompassParams, noise_of
from psabench.procedures.gyrocompass_windows import s_of, s_sd, trusted
from psabench.procedures.platform_bench import Floats, Window


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A position as it enters the equations."""

    number: int
    q_rad: float  # the angle that was trusted
    position: nav.Position
    residual_radps: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """What the windows that count say together."""

    params: GyrocompassParams
    windows: tuple[Window, ...]  # those that count
    rows: tuple[Row, ...]  # one of each
    noise: nav.Noise
    attitude: nav.Attitude
    compass: nav.Compass
    heading_rad: float


def fit(windows: Sequence[Window], p: GyrocompassParams) -> Fit:
    """Raises nav.Refused where these windows do not tell a heading."""
    q = np.array([trusted(w, p) for w in windows])
    attitude = _attitude(q, windows)
    delta = _increments(q, windows, attitude, p)
    positions, noise = _positions(windows, delta, attitude, p), noise_of(p, s_sd(windows, p.slope))
    compass = nav.gyrocompass(
        positions, latitude_rad=p.latitude_rad, method=METHODS[p.method], simplified=p.simplified, noise=noise
    )
    psi = nav.heading(
        compass.alpha1_rad,
        float(q[0]),
        beta_rad=positions[0].beta_rad if p.cardan else 0.0,
        pitch_rad=attitude.pitch_rad if p.cardan else 0.0,
        roll_rad=attitude.roll_rad if p.cardan else 0.0,
    )
    rows = tuple(
        Row(number=w.number, q_rad=float(a), position=r, residual_radps=_residual(r, compass, p))
        for w, a, r in zip(windows, q, positions, strict=True)
    )
    return Fit(
        params=p,
        windows=tuple(windows),
        rows=rows,
        noise=noise,
        attitude=attitude,
        compass=compass,
        heading_rad=psi,
    )


def again(f: Fit, more_radps: Floats, latitude_rad: float | None = None) -> nav.Compass:
    """What the same windows would say if their rates had this added, at this latitude. Raises nav.Refused."""
    p = f.params
    rows = [
        replace(r.position, s_radps=r.position.s_radps + float(more))
        for r, more in zip(f.rows, more_radps, strict=True)
    ]
    return nav.gyrocompass(
        rows,
        latitude_rad=p.latitude_rad if latitude_rad is None else latitude_rad,
        method=METHODS[p.method],
        simplified=p.simplified,
        noise=f.noise,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity:
    """What a rate of each window does to the results, (n,) each."""

    alpha_s: Floats  # of alpha1: rad per rad/s
    drift: Floats  # of the drift: a pure number
    hypot_s: Floats  # of hypot(s, c)


def sensitivity(f: Fit) -> Sensitivity:
    """By differences of a thousandth of We."""
    step_radps = 1e-3 * f.params.we_radps
    found = []
    for one in np.eye(len(f.rows)) * step_radps:
        up, down = again(f, one), again(f, -one)
        turned = wrapped(up.alpha1_rad - down.alpha1_rad)
        size = math.hypot(up.s, up.c) - math.hypot(down.s, down.c)
        found.append((turned, up.drift1_radps - down.drift1_radps, size))
    alpha_s, drift, hypot_s = np.array(found).T / (2.0 * step_radps)
    return Sensitivity(alpha_s=alpha_s, drift=drift, hypot_s=hypot_s)


def rate_covariance(f: Fit) -> Floats:
    """Of what the windows' rates miss the model by, (n, n), (rad/s)^2: the random drift, and all else."""
    return drift_covariance(f) + error_covariance(f)


def drift_covariance(f: Fit) -> Floats:
    """Of the means of the random drift over the windows, (n, n), (rad/s)^2."""
    rows = [r.position for r in f.rows]
    return covariance_of_means(f.noise, np.array([r.t_mid_s for r in rows]), np.array([r.window_s for r in rows]))


def covariance_of_means(n: nav.Noise, t_mid_s: Floats, length_s: Floats) -> Floats:
    """Of the means of the random drift over spans that do not overlap, (n, n), (rad/s)^2."""
    spans = list(zip(map(float, t_mid_s), map(float, length_s), strict=True))

    def of(a_s: float, a_length_s: float, b_s: float, b_length_s: float) -> float:
        return nav.gm_window_cov(n.gm_sigma_radps, n.gm_tau_s, a_length_s, b_length_s, abs(a_s - b_s))

    return np.array([[of(*a, *b) for b in spans] for a in spans])


def error_covariance(f: Fit) -> Floats:
    """Of what else the rates miss the model by, (n, n), (rad/s)^2.

    Noise, angles and level sensors are new in each window, the latitude's error is one for all: at another latitude the
    Earth's horizontal rate and the compensation of gamma are others.
    """
    n, p, rows = f.noise, f.params, [r.position for r in f.rows]
    turned = np.array([f.compass.alpha1_rad + r.delta_rad for r in rows])
    alone = (p.we_radps * n.angle_sd_rad * np.cos(turned)) ** 2
    alone += n.window_sd_radps**2 + (p.wz_radps * n.level_sd_rad) ** 2
    by_latitude = [
        p.wz_radps * _earth_part(r, f.compass, p) + p.we_radps * math.sin(r.gamma_rad) * math.cos(r.beta_rad)
        for r in rows
    ]
    shared = n.latitude_sd_rad * np.array(by_latitude)
    return np.asarray(np.diag(alone) + np.outer(shared, shared))


def _attitude(q_rad: Floats, windows: Sequence[Window]) -> nav.Attitude:
    """Of the vehicle, with the constant error of gamma where the positions tell it."""
    beta_rad, gamma_rad = [w.mean_beta_rad for w in windows], [w.mean_gamma_rad for w in windows]
    return nav.attitude_from_level(q_rad, gamma_rad, beta_rad, bias=True)


def attitude_sd_rad(f: Fit) -> tuple[float, float, float]:
    """Standard deviations of pitch, roll and gamma's constant error, rad, by the positions' geometry.

    gamma = roll cos q - pitch sin q + constant, to the first order; the errors of the level sensor and of the gimbal
    angle are new in each position.
    """
    q = np.array([r.q_rad for r in f.rows])
    swing = f.attitude.pitch_rad * np.cos(q) + f.attitude.roll_rad * np.sin(q)
    sd_rad = np.hypot(f.params.level_sd_arcmin * ARCMIN, f.noise.angle_sd_rad * swing)
    pitch, roll, constant = np.linalg.norm(attitude_gains(f) * sd_rad, axis=1)
    return float(pitch), float(roll), float(constant)


def attitude_gains(f: Fit) -> Floats:
    """What gamma of each window does to -pitch, roll and gamma's constant error, (3, n), to the first order."""
    q = np.array([r.q_rad for r in f.rows])
    return np.linalg.pinv(np.column_stack([np.sin(q), np.cos(q), np.ones(len(q))]))


def alpha_turns(q_rad: Floats, windows: Sequence[Window], attitude: nav.Attitude) -> Floats:
    """Increments of alpha from the first window to each, rad: those of the gimbal, corrected for the tilt."""
    beta_rad = [w.mean_beta_rad for w in windows]
    return nav.cardan(q_rad, pitch_rad=attitude.pitch_rad, roll_rad=attitude.roll_rad, beta_rad=beta_rad)


def _increments(q_rad: Floats, windows: Sequence[Window], attitude: nav.Attitude, p: GyrocompassParams) -> Floats:
    return alpha_turns(q_rad, windows, attitude) if p.cardan else np.asarray(q_rad - q_rad[0])


def _positions(
    windows: Sequence[Window], delta: Floats, attitude: nav.Attitude, p: GyrocompassParams
) -> list[nav.Position]:
    bias = 0.0 if p.simplified else attitude.gamma_bias_rad
    return [
        nav.Position(
            s_radps=s_of(w, slope=p.slope, frozen=p.freeze),
            delta_rad=float(d),
            beta_rad=w.mean_beta_rad,
            gamma_rad=w.mean_gamma_rad - bias,
            t_mid_s=w.t_mid_s,
            window_s=w.length_s,
        )
        for w, d in zip(windows, delta, strict=True)
    ]


def _residual(r: nav.Position, c: nav.Compass, p: GyrocompassParams) -> float:
    """What a window's rate misses the model by, rad/s."""
    return r.s_radps - p.we_radps * _earth_part(r, c, p) - c.drift1_radps


def _earth_part(r: nav.Position, c: nav.Compass, p: GyrocompassParams) -> float:
    """What a window sees of the Earth's horizontal rate: (13) or (14) over We."""
    a = c.alpha1_rad + r.delta_rad
    tilt = 0.0 if p.simplified else math.sin(r.gamma_rad) * math.sin(r.beta_rad)
    return math.sin(a) * math.cos(r.gamma_rad) + math.cos(a) * tilt


def earth_slopes(f: Fit) -> Floats:
    """What a turn of alpha changes in the rate of each window, (n,), rad/s per rad."""
    rows = [r.position for r in f.rows]
    a = np.array([f.compass.alpha1_rad + r.delta_rad for r in rows])
    gamma, beta = np.array([r.gamma_rad for r in rows]), np.array([r.beta_rad for r in rows])
    tilt = 0.0 if f.params.simplified else np.sin(gamma) * np.sin(beta)
    return np.asarray(f.params.we_radps * (np.cos(a) * np.cos(gamma) - np.sin(a) * tilt))


def increment_of(w: Window, f: Fit) -> float:
    """Increment of alpha of a window outside the run, rad."""
    q = np.array([f.rows[0].q_rad, trusted(w, f.params)])
    return float(_increments(q, [w, w], f.attitude, f.params)[1])

"""Heading and drifts from the windows that count: the attitude, the turns of alpha, the equations, both drifts.

A drift that wanders is one number over the windows and another afterwards: an interval is that of the mean over the
windows that count. `drift_variance` gives what the windows tell of any later span: the hold needs it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from psabench.estimate.angles import wrapped
from psabench.estimate.uncertainty import Component, within_limit
from psabench.native import nav
from psabench.native.nav import ARCMIN, DEGPH
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
            s_radps=s_of(w, slope=p.slope, frozen=p.freeze) - p.unbalance1_degph_per_g * DEGPH * across_g(w),
            delta_rad=float(d),
            beta_rad=w.mean_beta_rad,
            gamma_rad=w.mean_gamma_rad - bias,
            t_mid_s=w.t_mid_s,
            window_s=w.length_s,
        )
        for w, d in zip(windows, delta, strict=True)
    ]


def across_g(w: Window) -> float:
    """Specific force along x in a window, g: of a vehicle at rest."""
    return -math.sin(w.mean_gamma_rad) * math.cos(w.mean_beta_rad)


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


# ---- both drifts, as means over the windows


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowMean:
    """A drift, mean over windows."""

    radps: float
    sd_radps: float  # of radps against the true mean over these windows
    t_mid_s: Floats  # (n,) of the windows
    length_s: Floats  # (n,)
    share: Floats  # (n,) of each in the mean, 1 in all
    constant: tuple[Component, ...] = ()  # errors that no window sees, rad/s: beside sd_radps
    by_force_radps: float = 0.0  # of radps: what the passport says of the specific force in these windows

    @property
    def level_radps(self) -> float:
        """Of a level vehicle without acceleration."""
        return self.radps - self.by_force_radps


def drift1_of(f: Fit, s: Sensitivity) -> WindowMean:
    """Drift of the levelling axis.

    Methods with weights look for the drift's mean in all time, and weigh the ends of the run most; what the windows
    miss it by on average is then what their own mean has more.
    """
    share = np.full(len(f.rows), 1.0 / len(f.rows))
    by_rate = drift1_gains(f, s)
    missed = float(np.mean([r.residual_radps for r in f.rows])) if _is_weighted(f) else 0.0
    other = by_rate - share
    variance = float(other @ drift_covariance(f) @ other + by_rate @ error_covariance(f) @ by_rate)
    p, torque_radps = f.params, float(by_rate @ [w.u1_radps.mean() for w in f.windows])
    by_force_radps = p.unbalance1_degph_per_g * DEGPH * float(share @ [across_g(w) for w in f.windows])
    return WindowMean(
        radps=f.compass.drift1_radps + missed + by_force_radps,
        by_force_radps=by_force_radps,
        sd_radps=math.sqrt(variance),
        t_mid_s=np.array([r.position.t_mid_s for r in f.rows]),
        length_s=np.array([r.position.window_s for r in f.rows]),
        share=share,
        constant=_constant_errors(p, level_radps=p.wz_radps, torque_radps=torque_radps),
    )


def _constant_errors(p: GyrocompassParams, *, level_radps: float, torque_radps: float) -> tuple[Component, ...]:
    """Of a drift: level_radps is what a radian of a level sensor's zero makes, torque_radps what the torquer turns."""
    return (
        within_limit("level zero", p.level_zero_arcmin * ARCMIN * abs(level_radps)),
        within_limit("torquer scale", p.torquer_scale * abs(torque_radps)),
    )


def drift1_gains(f: Fit, s: Sensitivity) -> Floats:
    """What a rate of each window does to drift1, (n,), 1 in all."""
    if not _is_weighted(f):
        return s.drift
    return np.asarray(1.0 / len(f.rows) - float(earth_slopes(f).mean()) * s.alpha_s)


def _is_weighted(f: Fit) -> bool:
    return METHODS[f.params.method] in (nav.Method.GLS, nav.Method.GLS_CONSTRAINED)


def drift2_of(f: Fit, calibration: Sequence[Window]) -> WindowMean:
    """Drift of the azimuth axis from its torquer: all windows, those of the calibration as well, by their lengths."""
    p, windows = f.params, [*f.windows, *calibration]
    deltas = [*(r.position.delta_rad for r in f.rows), *(increment_of(w, f) for w in calibration)]
    alpha_rad = f.compass.alpha1_rad + np.array(deltas)
    found = [
        nav.azimuth_drift(
            float(w.u2_radps.mean()),
            latitude_rad=p.latitude_rad,
            alpha_rad=float(alpha),
            beta_rad=w.mean_beta_rad,
            gamma_rad=w.mean_gamma_rad - f.attitude.gamma_bias_rad,
        )
        for w, alpha in zip(windows, alpha_rad, strict=True)
    ]
    length_s = np.array([w.length_s for w in windows])
    share = length_s / length_s.sum()
    sd_radps, beta_radps = _earth_part_errors(f, windows, alpha_rad, share)
    torque_radps = float(share @ [w.u2_radps.mean() for w in windows])
    return WindowMean(
        radps=float(share @ found),
        by_force_radps=p.quadrature2_degph_per_g * DEGPH * float(share @ [across_g(w) for w in windows]),
        sd_radps=sd_radps,
        t_mid_s=np.array([w.t_mid_s for w in windows]),
        length_s=length_s,
        share=share,
        constant=_constant_errors(p, level_radps=beta_radps, torque_radps=torque_radps),
    )


def _earth_part_errors(f: Fit, windows: Sequence[Window], alpha_rad: Floats, share: Floats) -> tuple[float, float]:
    """Of what is taken off u2 for the Earth, Wz cos b cos g + We (sin a sin g - cos a cos g sin b): its standard
    deviation, rad/s, and what a radian of a constant error of beta makes of it.

    Level sensors and angles are new in each window; heading, latitude and gamma's constant error, which is fitted to
    the first windows, are one for all.
    """
    p = f.params
    beta = np.array([w.mean_beta_rad for w in windows])
    gamma = np.array([w.mean_gamma_rad for w in windows]) - f.attitude.gamma_bias_rad
    sin_a, cos_a, tilt = np.sin(alpha_rad), np.cos(alpha_rad), np.sin(gamma)
    by_alpha = share * p.we_radps * (cos_a * tilt + sin_a * np.cos(gamma) * np.sin(beta))
    by_beta = share * p.we_radps * cos_a * np.cos(gamma) * np.cos(beta)
    by_gamma = share * (p.we_radps * sin_a * np.cos(gamma) - p.wz_radps * tilt)
    by_latitude = share * (p.we_radps * np.cos(gamma) - p.wz_radps * (sin_a * tilt - cos_a * np.sin(beta)))
    by_gamma[: len(f.rows)] -= attitude_gains(f)[2] * by_gamma.sum()
    level_sd_rad = p.level_sd_arcmin * ARCMIN
    parts = [
        *(by_beta * level_sd_rad),
        *(by_gamma * level_sd_rad),
        *(by_alpha * f.noise.angle_sd_rad),
        by_alpha.sum() * f.compass.alpha1_sd_rad,
        by_latitude.sum() * f.noise.latitude_sd_rad,
    ]
    return float(np.linalg.norm(parts)), float(by_beta.sum())


# ---- the random drift


def passport_sd_radps(drift: WindowMean, n: nav.Noise) -> float:
    """Standard deviation of a mean over windows against the drift of the passport, which does not wander, rad/s."""
    return math.hypot(n.gm_sigma_radps, drift.sd_radps)


def drift_variance(drift: WindowMean, n: nav.Noise, span_s: float) -> float:
    """Of the mean drift over a span that begins as the last window ends, less the mean over the windows, (rad/s)^2.

    With C the covariances of means of the random drift: C(span, span) - 2 sum w_i C(i, span) + sum w_i w_j C(i, j).
    """
    end_s = float((drift.t_mid_s + drift.length_s / 2.0).max())
    t_mid_s, length_s = np.append(drift.t_mid_s, end_s + span_s / 2.0), np.append(drift.length_s, span_s)
    weight = np.append(-drift.share, 1.0)
    return max(0.0, float(weight @ covariance_of_means(n, t_mid_s, length_s) @ weight))

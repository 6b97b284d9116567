"""Reasons not to trust a heading, and what a reader should know of it.

Each check holds a number against what noise, drift and angles of the passport make of it; in a run where nothing is
wrong one of them speaks in 0.2 % of runs at most, at any latitude.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from psabench.estimate.angles import wrapped
from psabench.native import nav
from psabench.native.nav import ARCMIN, DEGPH, EARTH_RADPS, Flag
from psabench.procedures.gyrocompass_fit import (
    Fit,
    Sensitivity,
    WindowMean,
    alpha_turns,
    attitude_sd_rad,
    drift1_gains,
    rate_covariance,
)
from psabench.procedures.gyrocompass_latitude import LatitudeEffect, passport_limit_radps
from psabench.procedures.gyrocompass_params import GyrocompassParams
from psabench.procedures.gyrocompass_windows import LEVEL_CODE_RAD, good_calibration, unsteady, why_not
from psabench.procedures.platform_bench import Window
from psabench.procedures.result import DEG, LIMIT_CI, Z95

FALSE_ALARMS = 2e-3  # of all checks, in a run where nothing is wrong
NOISE_CHECKS = 4  # that noise alone can set off: _latitude, _running, _moved, _biased
FALSE_ALARM = FALSE_ALARMS / NOISE_CHECKS
QUALITY_LEAST = 0.01  # of |hypot(s, c) - 1|: what the library flags
RESIDUAL_LIMIT = 4.0  # residuals may be so many times what noise and drift explain
RATE_STEP_RADPS = 1e-3 * DEGPH  # resolution of a rate on the wire, generously
TURN_STEP_RAD = math.radians(0.01)  # turns of the vehicle below are no one's business
RELEVANT = 0.25  # of the interval: a remnant of settling that moves a result by less is let pass
OPEN_RAD = math.radians(90.0)  # a heading whose interval is half the circle is none


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What the checks are about."""

    fit: Fit
    planned: int  # windows of the run
    sensitivity: Sensitivity
    quality_limit: float
    drift1: WindowMean
    drift2: WindowMean
    latitude: LatitudeEffect


def deviations(tests: int) -> float:
    """Standard deviations that the largest of so many normal numbers passes with probability FALSE_ALARM."""
    return NormalDist().inv_cdf(1.0 - 0.5 * FALSE_ALARM / tests)


def quality_limit(f: Fit, s: Sensitivity) -> float:
    """Of |hypot(s, c) - 1|: the library's, or what drift, noise and the operator's latitude make of it."""
    sd = math.sqrt(float(s.hypot_s @ rate_covariance(f) @ s.hypot_s))
    return max(QUALITY_LEAST, deviations(1) * sd)


def heading_allowance_rad(p: GyrocompassParams, attitude: nav.Attitude) -> float:
    """What the constant errors of angle sensor and level sensors may add to the heading: no window sees them."""
    return p.angle_zero_arcmin * ARCMIN + level_heading_rad(p, attitude)


def level_heading_rad(p: GyrocompassParams, attitude: nav.Attitude) -> float:
    """What the constant errors of the level sensors may add to an azimuth on this tilt."""
    return p.level_zero_arcmin * ARCMIN * math.tan(math.hypot(attitude.pitch_rad, attitude.roll_rad))


def doubts_of(e: Evidence) -> tuple[str, ...]:
    """Reasons not to trust the heading."""
    checks = (
        _latitude,
        _passport,
        _open,
        _few,
        _running,
        _moved,
        _tilted,
        _biased,
        _residuals,
        _converged,
    )
    return tuple(words for check in checks if (words := check(e)))


def notes_of(e: Evidence, windows: Sequence[Window]) -> list[str]:
    """What a reader should know; windows: all of them."""
    c, p = e.fit.compass, e.fit.params
    said = Flag.POOR_QUALITY | Flag.NOT_CONVERGED | Flag.SIMPLIFIED
    raised = [f for f in Flag if f in c.flags]
    notes = [text for f, text in zip(raised, c.warnings, strict=True) if f not in said]
    notes += [words] if (words := _unseen_latitude(e)) else []
    if p.calibrate_s and not good_calibration(windows, p):
        notes.append(f"the calibration does not count: {'; '.join(why_not(windows[-1]))}")
    blind = [f"{a.number + 1} and {b.number + 1}" for a, b in _pairs(e.fit) if a.missed != b.missed]
    if blind:
        notes.append(
            f"readings were lost between positions {', '.join(blind)}: whether the vehicle turned is not known"
        )
    return notes


def _unseen_latitude(e: Evidence) -> str:
    """On a tilt near the equator wrong latitudes do not show, and turn the heading.

    No doubt: it says nothing against the latitude given, whose own error is in the heading's interval.
    """
    f, latitude = e.fit, e.latitude
    limit = LIMIT_CI * f.compass.alpha1_half95_rad + heading_allowance_rad(f.params, f.attitude)
    if latitude.unseen_deg <= limit * DEG:
        return ""
    return (
        f"latitudes from {latitude.low_deg:.2f} to {latitude.high_deg:.2f} deg cannot be told from "
        f"{f.params.latitude_deg:g} deg here, and on this tilt turn the heading by up to {latitude.unseen_deg:.2f} "
        f"deg: the interval holds for a latitude known to {f.params.latitude_sd_arcmin:g}'; for one that is not, level "
        "the vehicle, or give drift2_degph and drift2_limit_degph of the passport"
    )


# ---- the checks: "" where there is nothing to say


def _latitude(e: Evidence) -> str:
    """The Earth's horizontal rate."""
    c, p = e.fit.compass, e.fit.params
    if c.quality <= e.quality_limit:
        return ""
    seen = math.hypot(c.s, c.c)
    cosine = seen * math.cos(p.latitude_rad)
    would = f"it would be right at latitude {math.acos(cosine) * DEG:.2f} deg" if cosine <= 1.0 else "no latitude fits"
    return (
        f"the horizontal Earth rate found is {seen:.4f} of U cos({p.latitude_deg:g} deg): {would}, "
        "or rates of different windows do not belong together"
    )


def _passport(e: Evidence) -> str:
    """The drift of the azimuth axis, which sees U sin(latitude)."""
    p = e.fit.params
    off = e.drift2.radps - p.drift2_degph * DEGPH
    if not p.drift2_limit_degph or abs(off) <= passport_limit_radps(e.fit, e.drift2):
        return ""
    sine = math.sin(p.latitude_rad) + off / EARTH_RADPS
    would = f"it would be right at latitude {math.asin(sine) * DEG:.1f} deg" if abs(sine) <= 1.0 else "no latitude fits"
    return (
        f"the azimuth axis drifts by {e.drift2.radps / DEGPH:.2f} deg/h where its passport says {p.drift2_degph:g} +- "
        f"{p.drift2_limit_degph:g} deg/h: {would}, or the vehicle turns all the time"
    )


def _open(e: Evidence) -> str:
    """Errors that the passport admits to, against steps of these positions."""
    half_deg = min(e.fit.compass.alpha1_half95_rad * DEG, 180.0)
    if half_deg < OPEN_RAD * DEG:
        return ""
    return f"+- {half_deg:.0f} deg at 95 %: with the errors given these positions leave the heading open"


def _few(e: Evidence) -> str:
    count = len(e.fit.rows)
    return f"only {count} of {e.planned} windows count" if 2 * count < e.planned else ""


def _running(e: Evidence) -> str:
    """S that is not one number in its window: what that does to heading and drift."""
    f, c = e.fit, e.fit.compass
    found = [unsteady(w, f.params) for w in f.windows]
    error, sd = np.array([x for x, _ in found]), np.array([x for _, x in found])
    results = (
        (e.sensitivity.alpha_s, c.alpha1_half95_rad, DEG, "the heading by {:.2f} deg"),
        (drift1_gains(f, e.sensitivity), Z95 * e.drift1.sd_radps, 1.0 / DEGPH, "the drift by {:.2f} deg/h"),
    )
    moves = []
    for by, half, unit, words in results:
        shift = float(by @ error)
        if abs(shift) > max(deviations(len(results)) * float(np.linalg.norm(by * sd)), RELEVANT * half):
            moves.append(words.format(abs(shift) * unit))
    if not moves:
        return ""
    worst = f.rows[int(np.argmax(np.abs(error) / sd))]
    return (
        f"S still runs in its windows, most in position {worst.number + 1} ({worst.q_rad * DEG:.0f} deg), which moves "
        f"{' and '.join(moves)}: the platform had not settled, or the vehicle sways"
    )


def _pairs(f: Fit) -> list[tuple[Window, Window]]:
    return list(zip(f.windows, f.windows[1:], strict=False))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Span:
    """A stretch of the run, for the vehicle's own turn in it."""

    where: str
    gimbal_rad: float  # increment of alpha that the angle sensor tells
    torquers_rad: float  # turned by the torquers
    idle_radps: float  # of which Earth and drifts took that rate
    time_s: float

    @property
    def own_rad(self) -> float:
        """Of the vehicle, clockwise as headings are."""
        return wrapped(self.gimbal_rad - self.torquers_rad + self.idle_radps * self.time_s)


def _spans(e: Evidence) -> list[_Span]:
    """From middle to middle of windows that follow one another, and each window by itself."""
    f = e.fit
    gamma = np.array([w.mean_gamma_rad for w in f.windows])
    alpha = alpha_turns(np.array([w.mean_encoder_rad for w in f.windows]), f.windows, f.attitude)
    idle = e.drift2.radps * np.cos(gamma) - f.compass.drift1_radps * np.sin(gamma) + f.params.wz_radps
    between = [
        _Span(
            where=f"between positions {a.number + 1} and {b.number + 1}",
            gimbal_rad=float(alpha[k + 1] - alpha[k]),
            torquers_rad=float(b.turned_rad.mean() - a.turned_rad.mean()),
            idle_radps=float(idle[k : k + 2].mean()),
            time_s=b.t_mid_s - a.t_mid_s,
        )
        for k, (a, b) in enumerate(_pairs(f))
        if a.missed == b.missed
    ]
    within = [
        _Span(
            where=f"in position {w.number + 1}",
            gimbal_rad=wrapped(float(w.encoder_rad[-1] - w.encoder_rad[0])),
            torquers_rad=float(w.turned_rad[-1] - w.turned_rad[0]),
            idle_radps=float(rate),
            time_s=w.length_s - w.step_s,
        )
        for w, rate in zip(f.windows, idle, strict=True)
    ]
    return between + within


def _moved(e: Evidence) -> str:
    """What the torquers turned and the gimbal did not is the vehicle's own turn."""
    p, spans = e.fit.params, _spans(e)
    angle = math.sqrt(2.0) * p.angle_sd_arcmin * ARCMIN
    found = []
    for s in spans:
        noise = deviations(len(spans)) * math.hypot(angle, p.gm_sigma_degph * DEGPH * s.time_s)
        limit = noise + p.torquer_scale * abs(s.torquers_rad) + TURN_STEP_RAD
        if abs(s.own_rad) > limit:
            found.append((abs(s.own_rad), f"{s.where} the vehicle turned by {s.own_rad * DEG:.2f} deg"))
    if not found:
        return ""
    return f"{max(found)[1]}, or the angle sensor slipped: the positions do not belong to one heading"


def _tilted(e: Evidence) -> str:
    """One pitch and one roll must explain gamma in all positions."""
    f, n = e.fit, len(e.fit.rows)
    sd = f.params.level_sd_arcmin * ARCMIN
    if n <= 3 or f.attitude.residual_rms_rad <= RESIDUAL_LIMIT * (sd * math.sqrt((n - 3) / n) + LEVEL_CODE_RAD):
        return ""
    left = f.attitude.residual_rms_rad / ARCMIN
    return f"no one attitude explains the level angles, {left:.2g}' rms are left: the vehicle moved between positions"


def _biased(e: Evidence) -> str:
    """A level sensor that tells what it told shows a gamma that does not turn with the gimbal: all of it a constant."""
    f, p = e.fit, e.fit.params
    sd = attitude_sd_rad(f)[2]
    bias = f.attitude.gamma_bias_rad
    if abs(bias) <= p.level_zero_arcmin * ARCMIN + deviations(1) * sd + LEVEL_CODE_RAD:
        return ""
    return (
        f"gamma is off by {bias / ARCMIN:.3g}' in all positions where level_zero_arcmin allows "
        f"{p.level_zero_arcmin:g}': the level sensor along x is stuck, or its zero is another"
    )


def _residuals(e: Evidence) -> str:
    """Three positions have none."""
    f = e.fit
    left = float(np.sqrt(np.mean([r.residual_radps**2 for r in f.rows])))
    angle = f.params.we_radps * f.noise.angle_sd_rad
    expected = math.hypot(f.noise.gm_sigma_radps, f.noise.window_sd_radps, angle, EARTH_RADPS * f.noise.level_sd_rad)
    if len(f.rows) <= 3 or left <= RESIDUAL_LIMIT * expected + RATE_STEP_RADPS:
        return ""
    return (
        f"the rates miss the model by {left / DEGPH:.3g} deg/h rms where {expected / DEGPH:.2g} is expected: "
        "the drift jumped, the vehicle moved, or an angle is wrong"
    )


def _converged(e: Evidence) -> str:
    return "the constrained fit did not converge" if Flag.NOT_CONVERGED in e.fit.compass.flags else ""

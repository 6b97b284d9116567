"""Both drifts as means over the windows, and what is known of them.

A drift that wanders is one number over the windows and another afterwards: an interval is that of the mean over the
windows that count. `drift_variance` gives what the windows tell of any later span: the hold needs it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psabench.native import nav
from psabench.native.nav import ARCMIN
from psabench.procedures.gyrocompass_fit import (
    Fit,
    Sensitivity,
    attitude_gains,
    covariance_of_means,
    drift_covariance,
    earth_slopes,
    error_covariance,
    increment_of,
)
from psabench.procedures.gyrocompass_params import METHODS
from psabench.procedures.platform_bench import Floats, Window


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowMean:
    """A drift, mean over windows."""

    radps: float
    sd_radps: float  # of radps against the true mean over these windows
    t_mid_s: Floats  # (n,) of the windows
    length_s: Floats  # (n,)
    share: Floats  # (n,) of each in the mean, 1 in all


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
    return WindowMean(
        radps=f.compass.drift1_radps + missed,
        sd_radps=math.sqrt(variance),
        t_mid_s=np.array([r.position.t_mid_s for r in f.rows]),
        length_s=np.array([r.position.window_s for r in f.rows]),
        share=share,
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
    return WindowMean(
        radps=float(share @ found),
        sd_radps=_earth_part_sd(f, windows, alpha_rad, share),
        t_mid_s=np.array([w.t_mid_s for w in windows]),
        length_s=length_s,
        share=share,
    )


def _earth_part_sd(f: Fit, windows: Sequence[Window], alpha_rad: Floats, share: Floats) -> float:
    """Standard deviation of what is taken off u2 for the Earth, Wz cos b cos g + We (sin a sin g - cos a cos g sin b).

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
    return float(np.linalg.norm(parts))


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

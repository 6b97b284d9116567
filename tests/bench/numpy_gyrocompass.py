"""The Monte-Carlo of nav_mc_samples() in NumPy, all runs of a batch at once: what the library is timed beside.

Written from the equations, with the article's defaults: three positions 90 deg apart, 10 s windows of 1000 samples and
10 s gaps, Gauss-Markov drift, one draw of each sensor error a window, coefficients (14), closed form (17) to (19).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from psabench.native.nav import EARTH_RADPS
from psabench.native.nav_mc import McConfig

Floats = npt.NDArray[np.float64]
BATCH = 1000  # runs at once: fastest of 200 to 10,000


@dataclass(frozen=True, slots=True)
class Found:
    """Errors of a batch, one number a run, as nav_mc.Errors has them."""

    platform_rad: Floats
    heading_rad: Floats
    drift_radps: Floats


def _signed(cfg: McConfig, value: float, rng: np.random.Generator, runs: int) -> Floats:
    signs = rng.integers(0, 2, runs) * 2.0 - 1.0 if cfg.random_sign else np.ones(runs)
    return np.asarray(value * signs, dtype=np.float64)


def _window(cfg: McConfig, w: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Mean of the drift over a window and its value after it, sample by sample."""
    count = round(cfg.window_s / cfg.sample_s)
    decay = np.exp(-cfg.sample_s / cfg.gm_tau_s)
    noise = rng.standard_normal((count, len(w)))
    noise *= cfg.gm_sigma_radps * np.sqrt(1.0 - decay * decay)
    total = np.zeros_like(w)
    w = w.copy()
    for row in noise:
        total += w
        w *= decay
        w += row
    return total / count, w


def _rest(cfg: McConfig, alpha: Floats, gamma: Floats, drift: Floats, errors: tuple[Floats, Floats, Floats]) -> Floats:
    """S of a platform at rest; errors of latitude, beta and gamma."""
    latitude_error, beta_error, gamma_error = errors
    we, wz = EARTH_RADPS * np.cos(cfg.latitude_rad), EARTH_RADPS * np.sin(cfg.latitude_rad)
    wz_n = EARTH_RADPS * np.sin(cfg.latitude_rad + latitude_error)
    s = np.zeros_like(alpha)
    for _ in range(3):
        beta = -s / cfg.m1_per_s - beta_error
        w_x = we * (np.sin(alpha) * np.cos(gamma) + np.cos(alpha) * np.sin(gamma) * np.sin(beta))
        w_x += drift - wz * np.cos(beta) * np.sin(gamma)
        s = w_x / (1.0 + cfg.torquer_scale) + wz_n * np.cos(beta + beta_error) * np.sin(gamma + gamma_error)
    return s


def batch(cfg: McConfig, runs: int, rng: np.random.Generator) -> Found:
    """So many runs of the article's three positions."""
    alpha1, psi = rng.uniform(-np.pi, np.pi, (2, runs))
    pitch, roll = rng.uniform(-cfg.tilt_rad, cfg.tilt_rad, (2, runs))
    angle_sys = _signed(cfg, cfg.angle_sys_rad, rng, runs)
    beta_sys, gamma_sys = _signed(cfg, cfg.beta_sys_rad, rng, runs), _signed(cfg, cfg.gamma_sys_rad, rng, runs)
    latitude_error = _signed(cfg, cfg.latitude_error_rad, rng, runs)
    w = cfg.gm_sigma_radps * rng.standard_normal(runs)
    gap = np.exp(-cfg.gap_s / cfg.gm_tau_s)
    s, gammas, first = np.empty((3, runs)), np.empty((3, runs)), np.empty(runs)
    for i, turn in enumerate(cfg.angles_rad):
        error = angle_sys + cfg.angle_random_rad * rng.standard_normal(runs)
        first = error if i == 0 else first
        alpha = alpha1 + turn + error
        x1_zc = (-np.sin(psi) * np.sin(pitch) * np.cos(roll) + np.cos(psi) * np.sin(roll)) * np.cos(alpha)
        x1_zc += (-np.cos(psi) * np.sin(pitch) * np.cos(roll) - np.sin(psi) * np.sin(roll)) * np.sin(alpha)
        gamma = np.arctan2(x1_zc, np.cos(pitch) * np.cos(roll))
        beta_error = beta_sys + cfg.beta_random_rad * rng.standard_normal(runs)
        gamma_error = gamma_sys + cfg.gamma_random_rad * rng.standard_normal(runs)
        if i:
            w = gap * w + cfg.gm_sigma_radps * np.sqrt(1.0 - gap * gap) * rng.standard_normal(runs)
        mean, w = _window(cfg, w, rng)
        s[i] = _rest(cfg, alpha, gamma, cfg.drift1_radps + mean, (latitude_error, beta_error, gamma_error))
        gammas[i] = gamma + gamma_error
    found, drift = _closed3(s, gammas, cfg, EARTH_RADPS * np.cos(cfg.latitude_rad + latitude_error))
    error = np.remainder(found - alpha1 + np.pi, 2 * np.pi) - np.pi
    return Found(error - first, error, drift - cfg.drift1_radps)


def _closed3(s: Floats, gammas: Floats, cfg: McConfig, we: Floats) -> tuple[Floats, Floats]:
    turns = np.array(cfg.angles_rad)[:, None]
    a, b = we * np.cos(turns) * np.cos(gammas), we * np.sin(turns) * np.cos(gammas)
    f1, f2, c1, c2, d1, d2 = s[0] - s[1], s[1] - s[2], a[0] - a[1], a[1] - a[2], b[0] - b[1], b[1] - b[2]
    det = c1 * d2 - c2 * d1
    sine, cosine = (f1 * d2 - f2 * d1) / det, (c1 * f2 - c2 * f1) / det
    return np.arctan2(sine, cosine), np.mean(s - a * sine - b * cosine, axis=0)

"""Platforms and gyrocompassings by rotation matrices, in NumPy: what the library's answers are held against."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from psabench.native import nav
from psabench.native.nav import ARCMIN, DEGPH, EARTH_RADPS, Noise, Position

Floats = npt.NDArray[np.float64]
SOME_NOISE = Noise(gm_sigma_radps=0.2 * DEGPH, angle_sd_rad=0.5 * ARCMIN)
DEG = math.pi / 180.0


def rotation(axis: int, angle_rad: float) -> Floats:
    """Takes coordinates after the turn to coordinates before it."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    r = np.eye(3)
    r[i, i] = r[j, j] = math.cos(angle_rad)
    r[i, j], r[j, i] = -math.sin(angle_rad), math.sin(angle_rad)
    return r


def platform(alpha_rad: float, beta_rad: float, gamma_rad: float) -> Floats:
    """C_lp: about zeta, then x, then y."""
    return rotation(2, alpha_rad) @ rotation(0, beta_rad) @ rotation(1, gamma_rad)


def vehicle(psi_rad: float, pitch_rad: float, roll_rad: float) -> Floats:
    """C_lc: heading clockwise, nose up, right wing down."""
    return rotation(2, -psi_rad) @ rotation(0, pitch_rad) @ rotation(1, roll_rad)


def command(
    latitude_rad: float, angles: tuple[float, float, float], drift_radps: float, given_rad: float | None = None
) -> float:
    """S of a platform at rest: the Earth's rate about x_p and the drift, less what compensates gamma."""
    earth = EARTH_RADPS * np.array([0.0, math.cos(latitude_rad), math.sin(latitude_rad)])
    alpha, beta, gamma = angles
    about_x = float(platform(alpha, beta, gamma)[:, 0] @ earth)
    given = latitude_rad if given_rad is None else given_rad
    return about_x + drift_radps + EARTH_RADPS * math.sin(given) * math.cos(beta) * math.sin(gamma)


def positions(
    latitude_rad: float,
    alpha1_rad: float,
    deltas_rad: npt.ArrayLike,
    *,
    drift_radps: float = 25.0 * DEGPH,
    ramp_radps2: float = 0.0,
    tilt: tuple[float, float] = (0.0, 0.0),
    spacing_s: float = 20.0,
    betas_rad: Sequence[float] = (),
    given_rad: float | None = None,
) -> list[Position]:
    """Noise-free positions of a vehicle with this pitch and roll; the platform is some arc minutes off level."""
    found = []
    middle_s = spacing_s * (np.size(deltas_rad) - 1) / 2
    for i, delta in enumerate(np.atleast_1d(np.asarray(deltas_rad, dtype=float))):
        alpha, beta = alpha1_rad + delta, betas_rad[i] if betas_rad else (3.0 - i) * 4.0 * ARCMIN
        gamma = nav.gamma(alpha_rad=alpha, beta_rad=beta, psi_rad=0.7, pitch_rad=tilt[0], roll_rad=tilt[1])
        drift = drift_radps + ramp_radps2 * (spacing_s * i - middle_s)
        s = command(latitude_rad, (alpha, beta, gamma), drift, given_rad)
        found.append(
            Position(s_radps=s, delta_rad=delta, beta_rad=beta, gamma_rad=gamma, t_mid_s=spacing_s * i, window_s=10.0)
        )
    return found


def off_deg(result: nav.Compass, alpha_rad: float) -> float:
    """Error of alpha, wrapped."""
    return math.degrees(abs(math.remainder(result.alpha1_rad - alpha_rad, 2 * math.pi)))

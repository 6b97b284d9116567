"""Covariance of an alignment at rest: what the sensors' constant errors and their white noise make of it."""

from __future__ import annotations

import math

import numpy as np

from psabench.native import nav_errors
from psabench.native.nav import Floats
from psabench.native.nav_errors import ErrorsConfig
from psabench.native.strapdown import gravity_mps2

EARTH_RADPS = 7.292115e-5


def aligned_state(model: ErrorsConfig, at: Floats, x: Floats, p: Floats, alignment_s: float) -> tuple[Floats, Floats]:
    """x and P of all states after an alignment in the state `at`, from those of the constants; place and velocity are
    known.

    The attitude's errors are correlated with the constants that made them."""
    moving = nav_errors.error_layout(model)["nu"].start
    n = moving + len(x)
    into = np.zeros((n, len(x)))
    into[moving - 3 : moving] = nav_errors.alignment_rows(model, at)[:, moving:]
    into[moving:] = np.eye(len(x))
    full = into @ p @ into.T
    full[moving - 3 : moving, moving - 3 : moving] += alignment_noise(model, at, alignment_s)
    return into @ x, 0.5 * (full + full.T)


def alignment_noise(model: ErrorsConfig, at: Floats, alignment_s: float) -> Floats:
    """Covariance of beta by white noise alone: mean force over g tilts, mean east rate over u cos lat turns, and the
    tilt too."""
    level = model.accel_noise_mps2_rts / gravity_mps2(at[0], at[2]) / math.sqrt(alignment_s)
    heading = model.gyro_noise_radps_rts / math.sqrt(alignment_s) / (EARTH_RADPS * math.cos(at[0]))
    into = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, math.tan(at[0]), 1.0]])
    return np.asarray(into @ np.diag([level**2, level**2, heading**2]) @ into.T)

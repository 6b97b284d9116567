"""Platforms with the article's errors, drawn again for each run, and a run of gyrocompassing on one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from fake_platform import FakePlatform
from psabench.procedures import gyrocompass as g
from psabench.procedures.gyrocompass import GyrocompassResult
from psabench.procedures.gyrocompass_params import params_of
from psabench.procedures.head_bench import Silent
from scipy.signal import lfilter

NOISE_ARCMIN = 0.009  # of beta in a step, as the scenario gyrocompass has it


def run(bench: FakePlatform, reading: str = "improved", **given: Any) -> GyrocompassResult:
    p = params_of(reading, given)
    return g.estimate(g.measure(bench, p, Silent()), p)


def wander(rng: np.random.Generator, mean_degph: float) -> Any:
    """A drift with the article's Gauss-Markov part, 0.2 deg/h and 1000 s, by steps of a second."""
    keep, n = math.exp(-1.0 / 1000.0), 700
    kicks = 0.2 * math.sqrt(1.0 - keep**2) * rng.standard_normal(n)
    kicks[0] = 0.2 * rng.standard_normal()
    path = lfilter([1.0], [1.0, -keep], kicks)
    return lambda t_s: mean_degph + float(np.interp(t_s, np.arange(n), path))


def article_s_instrument(rng: np.random.Generator) -> FakePlatform:
    """The article's errors, drawn again; what a turn leaves of beta is more than on the emulator."""
    return FakePlatform(
        heading_deg=float(rng.uniform(0.0, 360.0)),
        pitch_deg=float(rng.uniform(-5.0, 5.0)),
        roll_deg=float(rng.uniform(-5.0, 5.0)),
        drift1_degph=wander(rng, 25.0),
        drift2_degph=wander(rng, 25.0),
        scale1=5e-4,
        scale2=-5e-4,
        bias_beta_arcmin=10.0,
        bias_gamma_arcmin=-10.0,
        level_sd_arcmin=1.0,
        set_sd_arcmin=3.0,
        read_sd_arcmin=0.5,
        noise_arcmin=NOISE_ARCMIN,
        left_beta_arcmin=float(rng.uniform(-20.0, 20.0)),
        rng=rng,
    )

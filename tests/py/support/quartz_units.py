"""Zero signals of quartz accelerometers against temperature, drawn after the article: the estimators' tests use it.

Nothing here is the emulator's: the same law written a second time, from the article's figures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
LOW_C, HIGH_C = -60.0, 85.0
RATE_K_PER_S = 0.5 / 60.0
CASE_TAU_S, ELEMENT_TAU_S = 180.0, 360.0
PLAY_K = 0.3
GRADIENT_UG_PER_K = 1.0
STEP_S = 60.0


@dataclass(frozen=True, kw_only=True)
class QuartzUnit:
    """Parameters of y(T), micro-g; hump hot and dip cold for a positive `hump` (the article's group a)."""

    zero: float
    hump: float
    centre_c: float
    width_k: float
    slope_per_k: float

    def zero_ug(self, element_c: Array) -> Array:
        x = (element_c - self.centre_c) / self.width_k
        return self.zero + self.hump * x * np.exp((1 - x * x) / 2) + self.slope_per_k * (element_c - 30.0)


def draw_unit(rng: np.random.Generator) -> QuartzUnit:
    """One whose zero changes by the article's 3 to 16 times between -60 and +85 deg C."""
    grid = np.linspace(LOW_C, HIGH_C, 291)
    while True:
        unit = QuartzUnit(
            zero=float(rng.uniform(40, 150) * rng.choice([-1, 1])),
            hump=float(rng.uniform(120, 500) * rng.choice([-1, 1])),
            centre_c=float(rng.uniform(5, 18)),
            width_k=float(rng.uniform(52, 62)),
            slope_per_k=float(rng.normal(0, 0.25)),
        )
        ratio = np.abs(unit.zero_ug(grid)).max() / abs(float(unit.zero_ug(np.array([30.0]))[0]))
        if 3 <= ratio <= 16:
            return unit


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Of both legs: (n,) each."""

    t_s: Array
    case_c: Array
    y_ug: Array
    up: npt.NDArray[np.bool_]


def sweep_unit(unit: QuartzUnit, noise_ug: float, rng: np.random.Generator) -> Sweep:
    """Chamber up and down at half a kelvin a minute after an hour's soak; case and element as chained lags, a play."""
    leg_s = (HIGH_C - LOW_C) / RATE_K_PER_S
    t_s = np.arange(0.0, 2 * leg_s, STEP_S)
    chamber = LOW_C + RATE_K_PER_S * np.where(t_s <= leg_s, t_s, 2 * leg_s - t_s)
    case, element, felt = (np.empty_like(t_s) for _ in range(3))
    c = e = f = LOW_C
    a, b = np.exp(-STEP_S / CASE_TAU_S), np.exp(-STEP_S / ELEMENT_TAU_S)
    for k, ch in enumerate(chamber):
        c = ch + (c - ch) * a
        e = c + (e - c) * b
        f = min(max(f, e - PLAY_K), e + PLAY_K)
        case[k], element[k], felt[k] = c, e, f
    y = unit.zero_ug(felt) + GRADIENT_UG_PER_K * (case - element) + noise_ug * rng.standard_normal(len(t_s))
    return Sweep(t_s=t_s, case_c=case, y_ug=y, up=t_s <= leg_s)

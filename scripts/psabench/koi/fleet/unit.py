"""A drawn unit: errors that stay with it, errors of each switching on, and the raw increments that it puts out.

The unit's axes are the aircraft's: ahead, right, down. Gamma has the six elements of the article's gauge; the other
three turn the unit in the aircraft, which nothing here observes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from psabench.koi.fleet.classes import ARCSEC, UnitSizes
from psabench.koi.fleet.routes import DT_S
from psabench.link.signals import Floats
from psabench.native.nav import DEGPH
from psabench.quartz.draws import draw_source

GAMMA = ((0, 0), (1, 0), (1, 1), (1, 2), (2, 0), (2, 2))  # the article's {11, 21, 22, 23, 31, 33}
SECOND = round(1.0 / DT_S)


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """w' = w + nu + Theta w, f' = f + df + Gamma f."""

    nu_radps: Floats  # (3,)
    df_mps2: Floats
    gamma: Floats  # (3, 3)
    theta: Floats

    def vector(self) -> Floats:
        """nu, df, Gamma of the gauge, Theta by rows: (21,)."""
        gamma = [self.gamma[place] for place in GAMMA]
        return np.concatenate([self.nu_radps, self.df_mps2, gamma, self.theta.ravel()])


@dataclass(frozen=True, slots=True, kw_only=True)
class Readings:
    """Of one flight. The walks are what is beyond `errors` after each second, (seconds + 1, 3)."""

    dtheta_rad: Floats  # (n, 3)
    dv_mps: Floats
    errors: Errors  # at switching on
    nu_walk_radps: Floats
    df_walk_mps2: Floats

    def errors_at(self, t_s: int) -> Floats:
        """As Errors.vector()."""
        out = self.errors.vector()
        out[:3] += self.nu_walk_radps[t_s]
        out[3:6] += self.df_walk_mps2[t_s]
        return out


def draw_unit(sizes: UnitSizes, seed: int, unit: int) -> Errors:
    """What stays."""
    z = draw_source(seed, f"koi unit {unit}").normal(size=(4, 3, 3))
    eye, kept = np.eye(3) > 0, np.zeros((3, 3))
    kept[tuple(zip(*GAMMA, strict=True))] = 1.0
    return Errors(
        nu_radps=z[0, 0] * sizes.nu_degph * DEGPH,
        df_mps2=z[1, 0] * sizes.df_mps2,
        gamma=kept * z[2] * np.where(eye, sizes.gamma_scale, sizes.gamma_angle_arcsec * ARCSEC),
        theta=z[3] * np.where(eye, sizes.theta_scale, sizes.theta_angle_arcsec * ARCSEC),
    )


def draw_readings(
    sizes: UnitSizes, stays: Errors, dtheta_rad: Floats, dv_mps: Floats, rng: np.random.Generator
) -> Readings:
    """A flight on these exact increments, of whole seconds."""
    run, n = rng.normal(size=(2, 3)), len(dtheta_rad)
    errors = Errors(
        nu_radps=stays.nu_radps + run[0] * sizes.nu_run_degph * DEGPH,
        df_mps2=stays.df_mps2 + run[1] * sizes.df_run_mps2,
        gamma=stays.gamma,
        theta=stays.theta,
    )
    nu_walk = _draw_walk(rng, n // SECOND, sizes.nu_walk_degph_rth * DEGPH)
    df_walk = _draw_walk(rng, n // SECOND, sizes.df_walk_mps2_rth)
    noise = rng.standard_normal((2, n, 3))
    noise[0] *= sizes.gyro_noise_degph_rts * DEGPH * math.sqrt(DT_S)
    noise[1] *= sizes.accel_noise_mps2_rts * math.sqrt(DT_S)
    angle = _measure_rows(dtheta_rad, errors.theta, errors.nu_radps, nu_walk, noise[0])
    speed = _measure_rows(dv_mps, errors.gamma, errors.df_mps2, df_walk, noise[1])
    return Readings(
        dtheta_rad=count_up(angle, sizes.angle_count_arcsec * ARCSEC),
        dv_mps=count_up(speed, sizes.speed_count_mps),
        errors=errors,
        nu_walk_radps=nu_walk,
        df_walk_mps2=df_walk,
    )


def _draw_walk(rng: np.random.Generator, seconds: int, after_hour: float) -> Floats:
    steps = rng.normal(0.0, after_hour / 60.0, (seconds, 3))
    return np.vstack([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def _measure_rows(exact: Floats, matrix: Floats, constant: Floats, walk: Floats, noise: Floats) -> Floats:
    """A walk stays for a second."""
    out = exact @ (np.eye(3) + matrix).T
    out += noise
    out += DT_S * (constant + np.repeat(walk[:-1], SECOND, axis=0))
    return out


def count_up(increments: Floats, count: float) -> Floats:
    """Differences of a counter: what is left of a count goes into the next interval."""
    total = np.rint(np.cumsum(increments, axis=0) / count)
    return np.diff(total, axis=0, prepend=0.0) * count

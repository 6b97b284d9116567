"""A drawn strapdown unit on a rate table that is off level, off its azimuth, and whose angles are noisy.

The truth is that of sins_unit: finite rotations in closed form, which no method of calibration shares. Of the table it
adds what a user does not know: tilt and azimuth of the base, the unit's mounting on the platform, noise of the angles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from psabench.campaign.sins_unit import Experiment, UnitErrors, gravity_force, ideal_increments
from psabench.native.nav import ARCMIN, Floats
from psabench.native.sins import DEG, SinsConfig, Turn
from psabench.quartz.draws import draw_source
from psabench.sins.covariance import GAMMA_AT
from psabench.sins.increments import Increments
from psabench.sins.methods.legs import earth_rate_n
from psabench.sins.methods.positions import TableSide
from psabench.sins.plan import RotationPlan

SAMPLE_S, ANGLES_S = 0.05, 0.1
ANGLE_SD_RAD = 0.25 * ARCMIN  # of a reading of the table, the article's
FILTER = SinsConfig(sample_s=SAMPLE_S, accel_noise_multiplier=4.0, clone=True, stand_noise_rate_hz=1.0 / ANGLES_S)


@dataclass(frozen=True, slots=True, kw_only=True)
class Base:
    """A table's base, standard deviations: what it is off level and off its azimuth."""

    name: str
    tilt_rad: float = 0.0
    azimuth_rad: float = 0.0


BASES = (
    Base(name="level, azimuth true"),
    Base(name="1' off level", tilt_rad=ARCMIN),
    Base(name="azimuth 1 deg off", azimuth_rad=DEG),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """What a calibration may see."""

    data: Increments
    plan: RotationPlan
    side: TableSide


def draw_unit(seed: int, unit: int) -> UnitErrors:
    """Errors with the article's priors, Gamma in its gauge."""
    cfg, z = FILTER, draw_source(seed, f"unit {unit}").normal(size=(4, 3, 3))
    eye = np.eye(3) > 0
    gamma, kept = z[3] * np.where(eye, cfg.gamma_scale_sd, cfg.gamma_angle_sd_rad), np.zeros(9)
    kept[list(GAMMA_AT[cfg.gauge])] = 1.0
    return UnitErrors(
        nu_radps=z[0, 0] * cfg.nu_sd_radps,
        theta=z[1] * np.where(eye, cfg.theta_scale_sd, cfg.theta_angle_sd_rad),
        df_mps2=z[2, 0] * cfg.df_sd_mps2,
        gamma=gamma * kept.reshape(3, 3),
    )


def record_run(plan: RotationPlan, errors: UnitErrors, base: Base, source: np.random.Generator) -> Recording:
    """Increments and angles of a run. The unit is mounted off the platform's axes by 1 deg on each, one sigma."""
    e = Experiment(sample_s=SAMPLE_S)
    mounted = _turned_by(source.normal(size=3) * FILTER.delta_sd_rad)  # platform to b
    tilt = source.normal(size=3) * [base.tilt_rad, base.tilt_rad, base.azimuth_rad]
    off = _turned_by(tilt)  # what the table calls n, to n
    turns = [replace(t, axis_b=tuple(mounted @ np.array(t.axis_b))) for t in plan.turns]
    ideal = list(ideal_increments(e, off @ plan.start_c_nb @ mounted.T, turns))
    w, f = (np.vstack([part[k] for part in ideal]) for k in (0, 1))
    root, cfg = math.sqrt(SAMPLE_S), FILTER
    noise = source.standard_normal((2, *w.shape))
    accel = cfg.accel_noise_mps2_rts * cfg.accel_noise_multiplier * root
    return Recording(
        data=Increments(
            end_s=SAMPLE_S * np.arange(1, len(w) + 1, dtype=np.float64),
            dt_s=SAMPLE_S,
            dtheta_rad=w @ (np.eye(3) + errors.theta.T)
            + errors.nu_radps * SAMPLE_S
            + noise[0] * (cfg.gyro_noise_radps_rts * root),
            dv_mps=f @ (np.eye(3) + errors.gamma.T) + errors.df_mps2 * SAMPLE_S + noise[1] * accel,
        ),
        plan=plan,
        side=_table_side(e, plan, source),
    )


def _table_side(e: Experiment, plan: RotationPlan, source: np.random.Generator) -> TableSide:
    """Angles as the encoders show them: of the platform against a base that they take for level and true."""
    t_s = ANGLES_S * np.arange(round(plan.duration_s / ANGLES_S) + 1, dtype=np.float64)
    noise = source.normal(size=(len(t_s), 3)) * ANGLE_SD_RAD
    return TableSide(
        gravity_n_mps2=gravity_force(e),
        earth_n_radps=earth_rate_n(math.radians(e.latitude_deg)),
        t_s=t_s,
        c_st=platform_at(plan, t_s) @ _turned_by(noise),
        angle_sd_rad=ANGLE_SD_RAD,
        gyro_noise_radps_rts=FILTER.gyro_noise_radps_rts,
    )


def platform_at(plan: RotationPlan, t_s: Floats) -> Floats:
    """(m, 3, 3) attitude of the platform against the base."""
    edges = np.concatenate([[0.0], np.cumsum([t.duration_s for t in plan.turns])])
    starts = [plan.start_c_nb]
    for turn in plan.turns:
        starts.append(starts[-1] @ _turned_by(_rate_of(turn) * turn.duration_s))
    at = np.clip(np.searchsorted(edges, t_s, side="right") - 1, 0, len(plan.turns) - 1)
    rates = np.array([_rate_of(t) for t in plan.turns])
    return np.asarray(np.array(starts)[at] @ _turned_by(rates[at] * (t_s - edges[at])[:, None]))


def _rate_of(turn: Turn) -> Floats:
    return np.asarray(np.array(turn.axis_b) * turn.rate_radps)


def _turned_by(v: Floats) -> Floats:
    """exp([v x]) of one vector or of rows."""
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    k = np.cross(v[..., None, :], np.eye(3)).swapaxes(-1, -2)
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * k + 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2 * (k @ k))

"""Errors of a unit's sensors by name: of the filter's state, of the passport, of what is taken off the increments."""

from __future__ import annotations

import numpy as np

from psabench.errors import expected
from psabench.koi.autocal import InstrumentClass
from psabench.link.signals import Floats
from psabench.native.koi import KoiConfig, Sensors, koi_layout

# Gamma of the article's gauge, row and column: nav_sins_gauge of sins.h.
GAMMA = ((0, 0), (1, 0), (1, 1), (1, 2), (2, 0), (2, 2))
ALL = tuple(divmod(k, 3) for k in range(9))
AGING = 0.3  # of the persistent standard deviation, in a year (E0)


def sensor_rows(cfg: KoiConfig) -> slice:
    """Where the errors of the sensors are in the state."""
    rows = koi_layout(cfg)
    return slice(rows["nu"].start, rows["theta"].stop)


def state_names(cfg: KoiConfig) -> tuple[str, ...]:
    """Of the whole state, as the article writes them; drifts and biases end with their unit."""
    rows = koi_layout(cfg)
    moving = ["dr1", "dr2", "dV1", "dV2", "alpha1", "alpha2", "beta3", "dr3", "dV3"]
    receiver = [
        f"{block}{i}" for block in ("slow_r", "slow_v") for i in (1, 2, 3) if rows[block].stop > rows[block].start
    ]
    baro = ["baro"] * (rows["baro"].stop - rows["baro"].start)
    return (*moving, *baro, *receiver, *sensor_names(cfg), "dt1", "dt2")


def sensor_names(cfg: KoiConfig) -> tuple[str, ...]:
    """Of the sensors' part of the state."""
    drifts = [f"nu{i}_radps" for i in (1, 2, 3)] + [f"df{i}_mps2" for i in (1, 2, 3)]
    elements = [f"gamma{i + 1}{j + 1}" for i, j in _gamma_places(cfg)] + [f"theta{i + 1}{j + 1}" for i, j in ALL]
    return (*drifts, *elements)


def sensors_of_vector(cfg: KoiConfig, x: Floats) -> Sensors:
    """From the sensors' part of the state, in the order of sensor_names(). Raises ValueError for another length."""
    if x.shape != (len(sensor_names(cfg)),):
        raise ValueError(expected(f"{len(sensor_names(cfg))} errors of sensors", x.shape, "sensors"))
    places, gamma = _gamma_places(cfg), np.zeros((3, 3))
    for k, place in enumerate(places):
        gamma[place] = x[6 + k]
    theta = x[6 + len(places) :].reshape(3, 3).copy()
    return Sensors(nu_radps=x[:3].copy(), theta=theta, df_mps2=x[3:6].copy(), gamma=gamma)


def vector_of_sensors(cfg: KoiConfig, s: Sensors) -> Floats:
    """The inverse of sensors_of_vector()."""
    gamma = [s.gamma[place] for place in _gamma_places(cfg)]
    return np.concatenate([s.nu_radps, s.df_mps2, gamma, np.ravel(s.theta)])


def instrument_class(cfg: KoiConfig) -> InstrumentClass:
    """What sensors may err by, as the filter's configuration has it. Scales and axes are the same in each run."""
    names = sensor_names(cfg)
    persistent, run = np.zeros(len(names)), np.zeros(len(names))
    persistent[:6] = [cfg.nu_sd_radps] * 3 + [cfg.df_sd_mps2] * 3
    run[:6] = [cfg.nu_run_radps] * 3 + [cfg.df_run_mps2] * 3
    sds = {"gamma": (cfg.gamma_scale_sd, cfg.gamma_angle_sd_rad), "theta": (cfg.theta_scale_sd, cfg.theta_angle_sd_rad)}
    for k, name in enumerate(names[6:], 6):
        scale, angle = sds[name[:-2]]
        persistent[k] = scale if name[-2] == name[-1] else angle
    return InstrumentClass(names=names, persistent_sd=persistent, run_sd=run, aging_sd=AGING * persistent)


def _gamma_places(cfg: KoiConfig) -> tuple[tuple[int, int], ...]:
    rows = koi_layout(cfg)
    return GAMMA if rows["gamma"].stop - rows["gamma"].start == len(GAMMA) else ALL

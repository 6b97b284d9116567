"""What the gyro should give in a dwell, by the parameters that are estimated. Pure; written from the procedure's page.

W = wx + my wy + mz wz + dx ax + dy ay + dz az,  u = zero + S (W + c2 W^2 + c3 W^3)

w is the inertial rate, °/s, a the projection of gravity in g (an axis that points down reads +1), both on the gyro's
axes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from psabench.mems_gyro.params import MemsGyroParams
from psabench.mems_gyro.plan import Dwell

Floats = npt.NDArray[np.float64]
EARTH_DPS = math.degrees(7.292115e-5)
ZERO, SCALE, CROSS, PULL, SQUARE, CUBE, SIZE = 0, 1, slice(2, 4), slice(4, 7), 7, 8, 9


def _turn_y(deg: float) -> Floats:
    c, s = math.cos(math.radians(deg)), math.sin(math.radians(deg))
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _turn_x(deg: float) -> Floats:
    c, s = math.cos(math.radians(deg)), math.sin(math.radians(deg))
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def felt_motion(d: Dwell, p: MemsGyroParams) -> tuple[Floats, Floats]:
    """Mean rate, °/s, and a, g, on the gyro's axes. The horizontal part of the Earth's rate turns with the table."""
    half_turn_rad = math.radians(d.rate_dps * d.duration_s / 2)
    azimuth_rad = math.radians(p.azimuth_deg + d.heading_deg) + half_turn_rad
    level_dps = EARTH_DPS * math.cos(math.radians(p.latitude_deg)) * float(np.sinc(half_turn_rad / math.pi))
    down_dps = d.rate_dps - EARTH_DPS * math.sin(math.radians(p.latitude_deg))
    w_dps = np.array([level_dps * math.cos(azimuth_rad), -level_dps * math.sin(azimuth_rad), down_dps])
    into = (_turn_y(d.middle_deg) @ _turn_x(d.inner_deg)).T
    return np.roll(into @ w_dps, -p.channel), np.roll(into[:, 2], -p.channel)


def felt_rows(dwells: Sequence[Dwell], p: MemsGyroParams) -> Floats:
    """(n, 6): rate and a of each dwell."""
    return np.array([np.concatenate(felt_motion(d, p)) for d in dwells])


def _sensed_dps(theta: Floats, rows: Floats) -> Floats:
    w, a = rows[:, :3], rows[:, 3:]
    sensed: Floats = w[:, 0] + w[:, 1:] @ theta[CROSS] + a @ theta[PULL]
    return sensed


def predict_v(theta: Floats, rows: Floats) -> Floats:
    """Volts at rows of `felt_rows`."""
    x = _sensed_dps(theta, rows)
    out: Floats = theta[ZERO] + theta[SCALE] * x * (1.0 + x * (theta[SQUARE] + x * theta[CUBE]))
    return out


def model_jacobian(theta: Floats, rows: Floats) -> Floats:
    """(n, SIZE): derivatives of `predict_v` by the parameters."""
    x = _sensed_dps(theta, rows)
    slope = theta[SCALE] * (1.0 + x * (2.0 * theta[SQUARE] + 3.0 * x * theta[CUBE]))
    j = np.empty((len(rows), SIZE))
    j[:, ZERO] = 1.0
    j[:, SCALE] = x * (1.0 + x * (theta[SQUARE] + x * theta[CUBE]))
    j[:, CROSS] = slope[:, np.newaxis] * rows[:, 1:3]
    j[:, PULL] = slope[:, np.newaxis] * rows[:, 3:]
    j[:, SQUARE] = theta[SCALE] * x**2
    j[:, CUBE] = theta[SCALE] * x**3
    return j


def turned_rows(rows: Floats, about: int, rad: float) -> Floats:
    """The same dwells with the gyro's axes turned about one of them."""
    e = np.zeros(3)
    e[about] = rad
    return np.hstack([x - np.cross(e, x) for x in (rows[:, :3], rows[:, 3:])])


def nonlinearity_part(theta: Floats, range_dps: float) -> float:
    """Largest deviation from the best straight line over the range, part of full scale."""
    x = np.linspace(-range_dps, range_dps, 201)
    y = x * (1.0 + x * (theta[SQUARE] + x * theta[CUBE]))
    return float(np.abs(y - np.polyval(np.polyfit(x, y, 1), x)).max() / range_dps)

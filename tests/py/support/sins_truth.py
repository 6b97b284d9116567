"""A strapdown unit on a table in plain NumPy: finite rotations, no linearisation, nothing of the library.

n is east, north, up; C takes b to n. What the table does is a list of (axis of b, rate in rad/s, duration in s).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

DEG = np.pi / 180.0
DEGPH = DEG / 3600.0
ARCMIN = DEG / 60.0
EARTH_RADPS = 7.292115e-5
LATITUDE_RAD = 55.7 * DEG
U_N = EARTH_RADPS * np.array([0.0, np.cos(LATITUDE_RAD), np.sin(LATITUDE_RAD)])
G_N = np.array([0.0, 0.0, 9.81])
ARTICLE = [(0, 0), (1, 0), (1, 1), (1, 2), (2, 0), (2, 2)]  # elements of Gamma, from 0

Array = np.ndarray[Any, np.dtype[np.float64]]
Leg = tuple[tuple[float, float, float], float, float]


def cross(v: Array) -> Array:
    """[v x], of one vector or of rows."""
    m = np.zeros((*v.shape[:-1], 3, 3))
    m[..., 0, 1], m[..., 0, 2], m[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return np.asarray(m - np.swapaxes(m, -1, -2), dtype=np.float64)


def turned(v: Array) -> Array:
    """exp[v x], of one vector or of rows."""
    a = np.linalg.norm(v, axis=-1)[..., None, None]
    k = cross(v)
    c = np.eye(3) + np.sinc(a / np.pi) * k + 0.5 * np.sinc(a / (2 * np.pi)) ** 2 * (k @ k)
    return np.asarray(c, dtype=np.float64)


def rotation_vector(c: Array) -> Array:
    """The inverse of `turned`, for less than half a turn."""
    twice = np.array([c[2, 1] - c[1, 2], c[0, 2] - c[2, 0], c[1, 0] - c[0, 1]])
    s, cosine = 0.5 * np.linalg.norm(twice), 0.5 * (np.trace(c) - 1.0)
    return np.asarray(0.5 * twice * (1.0 if s < 1e-12 else np.arctan2(s, cosine) / s))


def placed(azimuth_rad: float = 0.0) -> Array:
    """z1 along the table's axis, z3 up."""
    z1 = np.array([np.sin(azimuth_rad), np.cos(azimuth_rad), 0.0])
    return np.column_stack([z1, np.cross([0.0, 0.0, 1.0], z1), [0.0, 0.0, 1.0]])


def article_plan(half_s: float = 450.0, rate_radps: float = 10.0 * DEG) -> list[Leg]:
    """Three cycles there and back, each axis on the table's in turn, and the turns by 90 deg between them."""
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    quarter = (-10.0 * DEG, 9.0)
    legs: list[Leg] = [(x, rate_radps, half_s), (x, -rate_radps, half_s), (z, *quarter)]
    legs += [(y, rate_radps, half_s), (y, -rate_radps, half_s), (x, *quarter)]
    return [*legs, (z, rate_radps, half_s), (z, -rate_radps, half_s)]


@dataclass
class Errors:
    """Of an instrument and its mounting, measured less true."""

    nu: Array = field(default_factory=lambda: np.zeros(3))
    theta: Array = field(default_factory=lambda: np.zeros((3, 3)))
    df: Array = field(default_factory=lambda: np.zeros(3))
    gamma: Array = field(default_factory=lambda: np.zeros((3, 3)))
    delta: Array = field(default_factory=lambda: np.zeros(3))
    tau: float = 0.0


def drawn(rng: np.random.Generator, kept: Sequence[tuple[int, int]] = ARTICLE) -> Errors:
    """An instrument of the article's priors; kept: elements of Gamma that are not zero."""
    e = Errors(nu=rng.normal(0, 0.5 * DEGPH, 3), df=rng.normal(0, 0.02, 3))
    e.theta = rng.normal(0, 1, (3, 3)) * np.where(np.eye(3) > 0, 1e-3, 3 * ARCMIN)
    for i, j in kept:
        e.gamma[i, j] = rng.normal(0, 1e-3 if i == j else 3 * ARCMIN)
    e.delta, e.tau = rng.normal(0, DEG, 3), float(rng.normal(0, 0.05))
    return e


class Table:
    """Attitude of the unit at any time of a plan."""

    def __init__(self, start: Array, legs: Sequence[Leg]) -> None:
        self.legs = legs
        self.edges = np.concatenate([[0.0], np.cumsum([d for *_, d in legs])])
        self.starts = [start]
        for axis, rate, duration in legs:
            self.starts.append(self.starts[-1] @ turned(np.array(axis) * rate * duration))

    def attitude(self, t_s: Array) -> Array:
        out = np.empty((len(t_s), 3, 3))
        leg = np.clip(np.searchsorted(self.edges, t_s, side="right") - 1, 0, len(self.legs) - 1)
        for k, (axis, rate, _) in enumerate(self.legs):
            here = leg == k
            angle = rate * (t_s[here] - self.edges[k])
            out[here] = self.starts[k] @ turned(np.array(axis) * angle[:, None])
        return out

    def rate(self, t_s: Array) -> Array:
        """Relative to n, in b."""
        leg = np.clip(np.searchsorted(self.edges, t_s, side="right") - 1, 0, len(self.legs) - 1)
        return np.asarray([np.array(axis) * rate for axis, rate, _ in self.legs])[leg]


@dataclass
class Data:
    """What a unit gave, and the truth at its end."""

    dtheta: Array
    dv: Array
    c_end: Array


def measured(table: Table, e: Errors, sample_s: float, *, gyro: float = 0.0, accel: float = 0.0, seed: int = 0) -> Data:
    """Increments by Simpson's rule in each sample. gyro, accel: densities of the noise."""
    rng = np.random.default_rng(seed)
    count = round(table.edges[-1] / sample_s)
    edges = np.arange(count + 1) * sample_s
    middle = edges[:-1] + 0.5 * sample_s
    ends, mid = table.attitude(edges), table.attitude(middle)

    # The end of a leg is the start of the next one: the same attitude.
    def mean(v: Array) -> Array:
        at_ends, at_mid = np.einsum("kji,j->ki", ends, v), np.einsum("kji,j->ki", mid, v)
        return np.asarray((at_ends[:-1] + 4.0 * at_mid + at_ends[1:]) * (sample_s / 6.0))

    w = table.rate(middle) * sample_s + mean(U_N)
    f = mean(G_N)
    root = np.sqrt(sample_s)
    return Data(
        dtheta=w @ (np.eye(3) + e.theta).T + e.nu * sample_s + rng.normal(0, 1, w.shape) * gyro * root,
        dv=f @ (np.eye(3) + e.gamma).T + e.df * sample_s + rng.normal(0, 1, f.shape) * accel * root,
        c_end=ends[-1],
    )


def angles(table: Table, e: Errors, interval_s: float, *, sd_rad: float = 0.0, seed: int = 0) -> tuple[Array, Array]:
    """Times and rotations C_st(t) = C(t + tau) exp(delta) of the table, each with noise."""
    t = np.arange(0.0, table.edges[-1], interval_s)
    t = t[(t + e.tau > 0.0) & (t + e.tau < table.edges[-1])]
    noise = turned(np.random.default_rng(seed).normal(0, 1, (len(t), 3)) * sd_rad)
    return t, table.attitude(t + e.tau) @ turned(e.delta) @ noise

"""The receiver and the altimeter on board: solutions at 1 Hz with their errors, late, and with what goes wrong.

The law is that of the emulated receiver (docs/boards/receiver.md), written a second time for arrays; errors are east,
north, up. A lever arm is added here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from psabench.koi.fleet.classes import BaroSizes, ReceiverSizes
from psabench.koi.fleet.conditions import Condition, Episode
from psabench.koi.fleet.routes import HOUR_S, Journey
from psabench.koi.geodesy import moved_place
from psabench.link.signals import Floats
from psabench.native.flight_model import States

EARTH_RADPS = 7.292115e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class Solutions:
    """After each whole second from the first, (m,); delays: what the position is behind its stamp, and the velocity
    behind the position."""

    t_s: Floats
    place_rad_m: Floats  # (m, 3): latitude, longitude, height
    v_enu_mps: Floats  # (m, 3)
    valid: np.ndarray
    delays_s: tuple[float, float]


def draw_solutions(
    sizes: ReceiverSizes, j: Journey, c: Condition, episode: Episode, rng: np.random.Generator
) -> Solutions:
    """Of a flight. The same numbers are drawn for each condition."""
    n = j.seconds
    t_s = np.arange(1.0, n + 1.0)
    late = rng.random(2) * 2.0 * np.array([sizes.position_delay_s, sizes.velocity_delay_s])
    late[0] += c.late_s
    axes = np.array([1.0, 1.0, sizes.vertical_ratio])
    off_m = axes * (rng.normal(0.0, sizes.white_m, (n, 3)) + draw_slow(rng, n, sizes.slow_m, sizes.slow_s))
    off_mps = axes * (rng.normal(0.0, sizes.white_mps, (n, 3)) + draw_slow(rng, n, sizes.slow_mps, sizes.slow_v_s))
    off_mps += axes * draw_slow(rng, n, c.slow_mps, c.slow_s)
    _lead_astray(c, episode, t_s, off_m, off_mps)
    there, moves = states_at(j, t_s - late[0]), states_at(j, t_s - late.sum())
    v_mps = moves.v_enu_mps + off_mps
    if any(c.lever_m):
        off_m += to_enu(there, np.array(c.lever_m))
        v_mps = v_mps + to_enu(moves, np.cross(rate_to_earth(moves), np.array(c.lever_m)))
    valid = ~(c.outage & (t_s >= episode.begin_s) & (t_s < episode.end_s))
    return Solutions(
        t_s=t_s,
        place_rad_m=moved_place(place_rows(there), off_m),
        v_enu_mps=v_mps,
        valid=valid,
        delays_s=(float(late[0]), float(late[1])),
    )


def draw_heights(sizes: BaroSizes, j: Journey, rng: np.random.Generator) -> Floats:
    """Of the altimeter after each whole second, m."""
    n = j.seconds
    scale, offset, drift = rng.normal(size=3) * (sizes.scale, sizes.offset_m, sizes.drift_m_per_h)
    t_s = np.arange(1.0, n + 1.0)
    shown = (1.0 + scale) * states_at(j, t_s).baro_m + offset + drift * t_s / HOUR_S
    return np.asarray(shown + rng.normal(0.0, sizes.white_m, n))


def draw_slow(rng: np.random.Generator, n: int, sd: float, time_s: float) -> Floats:
    """Gauss-Markov of first order, stationary from the start, (n, 3), a step a second."""
    keep = math.exp(-1.0 / time_s)
    steps = rng.normal(size=(n, 3)) * (sd * math.sqrt(1.0 - keep * keep))
    now: Floats = rng.normal(size=3) * sd
    out = np.empty((n, 3))
    for k in range(n):
        now = keep * now + steps[k]
        out[k] = now
    return out


def states_at(j: Journey, t_s: Floats) -> States:
    """The truth, at rest before the beginning and after the end."""
    return j.path.states(np.clip(np.rint(t_s * 1e9).astype(np.int64), 0, j.path.end_ns))


def to_enu(s: States, arm_b: Floats) -> Floats:
    """A vector of the aircraft's axes, or a row for each instant, as east, north, up."""
    ned = np.einsum("nij,nj->ni", s.C_nb, np.broadcast_to(arm_b, (len(s.lat_rad), 3)))
    return np.stack([ned[:, 1], ned[:, 0], -ned[:, 2]], axis=1)


def rate_to_earth(s: States) -> Floats:
    """Of the aircraft, in its axes, (n, 3)."""
    earth = EARTH_RADPS * np.stack([np.cos(s.lat_rad), np.zeros_like(s.lat_rad), -np.sin(s.lat_rad)], axis=1)
    return np.asarray(s.w_ib_b_radps - np.einsum("nji,nj->ni", s.C_nb, earth))


def _lead_astray(c: Condition, e: Episode, t_s: Floats, off_m: Floats, off_mps: Floats) -> None:
    """Adds ramp and step, east and north."""
    holds = (t_s >= e.begin_s) & (t_s < e.end_s)
    way = np.array([math.sin(e.azimuth_rad), math.cos(e.azimuth_rad)])
    along_m = np.where(holds, c.step_m + c.ramp_mps * (t_s - e.begin_s), 0.0) if c.lasts_s else 0.0 * t_s
    off_m[:, :2] += np.outer(along_m, way)
    off_mps[:, :2] += np.outer(np.where(holds, c.ramp_mps, 0.0), way)


def place_rows(s: States) -> Floats:
    """As geodesy has them."""
    return np.stack([s.lat_rad, s.lon_rad, s.h_m], axis=1)

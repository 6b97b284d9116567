"""Flights of emu/phys/flight for the integration filter: truth, increments and what a unit with errors makes of them.

n is east, north, up; b the aircraft's axes, ahead, right, down. Errors are in the order of errors.h: dr, dv, beta;
states in that of koi.h. Nothing here is of the library but the strapdown integration and the layout.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from psabench.native.flight_model import Flight, Leg, States
from psabench.native.koi import Kind, Koi, KoiConfig, Sensors, koi_layout
from psabench.native.strapdown import State, radii_m
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

Floats = np.ndarray[Any, np.dtype[np.float64]]
DT_S, DT_NS = 0.01, 10_000_000
TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
GAMMA = [(0, 0), (1, 0), (1, 1), (1, 2), (2, 0), (2, 2)]  # of the article's gauge
ORDER = [0, 1, 7, 2, 3, 8, 4, 5, 6]  # of errors.h's states among koi.h's

# Taxi with stops and right angles, take-off, climbs and turns: 22 min.
LEGS: list[Leg] = [
    {"park_s": 60, "roll_deg": 0.05, "roll_s": 2.5},
    {"taxi_m": 300},
    {"turn_deg": 90},
    {"taxi_m": 400},
    {"stop_s": 30},
    {"taxi_m": 200},
    {"turn_deg": 90},
    {"taxi_m": 60, "speed_mps": 5},
    {"stop_s": 20},
    {"takeoff_mps": 85},
    {"climb_m": 600, "speed_mps": 110},
    {"turn_deg": 120},
    {"climb_m": 1500, "speed_mps": 200},
    {"fly_s": 120},
    {"turn_deg": -100, "bank_deg": 30},
    {"snake_s": 300, "amplitude_deg": 30, "period_s": 150},
    {"fly_s": 60},
    {"turn_deg": 80},
    {"descend_m": 1200, "speed_mps": 130},
    {"turn_deg": 90},
    {"descend_m": 900, "rate_mps": 6, "speed_mps": 90},
    {"land_mps": 70},
    {"stop_s": 60},
]
ON_GROUND_LEGS = 9


def state_of(s: States, i: int) -> State:
    return State(
        lat_rad=s.lat_rad[i], lon_rad=s.lon_rad[i], h_m=s.h_m[i], v_n_mps=s.v_enu_mps[i].copy(), C_nb=TO_ENU @ s.C_nb[i]
    )


@dataclass
class Truth:
    """A stretch of a flight at 100 Hz."""

    path: Flight
    begin_ns: int
    dtheta_rad: Floats
    dv_mps: Floats

    @staticmethod
    def of(path: Flight, begin_ns: int, end_ns: int) -> Truth:
        n = (end_ns - begin_ns) // DT_NS
        angle, speed = path.increments(begin_ns, DT_NS, n)
        return Truth(path, begin_ns, np.ascontiguousarray(angle), np.ascontiguousarray(speed))

    def __len__(self) -> int:
        return len(self.dtheta_rad)

    def state(self, k: int) -> State:
        """At the beginning of interval k."""
        return state_of(self.path.states(np.array([self.begin_ns + k * DT_NS])), 0)

    def times(self, t_s: Floats) -> States:
        """At these times since the beginning, on the ground before it."""
        return self.path.states(np.maximum(0, self.begin_ns + np.round(t_s * 1e9).astype(np.int64)))


def t_per_m(at: State) -> float:
    return math.tan(at.lat_rad) / radii_m(at.lat_rad, at.h_m)[1]


def errors_of(moving: Floats, at: State) -> Floats:
    """dr, dv, beta of errors.h from the nine moving states."""
    e = moving[ORDER].copy()
    e[8] -= t_per_m(at) * e[0]
    e[3] -= at.v_n_mps[1] * e[8]
    e[4] += at.v_n_mps[0] * e[8]
    return e


def moving_of(errors: Floats, at: State) -> Floats:
    e = errors.copy()
    e[3] += at.v_n_mps[1] * e[8]
    e[4] -= at.v_n_mps[0] * e[8]
    e[8] += t_per_m(at) * e[0]
    out = np.empty(9)
    out[ORDER] = e
    return out


def with_errors(at: State, e: Floats) -> State:
    """The state that errs so."""
    meridian, vertical = radii_m(at.lat_rad, at.h_m)
    return State(
        lat_rad=at.lat_rad + e[1] / meridian,
        lon_rad=at.lon_rad + e[0] / (vertical * math.cos(at.lat_rad)),
        h_m=at.h_m + e[2],
        v_n_mps=at.v_n_mps + e[3:6],
        C_nb=Rotation.from_rotvec(e[6:9]).as_matrix() @ at.C_nb,
    )


def error_between(found: State, true: State) -> Floats:
    meridian, vertical = radii_m(true.lat_rad, true.h_m)
    east = (found.lon_rad - true.lon_rad) * vertical * math.cos(true.lat_rad)
    place = [east, (found.lat_rad - true.lat_rad) * meridian, found.h_m - true.h_m]
    beta = Rotation.from_matrix(found.C_nb @ true.C_nb.T).as_rotvec()
    return np.concatenate([place, found.v_n_mps - true.v_n_mps, beta])


def sensors_of(cfg: KoiConfig, x: Floats) -> Sensors:
    """The sensors' errors in a state of the article's gauge or of nine Gamma."""
    rows, gamma = koi_layout(cfg), np.zeros((3, 3))
    values = x[rows["gamma"]]
    for k, value in enumerate(values):
        gamma[GAMMA[k] if len(values) == 6 else divmod(k, 3)] = value
    theta = x[rows["theta"]].reshape(3, 3)
    return Sensors(nu_radps=x[rows["nu"]], theta=theta, df_mps2=x[rows["df"]], gamma=gamma)


def measured(truth: Truth, s: Sensors) -> tuple[Floats, Floats]:
    """Increments of a unit with these errors, without noise."""
    angle = truth.dtheta_rad @ (np.eye(3) + s.theta).T + s.nu_radps * DT_S
    return angle, truth.dv_mps @ (np.eye(3) + s.gamma).T + s.df_mps2 * DT_S


SLOW = {"slow_r": slice(0, 3), "slow_v": slice(3, 6)}


def drawn_slow(cfg: KoiConfig, seconds: int, seed: int) -> Floats:
    """Gauss-Markov errors of a receiver, stationary, after each second: (n, 6)."""
    sd, keep = np.array([*cfg.slow_r_sd_m, *cfg.slow_v_sd_mps]), math.exp(-1.0 / cfg.slow_s)
    drive = np.random.default_rng([seed, 60]).normal(size=(seconds, 6))
    drive[1:] *= math.sqrt(1.0 - keep * keep)
    return np.asarray(sd * lfilter([1.0], [1.0, -keep], drive, axis=0), np.float64)


@dataclass
class Drawn:
    """A unit with errors drawn from a covariance, its noise and its receiver's."""

    cfg: KoiConfig
    truth: Truth
    x: Floats  # at the start; walks go on from it
    angle: Floats
    speed: Floats
    walk: Floats  # of nu, (n, 3)
    baro: Floats  # error after each second
    receiver: KoiConfig  # noise as it is, not as the filter has it
    slow: Floats  # errors of the receiver after each second, (n, 6)
    seed: int

    @staticmethod
    def of(cfg: KoiConfig, truth: Truth, p: Floats, seed: int, receiver: KoiConfig | None = None) -> Drawn:
        rng = np.random.default_rng(seed)
        sd = np.sqrt(np.diag(p))  # of the correlations: of P itself the small ones would drown in rounding
        values, vectors = np.linalg.eigh(p / np.outer(sd, sd))
        x = sd * (vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.normal(size=len(p))))
        angle, speed = measured(truth, sensors_of(cfg, x))
        n = len(truth)
        walk = np.cumsum(rng.normal(0.0, cfg.nu_walk_radps_rts * math.sqrt(DT_S), (n, 3)), axis=0)
        angle += walk * DT_S + rng.normal(0.0, cfg.gyro_noise_radps_rts * math.sqrt(DT_S), (n, 3))
        speed += rng.normal(0.0, cfg.accel_noise_mps2_rts * math.sqrt(DT_S), (n, 3))
        at, seconds = koi_layout(cfg)["baro"], n // 100 + 1
        baro = (x[at] if at.stop > at.start else np.zeros(1)) + np.cumsum(rng.normal(0.0, cfg.baro_walk_m_rts, seconds))
        receiver = receiver or cfg
        slow = drawn_slow(receiver, seconds, seed)
        for name, columns in SLOW.items():
            rows = koi_layout(cfg)[name]
            x[rows] = slow[0, columns][: rows.stop - rows.start]
        return Drawn(cfg, truth, x, angle, speed, walk, baro, receiver, slow, seed)

    def start(self) -> Koi:
        true = self.truth.state(0)
        return Koi(self.cfg, 0.0, with_errors(true, errors_of(self.x[:9], true)))

    def true_x(self, koi: Koi, k: int) -> Floats:
        """What the state should be at the beginning of interval k."""
        rows, x, now = koi_layout(self.cfg), self.x.copy(), koi.state.autonomous
        x[:9] = moving_of(error_between(now, self.truth.state(k)), now)
        x[rows["nu"]] += self.walk[k - 1]
        x[rows["baro"]] = self.baro[k // 100]
        for name, columns in SLOW.items():
            if rows[name].stop > rows[name].start:
                x[rows[name]] = self.slow[k // 100, columns]
        return x

    def fly(self, koi: Koi, first_s: int, last_s: int, *, height: bool = True) -> None:
        """Seconds of increments; after each a fix and the barometer."""
        rng = np.random.default_rng([self.seed, first_s])
        dt = self.x[koi_layout(self.cfg)["dt"]]
        t_s = np.arange(first_s + 1, last_s + 1, dtype=np.float64)
        place, speed, now = (self.truth.times(t_s - late) for late in (dt[0], dt[0] + dt[1], 0.0))
        noise = rng.normal(size=(len(t_s), 7))
        for i, t in enumerate(t_s):
            part = slice(100 * (first_s + i), 100 * (first_s + i + 1))
            koi.push(self.angle[part], self.speed[part])
            here = state_of(place, i)
            slow = self.slow[first_s + i + 1]
            off = np.concatenate([noise[i, :3] * np.array(self.receiver.position_sd_m) + slow[:3], np.zeros(6)])
            seen = with_errors(here, off)
            koi.take(Kind.POSITION, t, [seen.lat_rad, seen.lon_rad, seen.h_m])
            white = noise[i, 3:6] * np.array(self.receiver.velocity_sd_mps)
            koi.take(Kind.VELOCITY, t, speed.v_enu_mps[i] + white + slow[3:])
            if height:
                h_m = now.h_m[i] + self.baro[first_s + i + 1] + noise[i, 6] * self.cfg.height_sd_m
                koi.take(Kind.HEIGHT, t, [h_m])

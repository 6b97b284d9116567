"""Every column of the error model against central differences of the nonlinear strapdown integration on a flight with
turns."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from psabench.native import nav_errors
from psabench.native.kalman import Kalman
from psabench.native.nav import Refused
from psabench.native.nav_errors import ErrorsConfig, Way
from psabench.native.sins import Gauge
from psabench.native.strapdown import State, Strapdown, radii_m
from psabench.sins.flight import Flight, Flown, fly_steps
from scipy.spatial.transform import Rotation
from sins_truth import ARCMIN, DEGPH

Floats = np.ndarray
DT_S, MODEL_S = 0.5, 0.5  # of the integration; steps of the model
# Steps of the central differences: what a calibration leaves, large enough to be far from rounding.
STEPS = {
    "dr": 100.0,
    "dv": 0.1,
    "beta": ARCMIN,
    "nu": 0.01 * DEGPH,
    "theta": 1e-5,
    "df": 1e-4,
    "gamma": 1e-5,
}
FIXED = ErrorsConfig(gauge=Gauge.FREE9)
FREE = ErrorsConfig(gauge=Gauge.FREE9, height_fixed=False)
DAMPED = ErrorsConfig(gauge=Gauge.FREE9, height_fixed=False, damping_per_s=0.005, damping_per_s2=1e-5)
# Of what the largest element of a block reaches: dr, dv, beta at the end.
SCALES = ((0, 3), (3, 6), (6, 9))


@dataclass
class Case:
    """A model and how long a flight it is compared on."""

    cfg: ErrorsConfig
    duration_s: float


CASES = {"fixed": Case(FIXED, 1800.0), "free": Case(FREE, 600.0), "damped": Case(DAMPED, 120.0)}


@cache
def flown(duration_s: float, dt_s: float = DT_S) -> Flown:
    return fly_steps(Flight(duration_s=duration_s), dt_s)


def start(x: Floats, row: Floats) -> State:
    """The state with errors dr, dv, beta."""
    lat, lon, h = row[:3]
    meridian, vertical = radii_m(lat, h)
    turn = Rotation.from_rotvec(x[6:9]).as_matrix()
    return State(
        lat_rad=lat + x[1] / meridian,
        lon_rad=lon + x[0] / (vertical * math.cos(lat)),
        h_m=h + x[2],
        v_n_mps=row[3:6] + x[3:6],
        C_nb=turn @ row[6:].reshape(3, 3),
    )


def navigate(f: Flown, x: Floats, cfg: ErrorsConfig) -> Floats:
    """dr, dv, beta at the end of the flight of a unit with these errors."""
    nu, theta, df, gamma = x[9:12], x[12:21].reshape(3, 3), x[21:24], x[24:33].reshape(3, 3)
    angle = f.dtheta_rad @ (np.eye(3) + theta).T + nu * DT_S
    speed = f.dv_mps @ (np.eye(3) + gamma).T + df * DT_S
    unit = Strapdown(start(x, f.states[0]), height_fixed=cfg.height_fixed)
    if cfg.damping_per_s == 0.0:
        unit.advance(angle, speed, DT_S)
        return errors(unit.state, f.states[-1])
    for k in range(len(angle)):
        unit.advance(angle[k : k + 1], speed[k : k + 1], DT_S)
        unit = Strapdown(damp(unit.state, f.states[k + 1, 2], cfg), height_fixed=False)
    return errors(unit.state, f.states[-1])


def damp(s: State, true_h_m: float, cfg: ErrorsConfig) -> State:
    """The vertical channel is held by a height that is right."""
    off = s.h_m - true_h_m
    v = s.v_n_mps - np.array([0.0, 0.0, cfg.damping_per_s2 * off * DT_S])
    return State(
        lat_rad=s.lat_rad, lon_rad=s.lon_rad, h_m=s.h_m - cfg.damping_per_s * off * DT_S, v_n_mps=v, C_nb=s.C_nb
    )


def errors(s: State, row: Floats) -> Floats:
    meridian, vertical = radii_m(row[0], row[2])
    east, north = (s.lon_rad - row[1]) * vertical * math.cos(row[0]), (s.lat_rad - row[0]) * meridian
    beta = Rotation.from_matrix(s.C_nb @ row[6:].reshape(3, 3).T).as_rotvec()
    return np.concatenate([[east, north, s.h_m - row[2]], s.v_n_mps - row[3:6], beta])


def transition(cfg: ErrorsConfig, way: Way) -> Floats:
    """Rows of the moving states of the whole way, by the filter's own prediction of unit vectors."""
    rows = nav_errors.error_layout(cfg)
    n, moving = rows["gamma"].stop, rows["nu"].start
    found = np.empty((moving, n))
    for j in range(n):
        kf = Kalman(np.eye(n)[j], np.zeros((n, n)), moving)
        nav_errors.predict_errors(cfg, kf, way)
        found[:, j] = kf.x[:moving]
    return found


def places(cfg: ErrorsConfig) -> list[int]:
    """Which of the 33 states of a unit with its vertical the model has."""
    return [k for k in range(33) if not (cfg.height_fixed and k in (2, 5))]


@pytest.mark.parametrize("name", list(CASES))
def test_every_column_is_the_central_difference_of_the_nonlinear_integration(name: str) -> None:
    """Within 1 % of each column's largest element of place, of velocity, of attitude."""
    cfg, f = CASES[name].cfg, flown(CASES[name].duration_s)
    kept = places(cfg)
    phi = transition(cfg, flown(CASES[name].duration_s, MODEL_S).way())
    sizes = np.concatenate([np.full(3, STEPS[b]) for b in ("dr", "dv", "beta")])
    sizes = np.concatenate([sizes, [STEPS["nu"]] * 3, [STEPS["theta"]] * 9, [STEPS["df"]] * 3, [STEPS["gamma"]] * 9])
    for column, k in enumerate(kept):
        x = np.zeros(33)
        x[k] = sizes[k]
        slope = (navigate(f, x, cfg) - navigate(f, -x, cfg)) / (2.0 * sizes[k])
        model = np.zeros(9)
        model[kept[: len(phi)]] = phi[:, column]
        for low, high in SCALES:
            most = np.abs(slope[low:high]).max()
            assert np.abs(model - slope)[low:high].max() < 0.01 * most + 1e-9, (
                f"{name}: state {k}, rows {low} to {high}"
            )


def test_the_alignment_is_that_of_a_unit_that_levels_and_finds_north() -> None:
    """Exact triads of the specific force and the Earth's rate, as the unit measures them, against the model's
    rows."""
    rng = np.random.default_rng(4)
    row = fly_steps(Flight(duration_s=1.0), DT_S).states[0].copy()
    row[3:6] = 0.0
    c = row[6:].reshape(3, 3)
    u = 7.292115e-5 * np.array([0.0, math.cos(row[0]), math.sin(row[0])])
    g = np.array([0.0, 0.0, 9.78])
    x = np.zeros(31)
    x[7:] = np.concatenate(
        [rng.normal(0, 0.01 * DEGPH, 3), rng.normal(0, 1e-5, 9), rng.normal(0, 1e-4, 3), rng.normal(0, 1e-5, 9)]
    )
    w = (np.eye(3) + x[10:19].reshape(3, 3)) @ c.T @ u + x[7:10]
    f = (np.eye(3) + x[22:31].reshape(3, 3)) @ c.T @ g + x[19:22]
    up = f / np.linalg.norm(f)
    east = np.cross(w, up) / np.linalg.norm(np.cross(w, up))
    found = np.stack([east, np.cross(up, east), up])
    beta = Rotation.from_matrix(found @ c.T).as_rotvec()
    assert nav_errors.alignment_rows(FIXED, row) @ x == pytest.approx(beta, rel=2e-3, abs=1e-8)


def test_white_noise_walks() -> None:
    """q of a step: density squared times its length in beta and dv; twice half a step is a step."""
    cfg = ErrorsConfig(gyro_noise_radps_rts=2e-7, accel_noise_mps2_rts=3e-3)
    _, q = nav_errors.error_step(cfg, flown(600.0).way(), 7)
    want = np.array([0.0, 0.0, 9e-6, 9e-6, 4e-14, 4e-14, 4e-14]) * DT_S
    assert q == pytest.approx(np.diag(want))


@pytest.mark.parametrize("field", ["damping_per_s", "gyro_noise_radps_rts", "accel_noise_mps2_rts"])
def test_a_configuration_out_of_range_is_refused_with_its_field(field: str) -> None:
    with pytest.raises(Refused, match=field):
        nav_errors.error_layout(replace(ErrorsConfig(), **{field: -1.0}))  # type: ignore[arg-type]


def test_a_way_that_is_no_way_is_refused_with_its_step() -> None:
    way = flown(600.0).way().part(0, 10)
    cfg = ErrorsConfig()
    kf = Kalman(np.zeros(28), np.zeros((28, 28)), 7)
    way.w_b_radps[3, 1] = np.nan
    with pytest.raises(Refused, match=r"step 3: .*finite"):
        nav_errors.predict_errors(cfg, kf, way)
    way.w_b_radps[3, 1] = 3.0  # 0.75 rad in a step
    with pytest.raises(Refused, match="step 3"):
        nav_errors.predict_errors(cfg, kf, way)

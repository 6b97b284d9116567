"""The three modes of the heading indicator over one flight, hundreds of instruments: the algebra of their errors.

The flight goes along a meridian to the north, so a gyroscope's heading and the true one differ by errors alone. Of an
instrument are drawn what the workshop left of its drift, the rest of the deviation, the chart's error, and its random
drift. Equations: docs/procedures/heading_modes.md. `heading_modes_emulated` flies the same instruments on emulators.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from psabench.campaign.cases import STUDIES
from psabench.campaign.chains import config
from psabench.campaign.setup import Setup
from psabench.native import nav_mc
from psabench.native.nav import ARCMIN, DEGPH, EARTH_RADIUS_M, EARTH_RADPS, heading
from psabench.procedures.heading_modes import HALF_COMPASS, MAGNETIC, SELF_ORIENTING, ModeParams
from psabench.procedures.platform_bench import Floats

GRID_S = 5.0  # of the random drift
G_MPS2 = 9.81
GM_TAU_S = 1000.0
TORQUER_SCALE = 5e-4
LEVEL_RAD = 10.0 * ARCMIN  # of the level sensors, beta and gamma
PARKED_DEG = (2.0, -1.5)  # pitch and roll on the runway
ALPHA0_DEG = -33.0  # where the platform was left: the prototype keeps it there
HORIZONTAL_UT, NOISE_UT, DIP_DEG, DIP_SLOPE = 20.0, 0.1, 66.0, 0.6
DRIFT_DEGPH = 25.0
# Of an instrument, standard deviations (E0): no article gives them.
PASSPORT_SD_DEGPH = 0.5  # drift of this start against the workshop's
DEVIATION_SD_DEG = 0.5  # each coefficient, A to E, that is left after compensation
CHART_SD_DEG = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Instruments:
    """What is drawn, a row an instrument."""

    drift2_degph: Floats  # (n,) systematic
    deviation_deg: Floats  # (n, 5)
    chart_deg: Floats  # (n,)
    seeds: Floats  # (n,) of what each draws in its flight


def draw_instruments(seed: int, first_run: int, runs: int) -> Instruments:
    """Those of these runs, the same each time."""
    drawn = []
    for run in range(first_run, first_run + runs):
        rng = np.random.default_rng([seed, run])
        drawn.append([*rng.standard_normal(7), rng.integers(2**31)])
    x = np.array(drawn)
    return Instruments(
        drift2_degph=DRIFT_DEGPH + PASSPORT_SD_DEGPH * x[:, 0],
        deviation_deg=DEVIATION_SD_DEG * x[:, 1:6],
        chart_deg=CHART_SD_DEG * x[:, 6],
        seeds=x[:, 7],
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A mode with a reading of the random drift and of the alignment."""

    name: str
    mode: str
    title: str
    gm_sigma_degph: float = 0.2
    gm_from_zero: bool = False
    compass: tuple[str, str] = ("readings", "R0")  # study and case of the gyrocompassing
    windows_s: tuple[tuple[float, float], ...] = ()  # start and length of those that found the drift, before the flight
    turned_deg: tuple[float, ...] = ()  # alpha of the platform in each, heading 0; the last holds in flight


# Windows of a run as the unit goes through it, then 60 s of calibration: seconds before navigation begins, which the
# settling of a run moves by half a second. The improved run turns by 180 and 90 deg by turns.
ARTICLE_WINDOWS = ((-141.7, 10.0), (-111.2, 10.0), (-80.8, 10.0), (-60.3, 60.0))
IMPROVED_WINDOWS = (
    *((-496.3 + 73.6 * k + turned_s, 5.0) for k in range(6) for turned_s in (0.0, 20.9, 36.8, 57.7)),
    (-60.5, 60.0),
)
ARTICLE_TURNS = (0.0, 90.0, 180.0, 180.0)
IMPROVED_TURNS = (*((0.0, 180.0, 90.0, 270.0) * 6), 270.0)

ROWS: Mapping[str, Row] = {
    r.name: r
    for r in (
        Row(name="magnetic", mode=MAGNETIC, title="aligned and slaved by the induction sensor"),
        Row(name="half-compass", mode=HALF_COMPASS, title="aligned by it, then the gyroscope and the latitude panel"),
        Row(
            name="literal",
            mode=SELF_ORIENTING,
            title="the article, drift of 0.2 deg/h, 6' counted",
            windows_s=ARTICLE_WINDOWS,
            turned_deg=ARTICLE_TURNS,
        ),
        Row(
            name="claim",
            mode=SELF_ORIENTING,
            title="the claim's reading: 0.02 deg/h from zero, 6' not counted",
            gm_sigma_degph=0.02,
            gm_from_zero=True,
            compass=("readings", "R5n"),
            windows_s=ARTICLE_WINDOWS,
            turned_deg=ARTICLE_TURNS,
        ),
        Row(
            name="improved",
            mode=SELF_ORIENTING,
            title="the improved procedure, drift of 0.2 deg/h",
            compass=("improved", "unit"),
            windows_s=IMPROVED_WINDOWS,
            turned_deg=IMPROVED_TURNS,
        ),
    )
}


def errors_deg(row: Row, p: ModeParams, seed: int, runs: int, first_run: int = 0) -> Floats:
    """Heading shown less the true one, (runs, looks), deg."""
    drawn = draw_instruments(seed, first_run, runs)
    if row.mode == SELF_ORIENTING:
        return _self_orienting(row, p, drawn, seed, first_run)
    start = _aligned_rad(p, drawn)
    gyro = start[:, np.newaxis] + _by_panel(row, p, drawn)
    return np.degrees(gyro if row.mode == HALF_COMPASS else _slaved_rad(p, drawn, gyro))


# ---- the gyroscope


def _random_drift(row: Row, p: ModeParams, drawn: Instruments, before_s: float) -> Floats:
    """On the grid from before_s before the flight to its end, (n, grid), rad/s. Exact for a Gauss-Markov process."""
    steps = round((before_s + p.looks_s[-1]) / GRID_S) + 1
    keep = math.exp(-GRID_S / GM_TAU_S)
    w = np.array([np.random.default_rng([int(s), 1]).standard_normal(steps) for s in drawn.seeds])
    found = np.empty_like(w)
    found[:, 0] = 0.0 if row.gm_from_zero else w[:, 0]
    for k in range(1, steps):
        found[:, k] = keep * found[:, k - 1] + math.sqrt(1.0 - keep * keep) * w[:, k]
    return np.asarray(row.gm_sigma_degph * DEGPH * found)


def _integrate_grid(x: Floats) -> Floats:
    """From the first grid point on, by trapezoids."""
    steps = 0.5 * GRID_S * (x[..., 1:] + x[..., :-1])
    return np.concatenate([np.zeros_like(x[..., :1]), np.cumsum(steps, axis=-1)], axis=-1)


def _grid_s(p: ModeParams) -> Floats:
    return np.arange(round(p.looks_s[-1] / GRID_S) + 1) * GRID_S


def _at_looks(p: ModeParams, on_grid: Floats) -> Floats:
    return np.asarray(on_grid[..., :: round(p.look_s / GRID_S)])


def _flight_rate(p: ModeParams, alpha_rad: float, *, knows_speed: bool) -> Floats:
    """What tilts make of the Earth's and the flight's rates, (grid,), rad/s of alpha.

    Levelling holds y_p across the apparent vertical as its sensor shows it: the platform is off level by `along` there.
    Across, x_p follows the vehicle, and the sensor shows `across` that is not there. The law believes the sensors.
    """
    t_s = _grid_s(p)
    phi = np.radians(p.latitudes_deg(t_s))
    we, wz = EARTH_RADPS * np.cos(phi), EARTH_RADPS * np.sin(phi)
    east, north = _apparent_vertical(p, t_s)
    sin_a, cos_a = math.sin(alpha_rad), math.cos(alpha_rad)
    transport = -np.minimum(p.accel_mps2 * t_s, p.speed_mps) / EARTH_RADIUS_M  # about the east
    along = LEVEL_RAD - east * sin_a + north * cos_a
    across = LEVEL_RAD - east * cos_a - north * sin_a
    believed = across * (we * sin_a + (transport * cos_a if knows_speed else 0.0))
    return np.asarray(believed - along * (we * cos_a - transport * sin_a) + 0.5 * wz * (along**2 - across**2))


def _apparent_vertical(p: ModeParams, t_s: Floats) -> tuple[Floats, Floats]:
    """Where the apparent vertical leans in flight, to the east and to the north, rad: Coriolis and the take-off."""
    wz = EARTH_RADPS * np.sin(np.radians(p.latitudes_deg(t_s)))
    east = -2.0 * wz * np.minimum(p.accel_mps2 * t_s, p.speed_mps) / G_MPS2
    rolls = (t_s > 0.0) & (t_s < p.speed_mps / p.accel_mps2)
    return east, np.where(rolls, math.atan(p.accel_mps2 / G_MPS2), 0.0)


def _by_panel(row: Row, p: ModeParams, drawn: Instruments) -> Floats:
    """Error of the gyroscope's heading since the alignment, (n, looks), rad: alpha' = (Wz' + d')(1 + k) - d - Wz."""
    t_s = _grid_s(p)
    wz = EARTH_RADPS * np.sin(np.radians(p.latitudes_deg(t_s)))
    held_s = np.floor(t_s / p.look_s) * p.look_s
    panel = EARTH_RADPS * np.sin(np.radians(p.panel_deg(held_s)))
    asked = (panel + p.drift2_degph * DEGPH) * (1.0 + TORQUER_SCALE)
    rate = asked - wz + _flight_rate(p, math.radians(ALPHA0_DEG), knows_speed=False)
    drift = drawn.drift2_degph[:, np.newaxis] * DEGPH + _random_drift(row, p, drawn, 0.0)
    return _levelled_rad() + _at_looks(p, _integrate_grid(rate[np.newaxis, :] - drift))


def _levelled_rad() -> float:
    """The prototype takes the gimbal's angle for that of a level vehicle: what it gains when the vehicle is level."""
    pitch, roll = map(math.radians, PARKED_DEG)
    q = math.radians(ALPHA0_DEG)
    return math.remainder(heading(q, q, pitch_rad=pitch, roll_rad=roll), 2.0 * math.pi)


def _self_orienting(row: Row, p: ModeParams, drawn: Instruments, seed: int, first_run: int) -> Floats:
    """e' = mean of the drift in the windows - drift now, and what tilts and the torquer's scale change since then."""
    before_s = GRID_S * math.ceil(-row.windows_s[0][0] / GRID_S)
    drift = _random_drift(row, p, drawn, before_s)
    turned = _integrate_grid(drift)
    at_s = np.arange(drift.shape[1]) * GRID_S - before_s
    length_s = sum(length for _, length in row.windows_s)
    seen = np.stack(
        [
            sum(np.interp(b + length, at_s, x) - np.interp(b, at_s, x) for b, length in row.windows_s) / length_s
            for x in turned
        ]
    )
    share = np.array([length for _, length in row.windows_s]) / length_s
    alpha = np.radians(row.turned_deg)
    we0 = EARTH_RADPS * math.cos(math.radians(p.latitude_deg))
    level = we0 * LEVEL_RAD * float(share @ np.cos(alpha))
    wz = EARTH_RADPS * np.sin(np.radians(p.latitudes_deg(_grid_s(p))))
    known = level + TORQUER_SCALE * (wz - wz[0]) + _flight_rate(p, float(alpha[-1]), knows_speed=True)
    flight = drift[:, round(before_s / GRID_S) :]
    start = compass_rad(row, seed, first_run, len(flight))[:, np.newaxis]
    return np.degrees(start + _at_looks(p, _integrate_grid(known + seen[:, np.newaxis] - flight)))


def compass_rad(row: Row, seed: int, first_run: int, runs: int) -> Floats:
    """Heading errors of gyrocompassing: those of the campaign `gyrocompass`."""
    study, name = row.compass
    setup = next(c.setup for c in STUDIES[study].cases(Setup(random_sign=True)) if c.name == name)
    return -nav_mc.closed(config(setup), seed, first_run=first_run, runs=runs).heading_rad


# ---- the magnetic channel


def _sensor_deg(p: ModeParams, t_s: Floats) -> Floats:
    """What the sensor shows of heading 0, without deviation and noise: the field in the plane across the pendulum."""
    north_deg = p.latitudes_deg(t_s) - p.latitude_deg
    d = np.radians(p.declination_deg + p.declination_slope * north_deg)
    tan_dip = np.tan(np.radians(DIP_DEG + DIP_SLOPE * north_deg))
    east, north = _apparent_vertical(p, t_s)
    z = np.stack([east, np.tan(north), np.ones_like(east)])
    z /= np.linalg.norm(z, axis=0)
    y = np.array([[0.0], [1.0], [0.0]]) - z[1] * z
    y /= np.linalg.norm(y, axis=0)
    b = np.stack([np.sin(d), np.cos(d), -tan_dip])
    x = np.cross(y, z, axis=0)
    return np.asarray(np.degrees(np.arctan2(-(b * x).sum(axis=0), (b * y).sum(axis=0))))


def _deviation_deg(drawn: Instruments, shown_deg: Floats) -> Floats:
    m = np.radians(shown_deg)
    terms = np.stack([np.ones_like(m), np.sin(m), np.cos(m), np.sin(2.0 * m), np.cos(2.0 * m)])
    return np.asarray(drawn.deviation_deg @ terms)


def _by_sensor(p: ModeParams, drawn: Instruments, t_s: Floats, noise: Floats) -> Floats:
    """Error of sensor and setter, (n, t), rad."""
    shown = _sensor_deg(p, t_s)
    known = shown + p.setter_deg(t_s)
    noise_rad = NOISE_UT / HORIZONTAL_UT * noise
    return np.radians(known + drawn.chart_deg[:, np.newaxis] + _deviation_deg(drawn, shown)) + noise_rad


def _aligned_rad(p: ModeParams, drawn: Instruments) -> Floats:
    noise = np.array([np.random.default_rng([int(s), 2]).standard_normal(p.align_looks).mean() for s in drawn.seeds])
    return np.asarray(_by_sensor(p, drawn, np.zeros(1), noise[:, np.newaxis])[:, 0])


def _slaved_rad(p: ModeParams, drawn: Instruments, gyro_rad: Floats) -> Floats:
    """The law of the host's `slaved_rad`, for all runs at once."""
    t_s = p.looks_s
    noise = np.array([np.random.default_rng([int(s), 3]).standard_normal(len(t_s)) for s in drawn.seeds])
    by_sensor = _by_sensor(p, drawn, t_s, noise)
    limit, part = math.radians(p.slave_limit_dpm) / 60.0 * p.look_s, -math.expm1(-p.look_s / p.slave_s)
    correction = np.zeros(len(gyro_rad))
    found = gyro_rad.copy()
    for k in range(1, len(t_s)):
        off = by_sensor[:, k] - gyro_rad[:, k] - correction
        correction = correction + np.clip(part * off, -limit, limit)
        found[:, k] += correction
    return found

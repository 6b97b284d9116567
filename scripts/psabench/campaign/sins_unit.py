"""Drawn strapdown units that navigate themselves on a rate table: the truth of the campaign `sins-secondary`.

Raw increments of a unit with errors, on turns at constant rates, in closed form; an alignment at rest by the mean
force and the mean rate; navigation by the strapdown integration, as a unit's own computer does it. Shares nothing
with the error model and the filter: rotations are finite, the errors multiply the increments.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from psabench.errors import BadInput, expected
from psabench.named_yaml import checked_number, read_named
from psabench.native.sins import Turn
from psabench.native.strapdown import ROW, Floats, State, Strapdown
from psabench.quartz.draws import draw_source
from psabench.sins.plan import RotationPlan, read_plan
from psabench.sins.secondary.outputs import Outputs, Point

NAMED = ("article",)  # of proto/sins_experiments
EARTH_RADPS = 7.292115e-5
DEGPH, ARCSEC, PPM = math.radians(1.0) / 3600.0, math.radians(1.0) / 3600.0, 1e-6
# Elements of Gamma that a unit has: its axes are those of the article's gauge, from 0.
GAMMA = ((0, 0), (1, 0), (1, 1), (1, 2), (2, 0), (2, 2))


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """A scenario of proto/sins_experiments: standard deviations of the sensors' errors, plan, place."""

    plan: str = "secondary"
    latitude_deg: float = 55.7
    longitude_deg: float = 37.5
    height_m: float = 150.0
    alignment_s: float = 600.0
    sample_s: float = 0.02
    output_s: float = 0.2
    seed: int = 1
    repeatability: float = 0.1
    nu_degph: float = 0.02
    theta_scale_ppm: float = 10.0
    theta_angle_arcsec: float = 10.0
    df_mps2: float = 1e-3
    gamma_scale_ppm: float = 200.0
    gamma_angle_arcsec: float = 10.0
    gyro_noise_degph_rts: float = 0.1
    accel_noise_mps2_rts: float = 1e-3

    @property
    def point(self) -> Point:
        """Where the table is."""
        return Point(
            lat_rad=math.radians(self.latitude_deg), lon_rad=math.radians(self.longitude_deg), h_m=self.height_m
        )


LIMITS: Mapping[str, tuple[float, float]] = {
    "latitude_deg": (-80.0, 80.0),
    "longitude_deg": (-180.0, 180.0),
    "height_m": (-500.0, 9000.0),
    "alignment_s": (1.0, 86400.0),
    "sample_s": (1e-3, 0.1),
    "output_s": (1e-2, 1.0),
    "seed": (0, 2**53),
    "repeatability": (0.0, 10.0),
    "nu_degph": (0.0, 100.0),
    "theta_scale_ppm": (0.0, 1e5),
    "theta_angle_arcsec": (0.0, 3600.0),
    "df_mps2": (0.0, 1.0),
    "gamma_scale_ppm": (0.0, 1e5),
    "gamma_angle_arcsec": (0.0, 3600.0),
    "gyro_noise_degph_rts": (0.0, 100.0),
    "accel_noise_mps2_rts": (0.0, 1.0),
}


def read_experiment(name: str) -> Experiment:
    """Of this name (NAMED) or a YAML file with the fields of Experiment. Raises BadInput with the file and the key."""
    found, path = read_named(name, NAMED, "sins_experiments", "--experiment", "an experiment")
    if not isinstance(found, dict) or set(found) - set(LIMITS) - {"plan"}:
        raise BadInput(expected(" ".join(["plan", *LIMITS]), str(found)[:80], path))
    plan = found.pop("plan", Experiment().plan)
    numbers: dict[str, Any] = {k: checked_number(v, *LIMITS[k], f"{path}: {k}") for k, v in found.items()}
    if not float(numbers.get("seed", 0)).is_integer():
        raise BadInput(expected("a whole number", numbers["seed"], f"{path}: seed"))
    return Experiment(plan=str(plan), **numbers | {k: int(v) for k, v in numbers.items() if k == "seed"})


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitErrors:
    """w' = w + nu + Theta w, f' = f + df + Gamma f."""

    nu_radps: Floats
    theta: Floats
    df_mps2: Floats
    gamma: Floats

    def constants(self) -> Floats:
        """In the order of the error model, in the article's gauge."""
        gamma = [self.gamma[ij] for ij in GAMMA]
        return np.concatenate([self.nu_radps, self.theta.ravel(), self.df_mps2, gamma])


def draw_pair(e: Experiment, pair: int) -> tuple[UnitErrors, UnitErrors]:
    """One unit at both experiments: from the first to the second each error changes by `repeatability` of its
    deviation."""
    first = draw_source(e.seed, f"unit {pair}").normal(size=(4, 3, 3))
    change = draw_source(e.seed, f"change {pair}").normal(size=(4, 3, 3))
    return scaled_errors(e, first), scaled_errors(e, first + e.repeatability * change)


def scaled_errors(e: Experiment, z: Floats) -> UnitErrors:
    """Errors of z standard deviations each: rows of z are nu, Theta, df, Gamma."""
    eye = np.eye(3) > 0
    gamma = z[3] * np.where(eye, e.gamma_scale_ppm * PPM, e.gamma_angle_arcsec * ARCSEC)
    kept = np.zeros((3, 3))
    kept[tuple(zip(*GAMMA, strict=True))] = 1.0
    return UnitErrors(
        nu_radps=z[0, 0] * e.nu_degph * DEGPH,
        theta=z[1] * np.where(eye, e.theta_scale_ppm * PPM, e.theta_angle_arcsec * ARCSEC),
        df_mps2=z[2, 0] * e.df_mps2,
        gamma=gamma * kept,
    )


def run_unit(e: Experiment, errors: UnitErrors, rng: np.random.Generator) -> Outputs:
    """What the unit gives out from the end of its alignment on."""
    plan = read_plan(e.plan)
    c_nb = align_unit(e, plan, errors, rng)
    start = State(lat_rad=e.point.lat_rad, lon_rad=e.point.lon_rad, h_m=e.height_m, v_n_mps=np.zeros(3), C_nb=c_nb)
    unit, each = Strapdown(start, height_fixed=True), round(e.output_s / e.sample_s)
    rows, rates = [start.row()[None]], [np.zeros((1, 3))]
    for angle, speed in raw_increments(e, plan, errors, rng):
        whole = len(angle) - len(angle) % each
        rows.append(unit.advance(angle, speed, e.sample_s)[each - 1 :: each])
        rates.append(angle[:whole].reshape(-1, each, 3).sum(axis=1) / e.output_s)
    return _outputs_of(e, np.vstack(rows), np.vstack(rates))


def _outputs_of(e: Experiment, rows: Floats, rates: Floats) -> Outputs:
    assert rows.shape == (len(rates), ROW)
    return Outputs(
        t_s=e.output_s * np.arange(len(rows), dtype=np.float64),
        dt_s=e.output_s,
        lat_rad=rows[:, 0],
        lon_rad=rows[:, 1],
        v_mps=rows[:, 3:5],
        c_nb=rows[:, 6:].reshape(-1, 3, 3),
        w_b_radps=rates,
    )


def align_unit(e: Experiment, plan: RotationPlan, errors: UnitErrors, rng: np.random.Generator) -> Floats:
    """C_nb of a unit that takes its mean force for up, and what is across its mean rate and that for east."""
    to_b = plan.start_c_nb.T
    root = math.sqrt(e.alignment_s)
    w = (np.eye(3) + errors.theta) @ to_b @ earth_rate(e) + errors.nu_radps
    f = (np.eye(3) + errors.gamma) @ to_b @ gravity_force(e) + errors.df_mps2
    w += rng.normal(size=3) * e.gyro_noise_degph_rts * DEGPH / root
    f += rng.normal(size=3) * e.accel_noise_mps2_rts / root
    up = f / np.linalg.norm(f)
    east = np.cross(w, up)
    east /= np.linalg.norm(east)
    return np.stack([east, np.cross(up, east), up])


def earth_rate(e: Experiment) -> Floats:
    """East, north, up."""
    lat = math.radians(e.latitude_deg)
    return EARTH_RADPS * np.array([0.0, math.cos(lat), math.sin(lat)])


def gravity_force(e: Experiment) -> Floats:
    """Specific force at rest: Somigliana on WGS 84, free air."""
    s2 = math.sin(math.radians(e.latitude_deg)) ** 2
    g = 9.7803253359 * (1.0 + 1.931852652458e-3 * s2) / math.sqrt(1.0 - 6.69437999014e-3 * s2)
    return np.array([0.0, 0.0, g * (1.0 - 2.0 * e.height_m / 6378137.0)])


def raw_increments(
    e: Experiment, plan: RotationPlan, errors: UnitErrors, rng: np.random.Generator
) -> Iterator[tuple[Floats, Floats]]:
    """Increments that the unit measures, turn by turn."""
    scale_w, scale_f = np.eye(3) + errors.theta.T, np.eye(3) + errors.gamma.T
    root = math.sqrt(e.sample_s)
    for angle, speed in ideal_increments(e, plan.start_c_nb, plan.turns):
        noise = rng.standard_normal((2, *angle.shape))
        yield (
            angle @ scale_w + errors.nu_radps * e.sample_s + noise[0] * (e.gyro_noise_degph_rts * DEGPH * root),
            speed @ scale_f + errors.df_mps2 * e.sample_s + noise[1] * (e.accel_noise_mps2_rts * root),
        )


def ideal_increments(e: Experiment, c_nb: Floats, turns: Sequence[Turn]) -> Iterator[tuple[Floats, Floats]]:
    """Exact increments of a unit without errors: b turns at a constant rate, so a vector of n goes round in b."""
    for turn in turns:
        axis, count = np.array(turn.axis_b), round(turn.duration_s / e.sample_s)
        angles: Floats = turn.rate_radps * e.sample_s * np.arange(count + 1, dtype=np.float64)
        u_b, g_b = c_nb.T @ earth_rate(e), c_nb.T @ gravity_force(e)
        step: Floats = axis * turn.rate_radps * e.sample_s
        yield step + _round_mean(axis, angles, u_b) * e.sample_s, _round_mean(axis, angles, g_b) * e.sample_s
        c_nb = c_nb @ _rotation_about(axis, turn.rate_radps * count * e.sample_s)


def _round_mean(axis: Floats, angles: Floats, v: Floats) -> Floats:
    """Means of exp(-[axis a x]) v between neighbouring angles a."""
    along = axis * (axis @ v)
    width = angles[1] - angles[0]
    if width == 0.0:
        return np.tile(v, (len(angles) - 1, 1))
    cosine, sine = np.diff(np.sin(angles)) / width, -np.diff(np.cos(angles)) / width
    return np.asarray(along + np.outer(cosine, v - along) - np.outer(sine, np.cross(axis, v)))


def _rotation_about(axis: Floats, angle: float) -> Floats:
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * (k @ k))

"""Autonomous navigation after a calibration: the article's flight by covariance.

The unit starts with what a calibration on the table leaves of its sensors' errors, is levelled and finds north at
rest, and flies. rho = a sqrt(var(dlon) cos^2 lat + var(dlat)), a the semi-major axis, is the article's measure. The
sensors' covariance is that of the table's filter with all its correlations; the alignment's errors follow from those
same errors.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from psabench.errors import BadInput, expected
from psabench.native import nav_errors
from psabench.native.kalman import Kalman
from psabench.native.nav import Floats
from psabench.native.nav_errors import ErrorsConfig, Way
from psabench.native.sins import SinsConfig
from psabench.native.strapdown import radii_m
from psabench.procedures.result import option
from psabench.sins.alignment import aligned_state
from psabench.sins.covariance import READINGS, Reading, predict_accuracy, read_as
from psabench.sins.flight import Flight, fly_steps, read_flight, rest_state
from psabench.sins.plan import RotationPlan, read_plan

NAME = "sins-snake"
A_M = 6378137.0
STEP_S, SHOWN_S = 0.5, 60.0  # of the covariance; between points of the curve
ARTICLE_M: Mapping[bool, float] = {False: 1900.0, True: 1100.0}  # without the stand's angles, with them
PAIRS = (("B", "B, S50"), ("A", "A, S1"))  # readings that make a ratio
BOUND = 0.03  # that the figures must meet, of the default flight


@dataclass(frozen=True, slots=True, kw_only=True)
class SnakeParams:
    """Of `psabench run sins-snake`."""

    flight: str = option("snake", "", "snake, straight or a YAML file")
    plan: str = option("article", "", "rotations of the calibration: article, two_rates or a YAML file")
    alignment_s: float = option(600.0, "s", "length of the alignment at rest")

    def __post_init__(self) -> None:
        if not 1.0 <= self.alignment_s <= 86400.0:
            raise ValueError(expected("1 to 86400 s", self.alignment_s, "alignment_s"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Of one reading of the noise."""

    reading: Reading
    rho_m: float  # at the end
    curve_m: Floats  # each SHOWN_S from the start
    uncorrelated_m: float  # as if the alignment's errors did not come from the sensors
    straight_m: float  # the same flight without turns
    alignment_rad: Floats  # sd of beta at the start


@dataclass(frozen=True, slots=True, kw_only=True)
class Snake:
    """All readings."""

    flight: Flight
    plan: RotationPlan
    outcomes: Mapping[str, Outcome]

    def ratio(self, pair: tuple[str, str], of: str = "rho_m") -> float:
        """Error without the stand's angles over that with them."""
        return float(getattr(self.outcomes[pair[0]], of) / getattr(self.outcomes[pair[1]], of))

    @property
    def within(self) -> bool | None:
        """Whether the article's figures come out in its reading; None for another flight or plan than the default."""
        if self.flight != Flight() or self.plan.name != "article":
            return None
        named = [self.outcomes[name] for name in PAIRS[0]]
        return all(abs(o.rho_m / ARTICLE_M[o.reading.stand] - 1.0) < BOUND for o in named)


def run_snake(params: SnakeParams, cfg: SinsConfig | None = None) -> Snake:
    """Raises BadInput."""
    flight, plan, cfg = read_flight(params.flight), read_plan(params.plan), cfg or SinsConfig()
    if flight.duration_s < SHOWN_S:
        raise BadInput(expected(f"{SHOWN_S:g} s or more", flight.duration_s, f"{params.flight}: duration_s"))
    both = [(f, fly_steps(f, STEP_S).way()) for f in (flight, replace(flight, amplitude_deg=0.0))]
    outcomes = {name: _outcome_of(r, both, plan, cfg, params.alignment_s) for name, r in READINGS.items()}
    return Snake(flight=flight, plan=plan, outcomes=outcomes)


def _outcome_of(
    reading: Reading, both: Sequence[tuple[Flight, Way]], plan: RotationPlan, cfg: SinsConfig, alignment_s: float
) -> Outcome:
    """both: the flight, and the same without turns."""
    model = error_model(cfg)
    sensors = sensors_left(plan, read_as(reading, cfg))
    start, straight = (start_of(model, f, sensors, alignment_s) for f, _ in both)
    way, straight_way = (w for _, w in both)
    curve = list(rho_along(model, way, start))
    apart = start.copy()
    apart[4:7, 7:] = apart[7:, 4:7] = 0.0
    return Outcome(
        reading=reading,
        rho_m=curve[-1],
        curve_m=np.array(curve),
        uncorrelated_m=rho_at_end(model, way, apart),
        straight_m=rho_at_end(model, straight_way, straight),
        alignment_rad=np.sqrt(np.diag(start)[4:7]),
    )


def error_model(cfg: SinsConfig) -> ErrorsConfig:
    """With the sensors' noise as printed: the factor four belongs to the reading of the calibration's filter."""
    return ErrorsConfig(
        gauge=cfg.gauge, gyro_noise_radps_rts=cfg.gyro_noise_radps_rts, accel_noise_mps2_rts=cfg.accel_noise_mps2_rts
    )


def sensors_left(plan: RotationPlan, cfg: SinsConfig) -> Floats:
    """Covariance of nu, Theta, df, Gamma after the calibration: the constants of both models are the same."""
    found = predict_accuracy(plan, cfg).covariance
    return np.asarray(found[3:24, 3:24])


def start_of(model: ErrorsConfig, flight: Flight, sensors: Floats, alignment_s: float) -> Floats:
    """Covariance at the start of a flight, after an alignment by the same sensors."""
    return aligned_state(model, rest_state(flight), np.zeros(len(sensors)), sensors, alignment_s)[1]


def rho_at_end(model: ErrorsConfig, way: Way, start: Floats) -> float:
    """rho after the whole way."""
    kf = Kalman(np.zeros(len(start)), start, 7)
    nav_errors.predict_errors(model, kf, way)
    return _rho_of(kf.p, way.states[-1])


def rho_along(model: ErrorsConfig, way: Way, start: Floats) -> Iterator[float]:
    """rho each SHOWN_S, from the start to the end."""
    kf = Kalman(np.zeros(len(start)), start, 7)
    each = round(SHOWN_S / way.dt_s)
    yield _rho_of(kf.p, way.states[0])
    for first in range(0, len(way), each):
        part = way.part(first, first + each)
        nav_errors.predict_errors(model, kf, part)
        yield _rho_of(kf.p, part.states[-1])


def _rho_of(p: Floats, row: Floats) -> float:
    meridian, vertical = radii_m(row[0], row[2])
    return A_M * math.sqrt(p[0, 0] / vertical**2 + p[1, 1] / meridian**2)

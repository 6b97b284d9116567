"""What a unit's flights say of its instruments (автокалибровка, the article on a unit with a satellite receiver).

An error of an instrument is a persistent part p and a part r that is drawn at each switching on. Before a flight p is
known with covariance Pp; the sensors are corrected by it and the filter begins with Pp + Q, Q of r. A flight estimates
the sum with covariance P. With G = Pp (Pp + Q)^-1

    p += G x        Pp -= G (Pp + Q - P) G'

x the estimate beyond p. A flight that is trusted by a weight below 1 gives so much of its information. p wanders over
the years: Pp grows between flights, so that old ones are forgotten. Vectors: (m,), as in `names`; matrices: (m, m).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from psabench.errors import expected
from psabench.link.signals import Floats

YEAR_S = 365.25 * 86_400
CONVERGED = 0.5  # scalar weights: largest P/prior of a component that a flight has found (E0)


@dataclass(frozen=True, kw_only=True, eq=False)
class InstrumentClass:
    """Prior of the units of a type, standard deviations, (m,)."""

    names: tuple[str, ...]
    persistent_sd: Floats
    run_sd: Floats
    aging_sd: Floats  # of p's random walk in a year

    def __post_init__(self) -> None:
        """Raises ValueError."""
        for name in ("persistent_sd", "run_sd", "aging_sd"):
            sd = getattr(self, name)
            if sd.shape != (len(self.names),) or not (np.isfinite(sd).all() and (sd >= 0.0).all()):
                raise ValueError(expected(f"{len(self.names)} numbers of 0 or more", sd, name))

    @property
    def run_covariance(self) -> Floats:
        """Q, (m, m)."""
        return np.asarray(np.diag(self.run_sd**2))


@dataclass(frozen=True, kw_only=True, eq=False)
class Knowledge:
    """Of the persistent part of one unit's errors."""

    serial: str
    p: Floats  # (m,)
    covariance: Floats  # (m, m)
    time_s: float | None = None  # of the last flight, Unix
    flights: int = 0  # that had weight


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightEstimate:
    """Errors of a unit's instruments in one flight, and what the flight is worth.

    x is the whole error: what the sensors were corrected by and what the filter found beyond it.
    """

    serial: str
    names: tuple[str, ...]  # (m,)
    time_s: float  # of its beginning, Unix
    x: Floats  # (m,)
    covariance: Floats  # (m, m)
    weight: float = 1.0  # 0: bad data; 1: the filter's covariance is believed

    def __post_init__(self) -> None:
        """Raises ValueError."""
        m = len(self.names)
        if self.x.shape != (m,) or not np.isfinite(self.x).all():
            raise ValueError(expected(f"{m} finite estimates", self.x, f"flight of unit {self.serial}"))
        sd_finite = self.covariance.shape == (m, m) and np.isfinite(self.covariance).all()
        if not sd_finite or not (np.diag(self.covariance) >= 0.0).all():
            what = f"a covariance of {m} by {m} finite numbers"
            raise ValueError(expected(what, self.covariance, f"flight of unit {self.serial}"))
        if not 0.0 <= self.weight <= 1.0:
            raise ValueError(expected("a weight of 0 to 1", self.weight, f"flight of unit {self.serial}"))
        if not math.isfinite(self.time_s):
            raise ValueError(expected("a finite time", self.time_s, f"flight of unit {self.serial}"))


def nothing_known(kind: InstrumentClass, serial: str) -> Knowledge:
    """Of a new unit: the prior of its type."""
    return Knowledge(serial=serial, p=np.zeros(len(kind.names)), covariance=np.diag(kind.persistent_sd**2))


def age_knowledge(known: Knowledge, kind: InstrumentClass, time_s: float) -> Knowledge:
    """As it is known at a later time. Raises ValueError for an earlier one."""
    if known.time_s is None:
        return known
    years = (time_s - known.time_s) / YEAR_S
    if years < 0.0:
        after, got = f"a time after {known.time_s:.0f} s", f"{time_s:.0f}"
        raise ValueError(expected(after, got, f"flight of unit {known.serial}"))
    return replace(known, covariance=known.covariance + np.diag(kind.aging_sd**2 * years))


def filter_prior(known: Knowledge, kind: InstrumentClass, time_s: float) -> tuple[Floats, Floats]:
    """What the sensors are corrected by in a flight at that time, and the covariance that its filter begins with."""
    now = age_knowledge(known, kind, time_s)
    return now.p, now.covariance + kind.run_covariance


def update_knowledge(
    known: Knowledge, kind: InstrumentClass, flight: FlightEstimate, *, whole: bool = True
) -> Knowledge:
    """Knowledge after a flight, which began with filter_prior(). Of another serial number: that unit starts afresh.
    Raises ValueError for other names than the class has.

    whole: by the equations above; else each component by itself, of those that have converged.
    """
    if flight.names != kind.names:
        raise ValueError(expected(", ".join(kind.names), ", ".join(flight.names), f"flight of unit {flight.serial}"))
    if flight.serial != known.serial:
        known = nothing_known(kind, flight.serial)
    now = replace(age_knowledge(known, kind, flight.time_s), time_s=flight.time_s)
    if flight.weight <= 0.0:
        return now
    prior = now.covariance + kind.run_covariance
    beyond, p = _weigh_information(flight.x - now.p, flight.covariance, prior, flight.weight)
    if whole:
        gain = _gain_ratio(now.covariance, prior)
        off = gain @ (prior - p) @ gain.T
    else:
        gain = np.diag(_component_gains(now.covariance, kind.run_covariance, p, prior))
        off = gain @ now.covariance
    after = now.covariance - (off + off.T) / 2.0
    return replace(now, p=now.p + gain @ beyond, covariance=after, flights=now.flights + 1)


def _component_gains(persistent: Floats, run: Floats, p: Floats, prior: Floats) -> Floats:
    """Weights 1/(P + Q) of a mean, 0 where P has not come down."""
    before, of_run, after, at_start = (np.diag(m) for m in (persistent, run, p, prior))
    spread = before + after + of_run
    found = (after < CONVERGED * at_start) & (spread > 0.0)
    return np.where(found, before / np.where(spread > 0.0, spread, 1.0), 0.0)


def _weigh_information(x: Floats, p: Floats, prior: Floats, weight: float) -> tuple[Floats, Floats]:
    """Estimate and covariance when only so much of the flight's information is believed."""
    if weight >= 1.0:
        return x, p
    inverse = _inverse_of(prior, prior)
    posterior = _inverse_of(p, prior)
    information = inverse + weight * (posterior - inverse)
    scale = _scale_of(prior)
    known = np.diag(prior) == 0.0
    found = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    found[known, :] = found[:, known] = 0.0
    return found @ (weight * posterior @ x), found


def _scale_of(prior: Floats) -> Floats:
    """Standard deviations; 1 where it is 0."""
    sd = np.sqrt(np.diag(prior))
    return np.where(sd > 0.0, sd, 1.0)


def _inverse_of(p: Floats, prior: Floats) -> Floats:
    """By the prior's scale: drifts and scale errors differ by orders. What is known, of variance 0, becomes 1."""
    scale = _scale_of(prior)
    square = p / np.outer(scale, scale) + np.diag((np.diag(prior) == 0.0).astype(float))
    return np.asarray(np.linalg.inv(square) / np.outer(scale, scale))


def _gain_ratio(persistent: Floats, prior: Floats) -> Floats:
    """G = Pp (Pp + Q)^-1."""
    return persistent @ _inverse_of(prior, prior)


# ---- a unit's history


@dataclass(frozen=True, slots=True)
class RollBack:
    """Flights after this one are as if they had not been."""

    number: int  # of the unit's flights, from 1; 0: all of them


def standing_flights(events: Iterable[FlightEstimate | RollBack]) -> list[tuple[int, FlightEstimate]]:
    """Flights that count, with their numbers, in the order in which they were flown. Raises ValueError for a roll-back
    to a flight that has not been."""
    kept, number = list[tuple[int, FlightEstimate]](), 0
    for event in events:
        if isinstance(event, RollBack):
            if not 0 <= event.number <= number:
                raise ValueError(expected(f"a flight of 0 to {number}", event.number, "roll-back"))
            kept = [(n, flight) for n, flight in kept if n <= event.number]
        else:
            number += 1
            kept.append((number, event))
    return kept


def knowledge_after(
    kind: InstrumentClass, serial: str, events: Iterable[FlightEstimate | RollBack], *, whole: bool = True
) -> Knowledge:
    """Of a unit with this history."""
    known = nothing_known(kind, serial)
    for _, flight in standing_flights(events):
        known = update_knowledge(known, kind, flight, whole=whole)
    return known

"""Figures of a fleet: maxima of an hour, factors with their intervals, the filter's consistency, harm by conditions.

Units are the independent ones: a unit's flights share its persistent errors. Intervals are of a bootstrap over units.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from psabench.koi.fleet.grade import COLUMNS, MINUTES, REASONS
from psabench.koi.geodesy import MILE_M
from psabench.link.signals import Floats
from psabench.quartz.draws import draw_source

FIRST_LATE = 3  # from the fourth flight on a passport knows something
RESAMPLES, LEVEL = 2000, (2.5, 97.5)

Rows = Mapping[str, Floats]  # by mode: (units, flights, columns)


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """With a 95 % interval."""

    value: float
    low: float
    high: float

    def text(self, digits: int = 2) -> str:
        return f"{self.value:.{digits}f} ({self.low:.{digits}f} to {self.high:.{digits}f})"


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeFigures:
    """Of one class and one mode, flights from FIRST_LATE on."""

    rms_m: Number  # of the larger errors in an hour, both axes
    p95_m: float
    worst_m: float
    factor: Number  # rms with neither over this rms, the same units
    within_mile: Number  # share of flights, both axes
    corrected: float  # share of flights
    weight: float  # mean weight for the passport


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterFigures:
    """Of the filter, over all flights of a mode."""

    heading_aligned_arcmin: float  # its own standard deviation, mean
    level_aligned_arcmin: float
    heading_arcmin: float  # at take-off
    level_arcmin: float
    heading_error_arcmin: float  # of the autonomous solution at take-off, rms
    nees: Number  # mean over its degrees of freedom
    nees_within: Number
    before: float  # estimates of what is corrected, at take-off and at the end, by the prior: rms, mode `dov`
    after: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Harm:
    """Both procedures under a condition, beside neither on the same flights."""

    condition: str
    rms_m: float
    p95_m: float
    none_rms_m: float
    none_p95_m: float
    corrected: float
    weight: float

    @property
    def ratios(self) -> tuple[float, float]:
        return self.rms_m / self.none_rms_m, self.p95_m / self.none_p95_m


def pick_column(rows: Floats, name: str) -> Floats:
    """A quantity, (units, flights)."""
    return rows[..., COLUMNS.index(name)]


def largest_errors(rows: Floats) -> Floats:
    """Largest errors in the hour, (units, flights, 2): latitude, longitude."""
    return np.stack([pick_column(rows, "max_n_m"), pick_column(rows, "max_e_m")], axis=-1)


def late_part(rows: Floats) -> Floats:
    """Flights when a passport knows something; of a shorter season the last."""
    return rows[:, min(FIRST_LATE, rows.shape[1] - 1) :]


def error_curves(rows: Floats) -> Floats:
    """Errors by minute, (units, flights, 2, minutes + 1)."""
    first = COLUMNS.index("n 0 min")
    return np.asarray(rows[..., first:].reshape(*rows.shape[:2], 2, MINUTES + 1))


def rms_curves(rows: Floats) -> Floats:
    """Over units: (flights, minutes + 1, 2), as linear.predict_fleet()."""
    return np.asarray(np.sqrt(np.mean(error_curves(rows) ** 2, axis=0)).swapaxes(1, 2))


def bootstrap_units(units: int, figure: Callable[[np.ndarray], float], seed: int, name: str) -> Number:
    """figure: of units chosen by number, (units,)."""
    rng = draw_source(seed, f"koi bootstrap {name}")
    values = [figure(rng.integers(0, units, units)) for _ in range(RESAMPLES)]
    low, high = (float(x) for x in np.percentile(values, LEVEL))
    return Number(value=figure(np.arange(units)), low=low, high=high)


def mode_figures(rows: Rows, mode: str, seed: int) -> ModeFigures:
    """rows: of the class; `none` among them."""
    mine, none = (late_part(rows[name]) for name in (mode, "none"))
    errors, squares = largest_errors(mine), np.mean(largest_errors(mine) ** 2, axis=(1, 2))
    before, within = np.mean(largest_errors(none) ** 2, axis=(1, 2)), np.mean(errors.max(axis=-1) <= MILE_M, axis=1)
    n = len(squares)
    return ModeFigures(
        rms_m=bootstrap_units(n, lambda k: float(np.sqrt(squares[k].mean())), seed, mode),
        p95_m=float(np.percentile(errors, 95.0)),
        worst_m=float(errors.max()),
        factor=bootstrap_units(n, lambda k: float(np.sqrt(before[k].mean() / squares[k].mean())), seed, mode),
        within_mile=bootstrap_units(n, lambda k: float(within[k].mean()), seed, mode),
        corrected=float(pick_column(mine, "corrected").mean()),
        weight=float(pick_column(mine, "weight").mean()),
    )


def filter_figures(by_mode: Rows, seed: int) -> FilterFigures:
    """Of the mode `both`; of what довыставка corrects those of `dov`, where nothing is known before."""
    rows = by_mode["both"]
    means = {
        name: float(pick_column(rows, f"{name}_arcmin").mean())
        for name in ("heading_sd_aligned", "level_sd_aligned", "heading_sd", "level_sd")
    }
    return FilterFigures(
        heading_aligned_arcmin=means["heading_sd_aligned"],
        level_aligned_arcmin=means["level_sd_aligned"],
        heading_arcmin=means["heading_sd"],
        level_arcmin=means["level_sd"],
        heading_error_arcmin=float(np.sqrt(np.mean(pick_column(rows, "heading_error_arcmin") ** 2))),
        nees=_mean_nees(rows, "nees", seed),
        nees_within=_mean_nees(rows, "nees_within", seed),
        before=_rms_of(pick_column(by_mode["dov"], "estimate_take_off")),
        after=_rms_of(pick_column(by_mode["dov"], "estimate_end")),
    )


def _rms_of(values: Floats) -> float:
    """Of those that are numbers."""
    kept = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(kept**2))) if kept.size else float("nan")


def _mean_nees(rows: Floats, name: str, seed: int) -> Number:
    ratio = np.mean(pick_column(rows, name) / pick_column(rows, f"{name}_dof"), axis=1)
    return bootstrap_units(len(ratio), lambda k: float(ratio[k].mean()), seed, name)


def left_by_flight(rows: Floats) -> Mapping[str, Floats]:
    """What the passport does not know of the persistent errors after each flight, rms over units, (flights,)."""
    names = [name for name in COLUMNS if name.startswith("left_")]
    return {name: np.sqrt(np.mean(pick_column(rows, name) ** 2, axis=0)) for name in names}


def harm_figures(condition: str, both: Floats, none: Floats) -> Harm:
    """Over all flights."""
    mine, other = largest_errors(both), largest_errors(none)
    return Harm(
        condition=condition,
        rms_m=float(np.sqrt(np.mean(mine**2))),
        p95_m=float(np.percentile(mine, 95.0)),
        none_rms_m=float(np.sqrt(np.mean(other**2))),
        none_p95_m=float(np.percentile(other, 95.0)),
        corrected=float(pick_column(both, "corrected").mean()),
        weight=float(pick_column(both, "weight").mean()),
    )


def count_reasons(rows: Floats) -> Iterator[tuple[str, float]]:
    """Shares of flights with each reason not to correct."""
    bits = pick_column(rows, "reasons").astype(np.int64)
    for k, name in enumerate(REASONS):
        if share := float(np.mean((bits >> k) & 1)):
            yield name, share

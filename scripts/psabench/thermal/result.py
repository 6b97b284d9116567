"""What a thermal run finds: a compensation of each quantity by each method, their uncertainty, and why they differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from psabench.budget.accuracy import BenchAccuracy
from psabench.errors import BadInput
from psabench.estimate.uncertainty import Estimate
from psabench.thermal.budget import Budget, Fitted, Key
from psabench.thermal.compensation import (
    Compensation,
    element_temperature,
    fit_soak,
    fit_sweep,
    turns_of,
)
from psabench.thermal.degree import DegreeRow, degree_rows
from psabench.thermal.leftover import Leftover, curves_of, element_of, leftover_of
from psabench.thermal.records import Recording
from psabench.thermal.reduce import Points, points_of, quantity_names, refined_points, up_leg
from psabench.thermal.schedule import Schedule, sweep_names

Array = npt.NDArray[np.float64]

START_C = 25.0  # of the chamber, before a run
NORMAL_C = 30.0  # the article's normal temperature: where a passport has its numbers
CASE_TAU_S, ELEMENT_TAU_S = 180.0, 360.0  # lags where no sweep has found them (E0)
SETTLE_STEP_S = 5.0
ENDS = 0.05  # of the range: what a loop is not taken from, at either end
DEGREES = (1, 2, 3, 4, 5, 6, 7, 8)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fits:
    """One quantity by one method."""

    quantity: str
    best: Compensation  # what a passport gets: with the lag where both legs are there
    leftover: Leftover  # what that leaves of the points
    one_leg: Compensation | None = None  # of a sweep's way up, against the case
    both_legs: Compensation | None = None  # the same of both legs, without a lag
    largest: float = 0.0  # of the quantity: residuals are percents of it

    def percent_of(self, residual: Array) -> float:
        """The largest one, of the largest value (zero) or change (scale, base); 0 where there is none."""
        return 100.0 * float(np.abs(residual).max()) / self.largest if self.largest else 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Method:
    """A segment of the run and its fits."""

    name: str  # soak; sweep-1
    rate_k_per_min: float | None  # of a sweep
    points: Points
    fits: dict[str, Fits]
    settling_k: float = 0.0  # that the element may miss the case by, at the end of a dwell
    play: bool = True  # whether the way to a temperature was not that of the soak

    @property
    def fitted(self) -> dict[Key, Fitted]:
        """What a budget needs."""
        return {
            (self.name, q): Fitted(
                method=self.name,
                points=self.points,
                best=f.best,
                leftover=f.leftover,
                settling_k=self.settling_k,
                play=self.play,
            )
            for q, f in self.fits.items()
        }

    @property
    def title(self) -> str:
        return self.name if self.rate_k_per_min is None else f"sweep at {self.rate_k_per_min:g} K/min"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ThermalResult:
    """Everything that a report shows; the truth has no part in it."""

    schedule: Schedule
    g_mps2: float
    recordings: tuple[Recording, ...]
    methods: tuple[Method, ...]
    budget: Budget
    estimates: dict[str, tuple[Estimate, ...]]  # by method, at normal_c
    normal_c: float
    accuracy: BenchAccuracy
    notes: tuple[str, ...]

    def method(self, name: str) -> Method | None:
        """None: the run has no such segment."""
        return next((m for m in self.methods if m.name == name), None)

    @property
    def sweeps(self) -> list[Method]:
        return [m for m in self.methods if m.rate_k_per_min is not None]


def estimate_run(
    recordings: Sequence[Recording], schedule: Schedule, g_mps2: float, accuracy: BenchAccuracy
) -> ThermalResult:
    """Pure. Raises BadInput where a method has too few recordings for its fits."""
    rates, samples = sweep_names(schedule), round(schedule.record_s * schedule.samples_hz)
    methods = tuple(
        _method_of(p, rates.get(name), schedule, recordings) for name, p in points_of(recordings, samples).items()
    )
    settling_k = _settling_k(methods, recordings, schedule)
    play = schedule.soak is not None and _goes_both_ways(schedule.soak.temperatures_c)
    methods = tuple(replace(m, settling_k=settling_k, play=play) if m.rate_k_per_min is None else m for m in methods)
    low = max(float(m.points.case_c.min()) for m in methods)
    high = min(float(m.points.case_c.max()) for m in methods)
    normal_c = min(max(NORMAL_C, low), high)
    budget = Budget(fitted={k: f for m in methods for k, f in m.fitted.items()}, accuracy=accuracy)
    estimates = {m.name: tuple(budget.estimate_at(m.name, q, normal_c) for q in m.fits) for m in methods}
    return ThermalResult(
        schedule=schedule,
        g_mps2=g_mps2,
        recordings=tuple(recordings),
        methods=methods,
        budget=budget,
        estimates=estimates,
        normal_c=normal_c,
        accuracy=accuracy,
        notes=tuple(note for m in methods for note in m.points.notes),
    )


def _method_of(p: Points, rate: float | None, schedule: Schedule, recordings: Sequence[Recording]) -> Method:
    """The points of a sweep are made twice: by the curves of the first time."""
    sweep = rate is not None
    best = _best_of(p, sweep, schedule.degree)
    if sweep:
        p = refined_points(p, recordings, curves_of(p, best))
        best = _best_of(p, sweep, schedule.degree)
    return Method(
        name=p.segment, rate_k_per_min=rate, points=p, fits={q: _fits_of(p, c, sweep) for q, c in best.items()}
    )


def _best_of(p: Points, sweep: bool, degree: int) -> dict[str, Compensation]:
    """With the lag where both legs are there; else of the way up, against the case."""
    if not (sweep and turns_of(p.case_c)):
        p = up_leg(p) if sweep else p
        return {q: fit_soak(q, p.case_c, p.quantity(q), degree) for q in quantity_names()}
    taus: dict[str, float | None] = {}
    found = {}
    for q in quantity_names():
        axis = q.split("_")[1][0]
        found[q] = c = fit_sweep(q, p.t_s, p.case_c, p.quantity(q), degree, history=p.history, tau_s=taus.get(axis))
        taus.setdefault(axis, c.lag.tau_s if c.lag else None)  # one element, and its zero shows the lag best
    return found


def _settling_k(methods: Sequence[Method], recordings: Sequence[Recording], schedule: Schedule) -> float:
    """What is left between case and element after the dwell that follows the longest way of a soak."""
    if schedule.soak is None:
        return 0.0
    found = [m for m in methods if m.fits["zero_x_ug"].best.lag]
    lags = [lag.tau_s for m in found for q in quantity_names()[:3] if (lag := m.fits[q].best.lag)]
    element_s = float(np.median(lags)) if lags else ELEMENT_TAU_S
    case_s = max(case_lag_s(recordings, m.name) for m in found) if found else CASE_TAU_S
    way_k = float(np.abs(np.diff([START_C, *schedule.soak.temperatures_c])).max())
    ramp_s = way_k / schedule.soak.ramp_k_per_min * 60.0
    t_s = np.arange(0.0, ramp_s + schedule.soak.dwell_s + SETTLE_STEP_S, SETTLE_STEP_S)
    case = element_temperature(t_s, np.minimum(t_s / ramp_s, 1.0) * way_k, case_s)
    return float(abs(case - element_temperature(t_s, case, element_s))[-1])


def _goes_both_ways(temps_c: Sequence[float]) -> bool:
    """Whether a soak comes to its temperatures, after the first one, from below and from above."""
    ways = np.sign(np.diff(temps_c))
    return bool(len(ways)) and bool(np.any(ways != ways[0]))


def _fits_of(p: Points, best: Compensation, sweep: bool) -> Fits:
    q, y = best.quantity, p.quantity(best.quantity)
    largest = float(np.abs(y).max() if q.startswith("zero") else np.ptp(y))
    one_leg = both_legs = None
    if sweep:
        up = up_leg(p)
        one_leg = fit_soak(q, up.case_c, up.quantity(q), best.degree)
        both_legs = fit_soak(q, p.case_c, y, best.degree) if best.lag else None
    leftover = leftover_of(p, best)
    return Fits(quantity=q, best=best, leftover=leftover, one_leg=one_leg, both_legs=both_legs, largest=largest)


# ---- the two methods beside each other


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """How a sweep differs from the soak, and what the lags that were found make of the soak's curve."""

    quantity: str
    largest: float  # of the quantity
    less_soak: float  # largest difference on the way up
    less_soak_predicted: float
    loop: float | None  # largest difference between the legs; None: one leg
    loop_predicted: float | None

    def percent(self, value: float) -> float:
        return 100.0 * value / self.largest if self.largest else 0.0


def difference_of(soak: Method, sweep: Method, quantity: str) -> Difference:
    """Where both methods have the quantity."""
    p, curve = sweep.points, soak.fits[quantity].best
    measured, predicted = p.quantity(quantity), predicted_sweep(soak, sweep, quantity)
    still = curve.value_at(p.case_c)
    inside = p.up & (p.case_c >= curve.low_c) & (p.case_c <= curve.high_c)
    loops = [_loop_of(p.case_c, y, p.up) for y in (measured, predicted)] if not p.up.all() else [None, None]
    return Difference(
        quantity=quantity,
        largest=sweep.fits[quantity].largest,
        less_soak=float(np.abs((measured - still)[inside]).max()),
        less_soak_predicted=float(np.abs((predicted - still)[inside]).max()),
        loop=loops[0],
        loop_predicted=loops[1],
    )


def predicted_sweep(soak: Method, sweep: Method, quantity: str) -> Array:
    """The soak's curve as a sweep shows it, (n,): by the lag and the column of the sweep's fit."""
    p, curve, found = sweep.points, soak.fits[quantity].best, sweep.fits[quantity].best
    element = element_of(p, found)
    per_k = found.lag.per_k if found.lag else 0.0
    return np.asarray(curve.value_at(element) + per_k * (p.case_c - element))


def _loop_of(case_c: Array, y: Array, up: npt.NDArray[np.bool_]) -> float:
    """Largest difference of the legs at the same temperature of the case, without the ends."""
    margin = ENDS * float(np.ptp(case_c))
    grid = np.linspace(float(case_c.min()) + margin, float(case_c.max()) - margin, 200)
    legs = []
    for leg in (up, ~up):
        order = np.argsort(case_c[leg])
        legs.append(np.interp(grid, case_c[leg][order], y[leg][order]))
    return float(np.abs(legs[0] - legs[1]).max())


@dataclass(frozen=True, slots=True, kw_only=True)
class Residuals:
    """Largest residuals of a quantity's fits, percent of its largest value; None: no such fit."""

    one_leg: float | None
    other_leg: float | None  # what the fit of the way up misses on the way down
    both_legs: float | None
    best: float


def residuals_of(m: Method, quantity: str) -> Residuals:
    """Of one method."""
    f, p, y = m.fits[quantity], m.points, m.points.quantity(quantity)
    element = element_of(p, f.best)
    up, down, one = up_leg(p), ~p.up, f.one_leg
    return Residuals(
        one_leg=f.percent_of(up.quantity(quantity) - one.value_at(up.case_c)) if one else None,
        other_leg=f.percent_of((y - one.value_at(p.case_c))[down]) if one and down.any() else None,
        both_legs=f.percent_of(y - f.both_legs.value_at(p.case_c)) if f.both_legs else None,
        best=f.percent_of(y - f.best.value_at(element, p.case_c - element)),
    )


def degrees_of(m: Method, quantity: str) -> list[DegreeRow]:
    """Degrees that the points allow, on one leg or the soak."""
    p = up_leg(m.points) if m.rate_k_per_min is not None else m.points
    most = min(max(DEGREES), len(np.unique(p.case_c)) - 2)
    try:
        return degree_rows(quantity, p.case_c, p.quantity(quantity), [d for d in DEGREES if d <= most])
    except BadInput:
        return []


def case_lag_s(recordings: Sequence[Recording], segment: str) -> float:
    """Lag of the case behind what the chamber shows in a segment, s: the one with the least squares."""
    rows = [r for r in recordings if r.segment == segment]
    t_s = np.array([r.t_s for r in rows])
    shown, case = np.array([r.chamber_degc for r in rows]), np.array([r.case_degc for r in rows])
    scan = np.geomspace(1.0, 3600.0, 200)
    off = element_temperature(t_s, shown, scan) - case[:, None]
    return float(scan[int(np.argmin((off**2).sum(axis=0)))])

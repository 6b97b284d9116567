"""What a run-in comes to: instability by cycle, gains with intervals, when to stop, batches of 30, limits. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from psabench.campaign.claims import Check
from psabench.quartz import batch as law
from psabench.quartz.batch import QUANTITIES, Batch
from psabench.quartz.draws import draw_source
from psabench.quartz.limits import ARTICLE, LAW_GAINS
from psabench.quartz.plate import Array

if TYPE_CHECKING:
    from psabench.quartz.run_in_wire import Agreement

ENOUGH = 1000  # units for a limit to mean anything
NORMAL95 = 1.96
SMALL, DRAWS = 30, 20000  # the article's batch has "more than 30"; how many of them are drawn from the units
STOP_PERCENT = 2.0  # one more cycle is worth less, in percent of the first change: close to nil
STOP_AT = 4  # the article
LAST = 5  # the change after four cycles
LAW_UNITS = 200_000
FAR_SD = 4.0  # a limit allows for so many standard deviations of what it limits
SHARE_30 = 0.68  # of honest batches of 30 that show "more than 2" (instruments 3.5)
SHARE_PER_GAIN = 1.0  # by how much that share goes with the gain of the units that they are drawn from


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """An estimate with its standard uncertainty over the units, type A."""

    value: float
    sd: float

    @property
    def half95(self) -> float:
        return NORMAL95 * self.sd


@dataclass(frozen=True, slots=True, kw_only=True)
class Small:
    """Gain in batches of SMALL units that are drawn from all: 5 and 95 % of them, share that shows the article's."""

    low: float
    median: float
    high: float
    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """Of one quantity."""

    quantity: str
    change: Array  # (units, cycles): size of the change from start to start, a cycle between
    means: Sequence[Number]  # by cycle
    gain: Number  # first mean over that of the fifth
    worth: Sequence[Number]  # of the cycle after the n-th, percent of the first mean: n = 1 ... cycles - 1
    small: Small
    gains_of_small: Array
    law_gain: float  # by the batch's law, of LAW_UNITS other units

    @property
    def stop(self) -> int | None:
        """After which cycle one more is worth less than STOP_PERCENT; None: after none of these."""
        return next((n for n, w in enumerate(self.worth, 1) if w.value < STOP_PERCENT), None)


def find_figures(values: Array, b: Batch, seed: int) -> Mapping[str, Figures]:
    """Of values (units, starts, 3), 6 starts at least; `seed` draws the small batches."""
    laws = law.draw_instability(b, seed + 1, LAW_UNITS, LAST)
    change = np.abs(np.diff(values, axis=1))
    picked = _pick_small(len(values), seed)
    return {q: _figures_of(q, change[..., k], picked, laws[q]) for k, q in enumerate(QUANTITIES)}


def _figures_of(quantity: str, change: Array, picked: Array, laws: Array) -> Figures:
    gains = _small_gains(change, picked)
    low, median, high = (float(x) for x in np.quantile(gains, (0.05, 0.5, 0.95)))
    wide = float((gains > ARTICLE[quantity][1]).mean())
    return Figures(
        quantity=quantity,
        change=change,
        means=[mean_of(c) for c in change.T],
        gain=ratio_of(change[:, 0], change[:, LAST - 1]),
        worth=[worth_of(change, n) for n in range(1, change.shape[1])],
        small=Small(low=low, median=median, high=high, share=wide),
        gains_of_small=gains,
        law_gain=float(laws[:, 0].mean() / laws[:, LAST - 1].mean()),
    )


def mean_of(x: Array) -> Number:
    """Mean over the units."""
    return Number(value=float(x.mean()), sd=float(x.std(ddof=1) / np.sqrt(len(x))))


def ratio_of(x: Array, y: Array) -> Number:
    """Mean of x over mean of y of the same units; sd to first order (delta method)."""
    ratio = x.mean() / y.mean()
    left = (x - ratio * y) / y.mean()
    return Number(value=float(ratio), sd=float(left.std(ddof=1) / np.sqrt(len(x))))


def worth_of(change: Array, n: int) -> Number:
    """By how much cycle n + 1 lowers the mean change, percent of the first."""
    fall = ratio_of(change[:, n - 1] - change[:, n], change[:, 0])
    return Number(value=100.0 * fall.value, sd=100.0 * fall.sd)


def _pick_small(units: int, seed: int) -> Array:
    """Units of each small batch, (DRAWS, SMALL)."""
    return np.asarray(draw_source(seed, "batches of 30").integers(0, units, (DRAWS, SMALL)))


def _small_gains(change: Array, picked: Array) -> Array:
    first, last = change[:, 0], change[:, LAST - 1]
    return np.asarray(first[picked].mean(axis=1) / last[picked].mean(axis=1))


# ---- grading: estimates against truth


@dataclass(frozen=True, slots=True, kw_only=True)
class Grade:
    """Of the estimates of one quantity: error over uncertainty."""

    quantity: str
    count: int
    u: float  # median, the quantity's unit
    z_rms: float
    covered: float  # share of 95 % intervals that contain the truth


T95_126 = 1.979  # two means of 64 looks each


def grade_values(values: Array, uncertain: Array, truth: Array) -> list[Grade]:
    """Arrays (units, starts, 3), of the same units."""
    z = (values - truth) / uncertain
    found = []
    for k, q in enumerate(QUANTITIES):
        own = z[..., k]
        covered, rms = float((np.abs(own) <= T95_126).mean()), float(np.sqrt(np.mean(own**2)))
        u = float(np.median(uncertain[..., k]))
        found.append(Grade(quantity=q, count=own.size, u=u, z_rms=rms, covered=covered))
    return found


# ---- limits


def limit_checks(found: Mapping[str, Figures], grades: Sequence[Grade], units: int) -> list[Check]:
    """Of the batch serial with the usual schedule; none for few units."""
    if units < ENOUGH:
        return []
    return [*_gain_checks(found), *_stop_checks(found), *_grade_checks(grades)]


def _gain_checks(found: Mapping[str, Figures]) -> Iterator[Check]:
    for q, f in found.items():
        middle, by = LAW_GAINS[q]
        yield Check(what=f"{q}: gain by run-in", value=f.gain.value, low=middle - by, high=middle + by)
        off = (f.gain.value - f.law_gain) / f.gain.sd
        yield Check(what=f"{q}: gain less the law's, sd", value=off, low=-FAR_SD, high=FAR_SD)
    zero = found["zero"]
    by = 0.03 + FAR_SD * SHARE_PER_GAIN * zero.gain.sd
    what = f"zero: share of batches of {SMALL} with more than 2"
    yield Check(what=what, value=zero.small.share, low=SHARE_30 - by, high=SHARE_30 + by)


def _stop_checks(found: Mapping[str, Figures]) -> Iterator[Check]:
    for q, f in found.items():
        worth = f.worth[STOP_AT - 1]
        most = STOP_PERCENT + FAR_SD * worth.sd
        yield Check(what=f"{q}: worth of the fifth cycle, %", value=worth.value, low=-most, high=most)


def _grade_checks(grades: Sequence[Grade]) -> Iterator[Check]:
    count = sum(g.count for g in grades)
    pooled = sum(g.covered * g.count for g in grades) / count
    yield Check(what="share of 95 % intervals that contain the truth", value=pooled, low=0.94, high=0.96)


WIRE_2U = (0.90, 1.0)  # share of changes within 2 u of the model's: 95 % expected, a hundred and more of them
WIRE_RMS = (0.5, 1.5)  # over u, of each quantity: 1 expected, four standard deviations of 50 changes that share starts
WIRE_ENOUGH = 100


def wire_checks(found: Sequence[Agreement]) -> list[Check]:
    """Of the units that were measured through the wire."""
    count = sum(a.count for a in found)
    if count < WIRE_ENOUGH:
        return []
    share = sum(a.within_2u * a.count for a in found) / count
    low, high = WIRE_2U
    what = "share of changes through the wire within 2 u of the model's"
    rms = "changes through the wire less the model's, rms over u"
    each = [Check(what=f"{a.quantity}: {rms}", value=a.z_rms, low=WIRE_RMS[0], high=WIRE_RMS[1]) for a in found]
    return [Check(what=what, value=share, low=low, high=high), *each]

"""The deformation study: elements with their tolerances over -60 to +85 degC, and what they say of two verdicts.

The article concludes from its equations that (1) the gap of the pickoff changes by no more than 0.5 %, and (2) geometry
cannot have the character of the zero signal's change, which is larger (fig. 2). Both are computed here as they can be
read. The third part is fig. 5: the instability of a serial batch, units out of tolerance, before and after run-in.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from psabench.procedures.head_bench import Progress
from psabench.quartz import batch as law
from psabench.quartz import plate as eq
from psabench.quartz.element import (
    COLD_DEGC,
    HOT_DEGC,
    Elements,
    Figures,
    draw_elements,
    nominal_element,
    part_of,
)
from psabench.quartz.plate import NORMAL_DEGC, Array

CLAIM_PERCENT = 0.5  # the article
CYCLES = 5  # the article: four cycles are enough; the fifth reading is after them
CHUNK = 1000  # elements at once: memory, no number depends on it
DEGC = np.linspace(COLD_DEGC, HOT_DEGC, 59)  # 2.5 K apart; 30 degC is one of them
AT_30 = int(np.argmin(np.abs(DEGC - NORMAL_DEGC)))
READINGS = ("held", "held, tolerances", "free", "free, tolerances")
SHOWN = 40  # units of fig. 5; the article's batch has more than 30
TURN_UG = 1e-9  # a change of direction by less is rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class Deformation:
    """Of each element: one row an element in every array."""

    gap_percent: Mapping[str, Array]  # reading: largest size of the gap's change over temperature, (elements,)
    zero_ug: Array  # (elements, temperatures): by the hinges, of which E and sizes depend on temperature
    turns: Array  # changes of direction of that curve
    force_angle_urad: Array  # (elements, 2): of 1 g at 30 degC, held by the loop and on the hinges alone


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """All that the report shows."""

    figures: Figures
    elements: int
    units: int
    seed: int
    batch_name: str
    batch: law.Batch
    deformation: Deformation
    curves: law.Curves
    curve_ug: Array  # (units, temperatures), as DEGC
    instability: Mapping[str, Array]  # quantity: (units, CYCLES)
    one_gap_urad: float  # turn of the pickoff's null if one gap alone changes by the article's 0.5 %
    one_gap_ug: float  # zero signal of that turn
    stiff_um: float  # thickness of hinges with which the free element keeps 0.5 % over temperature


def run_study(figures: Figures, batch_name: str, *, elements: int, units: int, seed: int, progress: Progress) -> Study:
    """Everything; the same seed gives the same numbers. Raises BadInput."""
    b = law.load_batch(batch_name)
    curves = law.draw_curves(b, seed, units)
    e = nominal_element(figures)
    one_gap_urad, one_gap_ug = one_gap(e)
    return Study(
        figures=figures,
        elements=elements,
        units=units,
        seed=seed,
        batch_name=batch_name,
        batch=b,
        deformation=deform_elements(draw_elements(figures, seed, elements), e, progress),
        curves=curves,
        curve_ug=curves.at(DEGC),
        instability=law.draw_instability(b, seed, units, CYCLES),
        one_gap_urad=one_gap_urad,
        one_gap_ug=one_gap_ug,
        stiff_um=stiff_thickness_um(e),
    )


# ---- elements over temperature


def deform_elements(elements: Elements, reference: Elements, progress: Progress) -> Deformation:
    """Of these elements, `CHUNK` at a time; `reference` has the sizes without tolerances."""
    starts = range(0, len(elements), CHUNK)
    found: list[Deformation] = []
    with progress.step("elements over temperature, thousands", len(starts)) as done:
        for first in starts:
            found.append(_deform_part(part_of(elements, slice(first, first + CHUNK)), reference))
            done()
    return Deformation(
        gap_percent={r: np.concatenate([f.gap_percent[r] for f in found]) for r in READINGS},
        zero_ug=np.concatenate([f.zero_ug for f in found]),
        turns=np.concatenate([f.turns for f in found]),
        force_angle_urad=np.concatenate([f.force_angle_urad for f in found]),
    )


def _deform_part(e: Elements, reference: Elements) -> Deformation:
    at = eq.expanded_plate(e.plate, e.material.expansion_per_k, DEGC)
    modulus_pa = e.material.modulus_pa(DEGC)
    zero_ug = eq.zero_ug(at, modulus_pa, e.position_rad, e.weight_n)
    free_rad = eq.hinge_angle_rad(e.weight_n, at, modulus_pa)
    held_rad = free_rad * eq.held_share(at, modulus_pa, e.spring_n_m_per_rad)
    return Deformation(
        gap_percent=dict(_gap_changes(e, reference)),
        zero_ug=zero_ug,
        turns=count_turns(zero_ug),
        force_angle_urad=1e6 * np.stack([held_rad[:, AT_30], free_rad[:, AT_30]], axis=1),
    )


def _gap_changes(e: Elements, reference: Elements) -> Iterator[tuple[str, Array]]:
    """Largest size of (S - S0) / S0 in percent: against the element at 30 degC, and against the element as designed.

    Both under the force of 1 g; S0 is the gap without force."""
    for how, held in (("held", True), ("free", False)):
        gap_m = gaps_m(e, held)
        designed_m = gaps_m(reference, held)[:, [AT_30]]
        own_m = gap_m[:, [AT_30]]
        yield how, _largest_percent((gap_m - own_m) / e.plate.gap_m)
        yield f"{how}, tolerances", _largest_percent((gap_m - designed_m) / reference.plate.gap_m)


def gaps_m(e: Elements, held: bool) -> Array:
    """(12) over DEGC under 1 g, (elements, temperatures): held by the electrical spring, or on the hinges alone."""
    at = eq.expanded_plate(e.plate, e.material.expansion_per_k, DEGC)
    modulus_pa = e.material.modulus_pa(DEGC)
    share = eq.held_share(at, modulus_pa, e.spring_n_m_per_rad) if held else 1.0
    return eq.gap_m(e.weight_n * share, at, modulus_pa)


def _largest_percent(change: Array) -> Array:
    return np.asarray(100.0 * np.abs(change).max(axis=1))


def count_turns(curves: Array) -> Array:
    """How often each row changes its direction: 2 for a dip and a hump."""
    step = np.diff(curves, axis=1)
    sign = np.where(np.abs(step) < TURN_UG, 0.0, np.sign(step))
    return np.asarray([_count_changes(row[row != 0.0]) for row in sign], float)


def _count_changes(sign: Array) -> int:
    return int(np.count_nonzero(sign[1:] != sign[:-1]))


def one_gap(e: Elements) -> tuple[float, float]:
    """If one gap of the pair alone changes by CLAIM_PERCENT: turn of the null, urad, and zero signal, ug.

    The pickoff's null is where S1 = S2, so half of the change, over the arm of the electrode; the hinges are bent by
    that much in balance (D)."""
    p = e.plate
    arm_m = 0.5 * p.hinge_m + p.neck_m + 0.5 * p.layer_m
    turn_rad = 0.5 * CLAIM_PERCENT / 100.0 * p.gap_m / arm_m
    modulus_pa = e.material.modulus_pa(NORMAL_DEGC)
    return 1e6 * float(turn_rad[0, 0]), float(eq.zero_ug(p, modulus_pa, turn_rad, e.weight_n)[0, 0])


def stiff_thickness_um(e: Elements) -> float:
    """Thickness at which the element on its hinges alone keeps CLAIM_PERCENT over temperature: its deflection goes with
    the thickness to the power -3 (7), all else of the change is smaller by orders (D)."""
    gap_m = gaps_m(e, held=False)
    percent = float(_largest_percent((gap_m - gap_m[:, [AT_30]]) / e.plate.gap_m)[0])
    return float(e.plate.thickness_m[0, 0] * 1e6 * np.cbrt(percent / CLAIM_PERCENT))


# ---- figures of the verdicts


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Of a positive quantity over all elements or units."""

    median: float
    p99: float
    largest: float

    @staticmethod
    def of(values: Array) -> Spread:
        return Spread(
            median=float(np.median(values)), p99=float(np.quantile(values, 0.99)), largest=float(values.max())
        )


def swing_ug(curves: Array) -> Array:
    """Difference of the greatest and the least value of each row."""
    return np.asarray(curves.max(axis=1) - curves.min(axis=1))


def hinge_ratio(d: Deformation) -> Array:
    """As the article's 3 to 16, of the hinges' part alone: greatest size over that at 30 degC; 1 where that is 0."""
    size_ug = np.abs(d.zero_ug)
    at_30_ug = size_ug[:, AT_30]
    safe_ug = np.where(at_30_ug > 0.0, at_30_ug, 1.0)
    return np.where(at_30_ug > 0.0, size_ug.max(axis=1) / safe_ug, 1.0)


def needed_factor(s: Study) -> float:
    """By how much the largest swing of the hinges falls short of the smallest swing of a unit of the batch."""
    most_ug = float(swing_ug(s.deformation.zero_ug).max())
    return float(swing_ug(s.curve_ug).min()) / most_ug if most_ug > 0.0 else np.inf


def grouped_turns(s: Study) -> Array:
    """Changes of direction of the curves of groups (a) and (b)."""
    return count_turns(s.curve_ug[s.curves.group < 2])


@dataclass(frozen=True, slots=True, kw_only=True)
class Yield:
    """Fig. 5: a quantity of the batch before and after run-in, against its tolerance."""

    quantity: str  # or "all": a unit that keeps all three
    unit: str
    tolerance: float
    before: float  # mean instability
    after: float
    out_before: float  # share of units out of tolerance
    out_after: float


def batch_yields(s: Study) -> list[Yield]:
    """Of each quantity, then of all three together. Before: the change at the first cycle; after: at the fifth."""
    rows, outside = [], {"before": np.zeros(s.units, bool), "after": np.zeros(s.units, bool)}
    for q in law.QUANTITIES:
        d, limit = s.instability[q], s.batch[f"{q}_tolerance_{law.UNITS[q]}"]
        before, after = d[:, 0] > limit, d[:, CYCLES - 1] > limit
        outside = {"before": outside["before"] | before, "after": outside["after"] | after}
        means = {"before": float(d[:, 0].mean()), "after": float(d[:, CYCLES - 1].mean())}
        shares = {"out_before": float(before.mean()), "out_after": float(after.mean())}
        rows.append(Yield(quantity=q, unit=law.UNITS[q], tolerance=limit, **means, **shares))
    shares = {f"out_{k}": float(v.mean()) for k, v in outside.items()}
    return [*rows, Yield(quantity="all", unit="", tolerance=np.nan, before=np.nan, after=np.nan, **shares)]

"""What the article's two verdicts and its fig. 5 come to, and the limits that the study's figures keep. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from psabench.campaign.claims import Check
from psabench.quartz import deformation as study
from psabench.quartz.batch import QUANTITIES, SERIAL
from psabench.quartz.deformation import CLAIM_PERCENT, CYCLES, Spread, Study
from psabench.quartz.element import change_figures
from psabench.quartz.limits import LAW_GAINS

ENOUGH = 1000  # elements and units for a limit to mean anything


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A statement of the article and what is found."""

    says: str
    found: str
    verdict: str


def judge_article(s: Study) -> list[Verdict]:
    """In the order of the article."""
    return [_judge_gap(s), _judge_shape(s), _judge_size(s), _judge_batch(s)]


def _judge_gap(s: Study) -> Verdict:
    gap = {r: Spread.of(v) for r, v in s.deformation.gap_percent.items()}
    held, tolerances, free = gap["held"], gap["held, tolerances"], gap["free"]
    kept = tolerances.largest <= CLAIM_PERCENT
    return Verdict(
        says=f"the gap of the pickoff changes by no more than {CLAIM_PERCENT:g} %",
        found=f"largest of {s.elements}: {held.largest:.4f} % over temperature, {tolerances.largest:.3f} % with the "
        f"tolerances, held by the loop; {free.median:.1f} % on hinges of these sizes alone, {CLAIM_PERCENT:g} % on "
        f"hinges of {s.stiff_um:.0f} µm",
        verdict=f"{'reproduced' if kept else 'not reproduced'} for an element that the loop holds; "
        "the article does not say which, and gives no size",
    )


def _judge_shape(s: Study) -> Verdict:
    hinge, curve = s.deformation.turns, study.grouped_turns(s)
    never = not hinge.any()
    return Verdict(
        says="geometry cannot have the character of the zero signal's change (fig. 2)",
        found=f"changes of direction from -60 to +85 °C: at most {hinge.max():.0f} by the hinges, "
        f"{curve.min():.0f} to {curve.max():.0f} in groups (a) and (b)",
        verdict="reproduced: E(T) is a straight line, a dip and a hump are none" if never else "not reproduced",
    )


def _judge_size(s: Study) -> Verdict:
    hinge, unit = Spread.of(study.swing_ug(s.deformation.zero_ug)), study.swing_ug(s.curve_ug)
    factor, ratio = study.needed_factor(s), float(study.hinge_ratio(s.deformation).max())
    return Verdict(
        says="the zero signal changes in a larger range: 3 to 16 times",
        found=f"{ratio:.3f} times by the hinges, at most {hinge.largest:.1f} µg; the least change of a unit is "
        f"{unit.min():.0f} µg, {factor:.0f} times more",
        verdict=f"{'reproduced' if factor > 1.0 else 'not reproduced'}, but not by the {CLAIM_PERCENT:g} %: if one gap "
        f"alone changes by that, the null turns by {s.one_gap_urad:.1f} µrad and the zero signal by "
        f"{s.one_gap_ug:.0f} µg",
    )


def _judge_batch(s: Study) -> Verdict:
    zero, *_, whole = study.batch_yields(s)
    return Verdict(
        says="serial units are unstable, some out of tolerance (fig. 5)",
        found=f"zero signal: {100 * zero.out_before:.1f} % of {s.units} out of ±{zero.tolerance:g} µg before run-in, "
        f"{100 * zero.out_after:.1f} % after; yield in all three quantities {100 * (1 - whole.out_before):.1f} and "
        f"{100 * (1 - whole.out_after):.1f} %",
        verdict="shown with a batch made for it: sizes and tolerances are E0",
    )


# ---- limits


def limit_checks(s: Study) -> list[Check]:
    """Of the study with its own figures and the batch serial; none for others, and for few elements or units."""
    usual = s.figures == change_figures() and s.batch_name == SERIAL
    return [*_element_checks(s), *_batch_checks(s)] if usual and min(s.elements, s.units) >= ENOUGH else []


def _element_checks(s: Study) -> Iterator[Check]:
    d = s.deformation
    for reading in ("held", "held, tolerances"):
        largest = float(d.gap_percent[reading].max())
        yield Check(what=f"gap, {reading}, largest, %", value=largest, low=0.0, high=CLAIM_PERCENT)
    yield Check(what="changes of direction by the hinges, most", value=float(d.turns.max()), low=0.0, high=0.0)
    least = float(study.grouped_turns(s).min())
    yield Check(what="changes of direction of groups (a), (b), least", value=least, low=1.0, high=2.0)
    ratio = float(study.hinge_ratio(d).max())
    yield Check(what="ratio by the hinges, largest", value=ratio, low=1.0, high=s.batch["ratio_min"])
    yield Check(
        what="least swing of a unit over largest of the hinges", value=study.needed_factor(s), low=2.0, high=1e9
    )


def _batch_checks(s: Study) -> Iterator[Check]:
    ratio = s.curves.ratio()
    low, high = s.batch["ratio_min"], s.batch["ratio_max"]
    yield Check(what="ratio of the units, least", value=float(ratio.min()), low=low, high=high)
    yield Check(what="ratio of the units, greatest", value=float(ratio.max()), low=low, high=high)
    for q in QUANTITIES:
        value, by = LAW_GAINS[q]
        yield Check(what=f"run-in, {q}, times", value=run_in_gain(s, q), low=value - by, high=value + by)
    for y in study.batch_yields(s):
        less = y.out_after / y.out_before if y.out_before > 0.0 else np.inf
        yield Check(what=f"out of tolerance, {y.quantity}, after over before", value=less, low=0.0, high=0.5)


def run_in_gain(s: Study, quantity: str) -> float:
    """Mean instability at the first cycle over that at the fifth."""
    mean = s.instability[quantity].mean(axis=0)
    return float(mean[0] / mean[CYCLES - 1])

"""Results of one method at several temperatures, and what they say together: coefficients against temperature. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from psabench.budget.gum import combined_u, expanded_u
from psabench.estimate.uncertainty import Component, Estimate
from psabench.link.signals import Floats
from psabench.procedures.result import LIMIT_CI
from psabench.report.grading import Graded, Section, grade, ratio_of

REFERENCE_DEGC = 25.0  # at which a sensor's parameters and a chain's tolerances are given
TEMPERATURE = "temperature"  # component of psabench.budget.influences that grows with the distance from there
CONSTANT = ("chain gain", "chain zero", "circle")  # the same at all temperatures: not in a slope
SENSITIVITIES = ("kx_v_per_g", "ky_v_per_g", "kz_v_per_g")  # parameters that go with the temperature of a MEMS sensor


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """The method at one temperature."""

    degc: float
    section: Section


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """One parameter against temperature: what was found at each, and the slope of the straight line through it."""

    found: tuple[Graded, ...]  # at the temperatures in turn
    slope: Estimate  # its name and unit: per K
    truth_per_k: float | None

    @property
    def en(self) -> float | None:
        """Error of the slope over its U."""
        if self.truth_per_k is None:
            return None
        return ratio_of(self.slope.value - self.truth_per_k, self.slope.ci_half)

    @property
    def within(self) -> bool:
        return self.en is None or abs(self.en) <= LIMIT_CI


def at_temperature(truth: Mapping[str, float], degc: float) -> dict[str, float]:
    """A MEMS sensor's true parameters at the temperature of its element."""
    off_k = degc - REFERENCE_DEGC
    by = 1.0 + truth.get("k_tc_ppm_per_k", 0.0) * 1e-6 * off_k
    warm = {name: truth[name] * by for name in SENSITIVITIES if name in truth}
    return {**truth, **warm, "u0_v": truth["u0_v"] + truth.get("u0_tc_v_per_k", 0.0) * off_k}


def courses_of(points: Sequence[Point]) -> list[Course]:
    """Of every estimate that is identifiable at all temperatures."""
    degc = np.array([p.degc for p in points])
    graded = [{g.estimate.name: g for g in grade(p.section)} for p in points]
    names = [n for n, g in graded[0].items() if all(n in at and at[n].estimate.identifiable for at in graded)]
    return [_course_of(degc, tuple(at[n] for at in graded)) for n in names]


def weights_per_k(degc: Floats) -> Floats:
    """Of values in the slope of the straight line through them."""
    off_k = degc - degc.mean()
    return np.asarray(off_k / float(off_k @ off_k))


def _course_of(degc: Floats, found: tuple[Graded, ...]) -> Course:
    w = weights_per_k(degc)
    values = np.array([g.estimate.value for g in found])
    truths = [g.truth for g in found]
    first = found[0].estimate
    components = _slope_budget(degc, w, [g.estimate for g in found])
    slope = replace(
        first,
        name=f"{first.name}_per_k",
        unit=f"{first.unit}/K",
        value=float(w @ values),
        sd=combined_u(components),
        ci_half=expanded_u(components),
        budget=tuple(components),
    )
    known = [t for t in truths if t is not None]
    return Course(
        found=found, slope=slope, truth_per_k=float(w @ np.array(known)) if len(known) == len(truths) else None
    )


def _slope_budget(degc: Floats, w: Floats, each: Sequence[Estimate]) -> list[Component]:
    """Independent components as the root of squares, the chain's own drift in line with the temperature."""
    by_name: dict[str, list[tuple[float, Component]]] = {}
    for weight, e in zip(w, each, strict=True):
        for c in e.budget:
            by_name.setdefault(c.name, []).append((float(weight), c))
    independent = [
        Component(name=name, u=math.sqrt(sum((a * c.u) ** 2 for a, c in rows)), dof=sum(c.dof for _, c in rows))
        for name, rows in by_name.items()
        if name not in (*CONSTANT, TEMPERATURE)
    ]
    drift_u = [next((c.u for c in e.budget if c.name == TEMPERATURE), 0.0) for e in each]
    in_line = abs(float(w @ (np.sign(degc - REFERENCE_DEGC) * np.array(drift_u))))
    return [*independent, *([Component(name="chain's drift", u=in_line)] if in_line > 0.0 else [])]

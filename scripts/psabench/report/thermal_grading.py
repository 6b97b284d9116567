"""A thermal run beside the truth, and its methods beside each other: tables as data for console, page, result.json.

The truth is what the emulator says of its sensors' outputs at each recording of the soak (`thermal-truth.csv`). A
compensation is compared with it at the temperature of the element. No part of the procedure reads it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from psabench.budget.gum import COVERAGE
from psabench.errors import BadInput, expected
from psabench.procedures.result import LIMIT_CI
from psabench.report.grading import Compared, aligned, as_ratio, estimate_dict, finite_or_none, with_ci
from psabench.thermal.budget import unit_of
from psabench.thermal.compensation import compensation_dict
from psabench.thermal.records import TRUTH_COLUMNS, Recording, RunFolder, number_in, read_rows
from psabench.thermal.reduce import SIDE_FACES, Points, points_of, quantity_names
from psabench.thermal.result import (
    Difference,
    Method,
    ThermalResult,
    case_lag_s,
    degrees_of,
    difference_of,
    residuals_of,
)
from psabench.thermal.schedule import POSITIONS

Table = list[tuple[str, ...]]
REACHED_K = 0.2  # beyond the end of a fit: the noise of the sensor


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ThermalTruth:
    """Of the soak: points of the true outputs, and temperatures of the element, (n,)."""

    points: Points
    element_c: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class GradedAt(Compared):
    """A quantity of one method at one temperature of the element."""

    method: str
    temp_c: float

    @property
    def within(self) -> bool | None:
        return None if self.error is None else abs(self.error) <= LIMIT_CI * self.estimate.ci_half


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ThermalReport:
    """A result with what it is compared with; made once, shown everywhere."""

    result: ThermalResult
    graded: tuple[GradedAt, ...]  # (): no truth
    differences: Mapping[str, tuple[Difference, ...]]  # by sweep; {}: no soak
    facts: Mapping[str, str]


def read_truth(folder: RunFolder, recordings: Sequence[Recording]) -> ThermalTruth | None:
    """None: nothing is known, or the run has no soak. Raises BadInput for a file of other recordings."""
    rows = _truth_rows(folder.truth)
    if not rows or not any(r.segment == "soak" for r in recordings):
        return None
    if len(rows) < len(recordings):
        raise BadInput(expected(f"{len(recordings)} rows", len(rows), folder.truth))
    true: list[Recording] = []
    element: dict[int, list[float]] = {}
    for r, row in zip(recordings, rows, strict=False):
        if row["t_s"] != r.t_s:
            raise BadInput(expected(f"the truth at {r.t_s:g} s", f"{row['t_s']:g} s", folder.truth))
        if r.segment == "soak":
            true.append(_true_recording(r, row))
            element.setdefault(r.part, []).append(row["element_degc"])
    return ThermalTruth(points=points_of(true)["soak"], element_c=np.array([np.mean(t) for t in element.values()]))


def _truth_rows(path: Path) -> list[dict[str, float]]:
    """By column. Raises BadInput for a file of another form."""
    return [{n: number_in(n, text, where) for n, text in row.items()} for where, row in read_rows(path, TRUTH_COLUMNS)]


def _true_recording(r: Recording, at: Mapping[str, float]) -> Recording:
    """What it should have been: true outputs at the loads, the head's true angle."""
    across = at["a_z_g"] if POSITIONS[r.position].face in SIDE_FACES else at["a_y_g"]
    alpha_deg = float(np.degrees(np.arctan2(-at["a_x_g"], -across)))
    return replace(
        r,
        alpha_deg=alpha_deg,
        x_v=at["out_x_v"],
        y_v=at["out_y_v"],
        z_v=at["out_z_v"],
        sd_x_v=0.0,
        sd_y_v=0.0,
        sd_z_v=0.0,
    )


def graded_report(result: ThermalResult, truth: ThermalTruth | None, facts: Mapping[str, str]) -> ThermalReport:
    """Everything that is compared."""
    soak = result.method("soak")
    differences = {
        m.name: tuple(difference_of(soak, m, q) for q in quantity_names()) for m in result.sweeps if soak is not None
    }
    graded = tuple(_graded_rows(result, truth)) if truth else ()
    return ThermalReport(result=result, graded=graded, differences=differences, facts=facts)


def _graded_rows(result: ThermalResult, truth: ThermalTruth) -> list[GradedAt]:
    """At the coldest, the normal and the hottest temperature of the soak that a method's fits have reached."""
    rows = []
    for m in result.methods:
        for k in _graded_at(m, truth.element_c, result.normal_c):
            temp_c = float(truth.element_c[k])
            for q in quantity_names():
                e = result.budget.estimate_at(m.name, q, temp_c)
                true = float(truth.points.quantity(q)[k])
                rows.append(GradedAt(method=m.name, temp_c=temp_c, estimate=e, truth=true, error=e.value - true))
    return rows


def _graded_at(m: Method, element_c: Any, normal_c: float) -> list[int]:
    """Which temperatures of the soak, within what the fit's element has had."""
    c = m.fits["zero_x_ug"].best
    reached = [k for k, t in enumerate(element_c) if c.low_c - REACHED_K <= t <= c.high_c + REACHED_K]
    return sorted(
        {min(reached, key=lambda k: abs(element_c[k] - t)) for t in (c.low_c, normal_c, c.high_c)} if reached else ()
    )


def within_limits(report: ThermalReport) -> bool:
    """Exit status 0 or 1."""
    return all(g.within is not False for g in report.graded)


def state_verdict(report: ThermalReport) -> str:
    """What was compared with what, and how it came out."""
    if not report.graded:
        return "No truth given: the compensations stand alone."
    n, out = len(report.graded), sum(g.within is False for g in report.graded)
    temps = ", ".join(f"{t:.0f}" for t in sorted({round(g.temp_c) for g in report.graded}))
    beyond = sum(abs(g.en or 0.0) > 1.0 for g in report.graded)
    head, within = ("All", "within") if out == 0 else (f"{out} of", "not within")
    return (
        f"{head} {n} values of the compensations at {temps} °C are {within} {LIMIT_CI:g} U of the sensors' true "
        f"outputs in the soak, {beyond} are beyond U (expected: {(1.0 - COVERAGE) * n:.1f})."
    )


# ---- tables, the head first


def estimates_table(report: ThermalReport, method: Method) -> Table:
    """The quantities at the normal temperature, beside the truth where it is nearest."""
    rows: Table = [("", "value", "U", "unit", "degree", "lag, s")]
    for e in report.result.estimates[method.name]:
        value, half = with_ci(e.value, e.ci_half)
        c = method.fits[e.name].best
        rows.append((e.name, value, half, e.unit, str(c.degree), f"{c.lag.tau_s:.0f}" if c.lag else ""))
    return rows


def graded_table(report: ThermalReport, method: str) -> Table:
    """A method beside the truth."""
    rows: Table = [("", "at, °C", "found", "U", "unit", "truth", "error", "En", "")]
    for g in report.graded:
        if g.method == method:
            value, half = with_ci(g.estimate.value, g.estimate.ci_half)
            error, mark = f"{g.error:+.2g}", "" if g.within else "OUT OF LIMITS"
            truth = with_ci(float(g.truth or 0.0), g.estimate.ci_half)[0]
            name, unit = g.estimate.name, g.estimate.unit
            rows.append((name, f"{g.temp_c:.1f}", value, half, unit, truth, error, as_ratio(g.en, 2), mark))
    return rows


def residuals_table(report: ThermalReport, kinds: Sequence[str] = ("zero", "scale")) -> Table:
    """Largest residual of each fit, %, a row a quantity and method: the article's 0.7 % is of one leg."""
    rows: Table = [("", "of", "soak or one leg", "that on the other leg", "both legs", "with the lag", "lag, s")]
    for m in report.result.methods:
        for q in (q for q in quantity_names() if q.split("_")[0] in kinds):
            r, lag = residuals_of(m, q), m.fits[q].best.lag
            one = r.best if r.one_leg is None else r.one_leg
            cells = [_percent_text(x) for x in (one, r.other_leg, r.both_legs, r.best if lag else None)]
            rows.append((q, m.title, *cells, f"{lag.tau_s:.0f}" if lag else ""))
    return rows


def _percent_text(x: float | None) -> str:
    return "" if x is None else f"{x:.2f} %"


def difference_table(report: ThermalReport, sweep: str, kinds: Sequence[str] = ("zero", "scale")) -> Table:
    """Sweep less soak and the loop, as measured and as the lag predicts."""
    rows: Table = [("", "less soak", "predicted", "loop", "predicted", "unit", "less soak", "loop")]
    for d in report.differences.get(sweep, ()):
        if d.quantity.split("_")[0] in kinds:
            values = (d.less_soak, d.less_soak_predicted, d.loop, d.loop_predicted)
            scale, unit = _shown_unit(d.quantity)
            cells = ["" if v is None else f"{v * scale:.3g}" for v in values]
            loop = None if d.loop is None else d.percent(d.loop)
            rows.append((d.quantity, *cells, unit, _percent_text(d.percent(d.less_soak)), _percent_text(loop)))
    return rows


def _shown_unit(quantity: str) -> tuple[float, str]:
    """A difference of scale factors is some microvolts per g."""
    return (1e6, "µV/g") if quantity.startswith("scale") else (1.0, unit_of(quantity))


def rates_table(report: ThermalReport) -> Table:
    """Residuals of the zero signals against the rate of the sweep, the worst of the axes."""
    rows: Table = [("rate, K/min", "one leg", "that on the other leg", "both legs", "with the lag")]
    for m in report.result.sweeps:
        found = [residuals_of(m, f"zero_{a}_ug") for a in "xyz"]
        worst = [
            max((x for x in column if x is not None), default=None)
            for column in zip(*((r.one_leg, r.other_leg, r.both_legs, r.best) for r in found), strict=True)
        ]
        rows.append((f"{m.rate_k_per_min:g}", *map(_percent_text, worst)))
    return rows


def degree_table(method: Method, quantity: str) -> Table:
    """Residual, AIC and BIC of each degree."""
    rows: Table = [("degree", "largest residual", "rms", "AIC", "BIC")]
    for d in degrees_of(method, quantity):
        rows.append((str(d.degree), _percent_text(d.most_percent), f"{d.rms:.3g}", f"{d.aic:.1f}", f"{d.bic:.1f}"))
    return rows


def interpolation_lines(report: ThermalReport) -> list[str]:
    """What the interpolation between the visits of a position is off by."""
    lines = []
    for m in report.result.sweeps:
        scale = float(m.points.scale_v_per_g.mean())
        rms, most = (float(x.max()) / scale * 1e6 for x in _interpolation_of(m))
        lines.append(
            f"{m.title}: positions are interpolated to one instant a round; that is off by {rms:.2g} µg rms, "
            f"{most:.2g} µg at most, found by leaving out recordings"
        )
    return lines


def _interpolation_of(m: Method) -> tuple[Any, Any]:
    return m.points.interpolation_v, m.points.interpolation_most_v


def console_lines(report: ThermalReport) -> str:
    """What the terminal shows."""
    parts = []
    for m in report.result.methods:
        table = graded_table(report, m.name) if report.graded else estimates_table(report, m)
        parts.append("\n  ".join([m.title, *aligned(table, left=(0, 8) if report.graded else (0,))]))
    parts.append("\n  ".join(["largest residuals", *aligned(residuals_table(report), left=(0, 1))]))
    for m in report.result.sweeps:
        if m.name in report.differences:
            title = f"{m.title}, less the soak and between its legs"
            parts.append("\n  ".join([title, *aligned(difference_table(report, m.name))]))
    return "\n\n".join([*parts, "\n".join([*interpolation_lines(report), *report.result.notes])])


# ---- result.json


def section_dict(report: ThermalReport, m: Method) -> dict[str, Any]:
    """A method of result.json: its estimates are those of a passport, each with its compensation."""
    graded = [g for g in report.graded if g.method == m.name]
    return {
        "label": m.name,
        "procedure": "thermal",
        "rate_k_per_min": m.rate_k_per_min,
        "range_c": [float(m.points.case_c.min()), float(m.points.case_c.max())],
        "at_c": report.result.normal_c,
        "points": len(m.points.t_s),
        "case_lag_s": case_lag_s(report.result.recordings, m.name) if m.rate_k_per_min is not None else None,
        "interpolation_v": m.points.interpolation_v.tolist(),
        "estimates": [
            {
                **estimate_dict(e),
                "within_limits": _within_of(graded, e.name),
                "residual_percent": residuals_of(m, e.name).best,
                "compensation": compensation_dict(m.fits[e.name].best),
            }
            for e in report.result.estimates[m.name]
        ],
        "graded": [_graded_dict(g) for g in graded],
        "differences": [_difference_dict(d) for d in report.differences.get(m.name, ())],
    }


def _within_of(graded: Sequence[GradedAt], name: str) -> bool | None:
    found = [g.within for g in graded if g.estimate.name == name and g.within is not None]
    return all(found) if found else None


def _graded_dict(g: GradedAt) -> dict[str, Any]:
    return {
        "name": g.estimate.name,
        "temp_c": g.temp_c,
        "value": g.estimate.value,
        "expanded_u": g.estimate.ci_half,
        "truth": g.truth,
        "error": g.error,
        "en": finite_or_none(g.en),
        "within_limits": g.within,
    }


def _difference_dict(d: Difference) -> dict[str, Any]:
    return {
        "quantity": d.quantity,
        "largest": d.largest,
        "less_soak": d.less_soak,
        "less_soak_predicted": d.less_soak_predicted,
        "loop": d.loop,
        "loop_predicted": d.loop_predicted,
    }


def result_dict(report: ThermalReport) -> dict[str, Any]:
    """result.json: plain data, units in the names."""
    return {
        "format": 1,
        "procedure": "thermal",
        "facts": dict(report.facts),
        "within_limits": within_limits(report),
        "recordings": len(report.result.recordings),
        "sections": [section_dict(report, m) for m in report.result.methods],
        "notes": list(report.result.notes),
    }

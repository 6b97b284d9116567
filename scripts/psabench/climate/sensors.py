"""`psabench run turns --climate`, and the others of the dividing head: the same method at temperatures of a chamber.

The article has climatic tests repeat the test turns with other equipment: a chamber about head and unit. At each
temperature the procedure is the one that runs without a chamber, with its budget for a board so far from 25 degC.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from psabench.bench import Bench
from psabench.climate.coefficients import REFERENCE_DEGC, Course, Point, at_temperature, courses_of
from psabench.climate.soak import soak_units
from psabench.procedures.command_line.offered import SITE_G_MPS2, Condition
from psabench.procedures.head_bench import Progress
from psabench.procedures.registry import PROCEDURES, Procedure
from psabench.procedures.result import LIMIT_CI, made_params
from psabench.procedures.run import Measurement, RunOptions, accuracy_of, facts_of, measure_on, open_bench
from psabench.procedures.wire_bench import WireBench
from psabench.report import calibration
from psabench.report.grading import aligned, as_ratio, finite_or_none, with_ci, within_limits
from psabench.report.page import section, table

CLIMATE = Condition(label="", scenario="climate", average=16, g_mps2=SITE_G_MPS2)
POINTS_DEGC = (-40.0, 0.0, 25.0, 60.0, 85.0)
SOAK_S = 1200.0  # after the air is there: 20 time constants of the scenario's unit
START_S = 2.0  # from power-on until the board is set up


@dataclass(frozen=True, slots=True, kw_only=True)
class ClimateRun:
    """A run that is over."""

    page: Path
    points: tuple[Point, ...]
    courses: tuple[Course, ...]

    @property
    def sections(self) -> list[calibration.Section]:
        return [p.section for p in self.points]

    @property
    def within(self) -> bool:
        """Everything found, at each temperature and per kelvin, is within its limits."""
        return within_limits(self.sections) and all(c.within for c in self.courses)


def run_climate(options: RunOptions, progress: Progress) -> ClimateRun:
    """One procedure at every temperature; writes the report. Raises BadInput, BenchError."""
    options.refuse_one_bench("--climate")  # a chamber is in none of them
    (name,) = options.procedures
    procedure, options = PROCEDURES[name], replace(options, scenario=options.scenario or Path(CLIMATE.scenario))
    params = made_params(procedure.params, name, options.params or {})
    options.out.mkdir(parents=True, exist_ok=True)
    with open_bench(CLIMATE, options) as bench:
        points = tuple(_measure_at(bench, degc, procedure, params, options, progress) for degc in POINTS_DEGC)
    found = tuple(courses_of(points))
    more = section("Against temperature", table(course_table(points, found), 2))
    data = {"temperatures_degc": [p.degc for p in points], "against_temperature": [_course_dict(c) for c in found]}
    page = calibration.write(options.out, [p.section for p in points], facts_of(options), more=more, data=data)
    return ClimateRun(page=page, points=points, courses=found)


def _measure_at(
    bench: Bench, degc: float, procedure: Procedure, params: Any, options: RunOptions, progress: Progress
) -> Point:
    shown = soak_units(bench, degc, SOAK_S, START_S)
    average, g_mps2 = options.average_for(CLIMATE), options.gravity_for(CLIMATE)
    known = accuracy_of({}, options)
    m = Measurement(
        procedure=procedure,
        params=params,
        accuracy=replace(known, chain_off_k=abs(shown - REFERENCE_DEGC)),
        average=average,
        label=f"{shown:g} °C",
        csv=options.out / f"{procedure.name}-{shown:+g}.csv",
    )
    measured = measure_on(bench, WireBench(bench.unit, bench.head, average=average, g_mps2=g_mps2), m, progress)
    truth = measured.truth and at_temperature(measured.truth, float(bench.truth_state()["unit"]["element_degc"]))
    return Point(degc=shown, section=replace(measured, truth=truth))


def _course_dict(c: Course) -> Mapping[str, object]:
    return {
        "name": c.slope.name,
        "unit": c.slope.unit,
        "values": [g.estimate.value for g in c.found],
        "per_k": c.slope.value,
        "expanded_u": c.slope.ci_half,
        "budget": {x.name: x.u for x in c.slope.budget},
        "truth_per_k": c.truth_per_k,
        "en": finite_or_none(c.en),
        "within_limits": c.within,
    }


def course_table(points: tuple[Point, ...], found: tuple[Course, ...]) -> list[tuple[str, ...]]:
    """Each parameter at each temperature, and its slope beside the true one; head and units first."""
    rows: list[tuple[str, ...]] = [
        ("", "unit", *(f"{p.degc:g} °C" for p in points), "per K", "U", "truth", "En"),
        ("", "", *[""] * len(points), "10⁻⁶/K", "10⁻⁶/K", "10⁻⁶/K", ""),
    ]
    for c in found:
        values = (with_ci(g.estimate.value, g.estimate.ci_half)[0] for g in c.found)
        truth = "" if c.truth_per_k is None else f"{round(c.truth_per_k * 1e6, 3) + 0.0:.3f}"  # -0.0: none
        slope, u = with_ci(c.slope.value * 1e6, c.slope.ci_half * 1e6)
        rows.append((c.found[0].estimate.name, c.found[0].estimate.unit, *values, slope, u, truth, as_ratio(c.en, 2)))
    return rows


def console_table(r: ClimateRun) -> str:
    """What the terminal shows."""
    rows = aligned(course_table(r.points, r.courses), left=(0, 1))
    return "\n  ".join([f"{r.points[0].section.result.procedure} against temperature", *rows])


def verdict_of_slopes(r: ClimateRun) -> str:
    """How the slopes came out; those of each temperature have their own line."""
    compared = [c for c in r.courses if c.en is not None]
    out = sum(not c.within for c in compared)
    head = f"{out} of {len(compared)} slopes are not" if out else f"All {len(compared)} slopes are"
    return f"{head} within {LIMIT_CI:g} U of the sensor's true coefficients per kelvin."

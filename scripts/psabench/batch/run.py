"""`psabench run turns --batch`: test turns of all sensors of all units in one pass, passports, spread."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from psabench.batch.bench import BatchBench, Place
from psabench.bench import Bench
from psabench.boards.psa2.device import CODE_V, Psa2
from psabench.boards.registry import DBC_NODE
from psabench.budget.accuracy import BenchAccuracy
from psabench.budget.influences import expand_result
from psabench.errors import BadInput, expected
from psabench.options import refuse_beside
from psabench.passport.entry import runs_of_result
from psabench.passport.store import PassportStore
from psabench.procedures.command_line.offered import SITE_G_MPS2, Condition
from psabench.procedures.head_bench import Progress, Reading, Watch
from psabench.procedures.recording import CsvRecorder
from psabench.procedures.registry import PROCEDURES
from psabench.procedures.result import made_params
from psabench.procedures.run import RunOptions, accuracy_of, axis_truth, facts_of, open_bench
from psabench.procedures.series import wander_doubts
from psabench.procedures.turns import TurnsParams, expected_of_pairs, fit_turns, pairs_of_channel, turns
from psabench.report import calibration
from psabench.report.grading import Section, aligned, grade, verdict, with_ci, within_limits
from psabench.report.page import section, table, verdict_line, whole_page, write_report

BATCH = Condition(label="", scenario="batch", average=16, g_mps2=SITE_G_MPS2)
STORE = "passports.sqlite"
TYPE = "mems"  # of the units in the store
TITLE = "Test turns of a batch"


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """A parameter over the sensors of a batch."""

    name: str
    unit: str
    values: tuple[float, ...]
    u: float  # typical expanded uncertainty of one: root of the mean of squares

    @property
    def mean(self) -> float:
        return float(np.mean(self.values))

    @property
    def sd(self) -> float:
        """From sensor to sensor."""
        return float(np.std(self.values, ddof=1))


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchRun:
    """A run that is over."""

    page: Path
    store: Path
    sections: Mapping[Place, Section]
    spreads: tuple[Spread, ...]

    @property
    def within(self) -> bool:
        return within_limits(list(self.sections.values()))


def run_batch(options: RunOptions, progress: Progress) -> BatchRun:
    """Measure all sensors; writes a passport of each and the report. Raises BadInput, BenchError."""
    options.refuse_one_bench("--batch")
    refuse_beside("--batch", {"--node": None if options.node == DBC_NODE else options.node}, "run")
    params = made_params(TurnsParams, "turns", options.params or {})
    if params.axis != "x":
        raise BadInput(expected("all channels, no --axis", params.axis, "turns --batch"))
    if params.search_deg:
        raise BadInput(expected("no --search-deg", f"{params.search_deg:g}", "turns --batch"))
    if options.average == 0:
        raise BadInput(expected("an --average of 1 or more: samples of all channels", 0, "turns --batch"))
    options = replace(options, scenario=options.scenario or Path(BATCH.scenario))
    options.out.mkdir(parents=True, exist_ok=True)
    with open_bench(BATCH, options, every_unit=True) as bench:
        serials, sections = _measure_all(bench, params, options, progress)
    facts = facts_of(options)
    store = _write_passports(options.out, sections, serials, facts)
    spreads = tuple(spreads_of(list(sections.values())))
    run = BatchRun(page=options.out / "report.html", store=store, sections=sections, spreads=spreads)
    write_report(options.out, result_dict(run, serials, facts), html_page(run, facts))
    return run


def _measure_all(
    bench: Bench, params: TurnsParams, options: RunOptions, progress: Progress
) -> tuple[dict[Place, str], dict[Place, Section]]:
    """Serial number and section of each sensor."""
    units = {name: unit for name, unit in bench.units.items() if isinstance(unit, Psa2)}
    if not units:
        raise BadInput(expected("units with a PSA-2", "none", "turns --batch"))
    average, g_mps2 = options.average_for(BATCH), options.gravity_for(BATCH)
    on_head = BatchBench(units, bench.head, average=average, g_mps2=g_mps2)
    first = turns(on_head, params, Watch(progress=progress)).readings
    accuracy, truth = accuracy_of({}, options), bench.truth()["units"] if bench.truth_path else {}
    serials, sections = {}, {}
    for place in on_head.places:
        serials[place] = f"{units[place.unit].serial()}-{place.channel}"
        readings = on_head.readings_of(place, first)
        with CsvRecorder(options.out / f"turns-{place}.csv") as recorder:
            for r in readings:
                recorder(r)
        of_unit = truth.get(place.unit)
        known = axis_truth(of_unit, place.channel) if of_unit else None
        sections[place] = section_of(place, readings, params, accuracy, g_mps2, known)
    return serials, sections


def section_of(
    place: Place,
    readings: Sequence[Reading],
    params: TurnsParams,
    accuracy: BenchAccuracy,
    g_mps2: float,
    truth: Mapping[str, float] | None,
) -> Section:
    """The estimates of one sensor with their budget. Pure."""
    pairs, own = pairs_of_channel(place.channel), replace(params, axis=place.channel)
    fit = partial(fit_turns, pairs=pairs)
    result = replace(fit(readings, own, g_mps2), doubts=wander_doubts(readings, drift=False))
    procedure = replace(PROCEDURES["turns"], fit=fit)
    result = expand_result(result, procedure, own, accuracy, CODE_V)
    return Section(label=str(place), result=result, truth=truth, expected=partial(expected_of_pairs, pairs))


def spreads_of(sections: Sequence[Section]) -> list[Spread]:
    """Of every parameter that is identifiable in each sensor."""
    found = [{e.name: e for e in s.result.estimates if e.identifiable} for s in sections]
    names = [n for n in found[0] if all(n in each for each in found) and not n.startswith("closure")]
    return [
        Spread(
            name=n,
            unit=found[0][n].unit,
            values=tuple(each[n].value for each in found),
            u=float(np.sqrt(np.mean([each[n].ci_half ** 2 for each in found]))),
        )
        for n in names
    ]


def _write_passports(
    out: Path, sections: Mapping[Place, Section], serials: Mapping[Place, str], facts: Mapping[str, str]
) -> Path:
    """A folder with report and result of each sensor, and their passports in one store. Returns the store."""
    path = out / STORE
    with PassportStore(path) as store:
        for place, found in sections.items():
            folder = out / str(place)
            calibration.write(folder, [found], {**facts, "serial": serials[place]})
            for run in runs_of_result(folder):
                store.put_run(serials[place], TYPE, run)
    return path


# ---- as data and as text


def result_dict(r: BatchRun, serials: Mapping[Place, str], facts: Mapping[str, str]) -> dict[str, Any]:
    """result.json of the batch; each sensor has its own in its folder."""
    return {
        "format": calibration.FORMAT,
        "procedure": "turns --batch",
        "facts": dict(facts),
        "within_limits": r.within,
        "sensors": [
            {"place": str(p), "serial": serials[p], "within_limits": within_limits([s])} for p, s in r.sections.items()
        ],
        "spread": [
            {"name": s.name, "unit": s.unit, "values": list(s.values), "mean": s.mean, "sd": s.sd, "expanded_u": s.u}
            for s in r.spreads
        ],
    }


def sensor_table(r: BatchRun) -> list[tuple[str, ...]]:
    """Each sensor's parameters."""
    rows: list[tuple[str, ...]] = [
        ("sensor", *(s.name for s in r.spreads), "beyond U"),
        ("", *(s.unit for s in r.spreads), ""),
    ]
    for k, (place, found) in enumerate(r.sections.items()):
        values = (with_ci(s.values[k], s.u)[0] for s in r.spreads)
        beyond = sum(abs(g.en or 0.0) > 1.0 for g in grade(found) if g.within is not None)
        rows.append((str(place), *values, str(beyond)))
    return rows


def spread_table(r: BatchRun) -> list[tuple[str, ...]]:
    """The article's large spread: what sensors differ by, beside what one is known to."""
    rows: list[tuple[str, ...]] = [("", "unit", "mean", "sd", "least", "greatest", "U of one", "sd over U")]
    for s in r.spreads:
        figures = (with_ci(x, s.u)[0] for x in (s.mean, s.sd, min(s.values), max(s.values)))
        rows.append((s.name, s.unit, *figures, f"{s.u:.2g}", f"{s.sd / s.u:.3g}"))
    return rows


def console_table(r: BatchRun) -> str:
    """What the terminal shows."""
    sensors = "\n  ".join([f"{len(r.sections)} sensors in one pass", *aligned(sensor_table(r))])
    return sensors + "\n\n" + "\n  ".join(["from sensor to sensor", *aligned(spread_table(r), left=(0, 1))])


def html_page(r: BatchRun, facts: Mapping[str, str]) -> str:
    """The page of the batch: tables alone; pictures are in the sensors' own."""
    sections = list(r.sections.values())
    body = [
        verdict_line(verdict(sections), r.within),
        section("From sensor to sensor", table(spread_table(r), 1)),
        section("Each sensor", table(sensor_table(r), 2)),
    ]
    return whole_page(TITLE, facts, body)

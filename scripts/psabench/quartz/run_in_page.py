"""report.html and result.json of a run-in, and what the console shows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from psabench.campaign.claims import Check
from psabench.quartz import limits
from psabench.quartz import run_in_plots as plots
from psabench.quartz.batch import UNITS
from psabench.quartz.run_in import RunIn
from psabench.quartz.run_in_figures import (
    SMALL,
    STOP_AT,
    STOP_PERCENT,
    Figures,
    Grade,
    Number,
)
from psabench.report.grading import aligned
from psabench.report.page import bullets, figure, section, verdict_line, whole_page, write_report
from psabench.report.page import table as html_table

if TYPE_CHECKING:
    from psabench.quartz.run_in_wire import Agreement

TITLE = "Quartz accelerometers: run-in of a production batch"
FORMAT = 1  # of result.json
SHOWN_UNITS = {"ug": "µg", "ppm": "ppm", "arcsec": "arcsec"}
NOTES = (
    "The gains 2.2, 1.65 and 3.2 are what the batch was made for: its sizes were tuned to the article's “more than 2, "
    "1.6, more than 3”. They prove nothing about accelerometers. What is measured is that the workstation finds them.",
    "All figures come from readings, each with its noise. Truth is used in the grading alone.",
    "Scatter from start to start is no part of the stress: no cycle reduces it.",
    "The article has no size of its batch's instability, no tolerance and no baseline of its gains. Here the gain is "
    "the mean change at the first cycle over that at the fifth, after four cycles.",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """All that a report shows."""

    what: RunIn
    batch_name: str
    units: int
    figures: Mapping[str, Figures]
    grades: Sequence[Grade]
    graded_units: int
    wire_units: int
    agreements: Sequence[Agreement]
    checks: Sequence[Check]
    code: str

    @property
    def within(self) -> bool:
        return all(c.within for c in self.checks)


def verdict_words(r: Report) -> str:
    """One line."""
    return limits.verdict_words(r.checks, "another schedule, another batch, or less than 1000 units")


# ---- tables, for the console and the page


def mean_table(r: Report) -> list[list[str]]:
    """Mean change from start to start by cycle with its 95 % interval, then how many are within the tolerance."""
    cycles = r.what.schedule.cycles
    rows = []
    for q, f in r.figures.items():
        rows.append([f"{q}, {SHOWN_UNITS[UNITS[q]]}", *(_with_half(m, 2) for m in f.means)])
    for q, f in r.figures.items():
        limit = r.what.batch[f"{q}_tolerance_{UNITS[q]}"]
        rows.append([f"{q}, % within {limit:g}", *(f"{100 * x:.1f}" for x in (f.change <= limit).mean(axis=0))])
    return [["change at cycle", *(str(n) for n in range(1, cycles + 1))], *rows]


def gain_table(r: Report) -> list[list[str]]:
    """Gains by run-in: found, by the batch's law, in the article."""
    rows = []
    for q, f in r.figures.items():
        middle, by = limits.LAW_GAINS[q]
        tuned = f"{middle:g} ± {by:g}"
        rows.append([q, _with_half(f.gain, 2), f"{f.law_gain:.2f}", tuned, limits.ARTICLE[q][0]])
    return [["gain", "found, 95 %", "the law", "limits", "the article"], *rows]


def stop_table(r: Report) -> list[list[str]]:
    """By how much one more cycle lowers the mean change, percent of the first change."""
    rows = []
    for q, f in r.figures.items():
        rows.append([q, *(_with_half(w, 1) for w in f.worth), "–" if f.stop is None else str(f.stop)])
    cycles = r.what.schedule.cycles
    head = ["worth of one more, %", *(f"after {n}" for n in range(1, cycles)), f"< {STOP_PERCENT:g} % after"]
    return [head, *rows]


def small_table(r: Report) -> list[list[str]]:
    """Gains that honest batches of SMALL units show."""
    rows = []
    for q, f in r.figures.items():
        s = f.small
        shown = [f"{x:.2f}" for x in (s.low, s.median, s.high)]
        rows.append([q, *shown, f"> {limits.ARTICLE[q][1]:g}", f"{100 * s.share:.0f}"])
    return [[f"batches of {SMALL}", "5 %", "median", "95 %", "the article", "share that shows it, %"], *rows]


def grade_table(r: Report) -> list[list[str]]:
    """Estimates against truth."""
    rows = []
    for g in r.grades:
        unit = SHOWN_UNITS[UNITS[g.quantity]]
        rows.append([g.quantity, f"{g.u:.3f} {unit}", str(g.count), f"{g.z_rms:.3f}", f"{100 * g.covered:.1f}"])
    return [["against truth", "u of a start", "starts", "error/u, rms", "in 95 %: share, %"], *rows]


def wire_table(r: Report) -> list[list[str]]:
    """Changes from start to start through the wire less those of the model."""
    rows = []
    for a in r.agreements:
        unit = SHOWN_UNITS[UNITS[a.quantity]]
        numbers = (f"{a.rms:.2f} {unit}", f"{a.u:.2f} {unit}", f"{a.z_rms:.2f}", f"{100 * a.within_2u:.0f}")
        rows.append([a.quantity, str(a.count), *numbers])
    return [["wire less model", "changes", "rms", "u of it", "rms over u", "within 2 u, %"], *rows]


def _with_half(n: Number, digits: int) -> str:
    return f"{n.value:.{digits}f} ± {n.half95:.{digits}f}"


def console_lines(r: Report) -> Iterator[str]:
    """Lines of all tables."""
    tables = [mean_table(r), gain_table(r), stop_table(r), small_table(r), grade_table(r)]
    for rows in (*tables, *([wire_table(r)] if r.agreements else [])):
        yield from aligned(rows)
        yield ""
    yield from limits.outside_lines(r.checks)


# ---- files


def write_page(folder: Path, r: Report) -> Path:
    """result.json and report.html into `folder`, each whole or not at all; returns the page. Raises as write_report."""
    return write_report(folder, result_dict(r), html_page(r))


def origin_dict(r: RunIn, units: int) -> dict[str, Any]:
    """All that the numbers depend on beside the seed, for the provenance."""
    return {"schedule": asdict(r.schedule), "batch": dict(r.batch), "units": units}


def result_dict(r: Report) -> dict[str, Any]:
    """For result.json."""
    return {
        "format": FORMAT,
        "facts": _facts_dict(r),
        "within_limits": r.within,
        "schedule": asdict(r.what.schedule),
        "batch": {"name": r.batch_name, **r.what.batch},
        "checks": [asdict(c) | {"within": c.within} for c in r.checks],
        "wire": {"units": r.wire_units, "agreements": [asdict(a) for a in r.agreements]},
        "grades": [asdict(g) for g in r.grades],
        "quantities": {q: _quantity_dict(f) for q, f in r.figures.items()},
    }


def _quantity_dict(f: Figures) -> dict[str, Any]:
    quantiles = np.quantile(f.change, (0.05, 0.25, 0.5, 0.75, 0.95), axis=0).T
    return {
        "means": [asdict(m) for m in f.means],
        "quantiles_5_25_50_75_95": quantiles.tolist(),
        "gain": asdict(f.gain),
        "law_gain": f.law_gain,
        "worth_percent": [asdict(w) for w in f.worth],
        "stop_after": f.stop,
        f"batches_of_{SMALL}": asdict(f.small),
    }


def _facts_dict(r: Report) -> dict[str, str]:
    s = r.what.schedule
    course = f"{s.cold_degc:g} to +{s.hot_degc:g} °C at {s.ramp_k_per_min:g} K/min, {s.cycles} cycles"
    return {"units": f"{r.units} of {r.batch_name}", "course": course, "seed": str(r.what.seed), "code": r.code}


def html_page(r: Report) -> str:
    """The whole page. Same input, same bytes."""
    drawn = plots.draw_all(r.figures, r.what.batch["zero_tolerance_ug"])
    fig_8 = "As fig. 8: change of the zero signal after cycles 2, 3, 4; grey: the first; dashed: the tolerance (E0)."
    small = f"Gains of batches of {SMALL}, drawn from these units; dashed: what the article reports."
    body = [
        verdict_line(verdict_words(r), r.within if r.checks else None),
        section("Gain by run-in", html_table(gain_table(r)), bullets(NOTES)),
        section("Instability after each cycle", html_table(mean_table(r)), figure(drawn["distributions"], fig_8)),
        section("When to stop", html_table(stop_table(r)), figure(drawn["means"]), f"<p>{_stop_words(r)}</p>"),
        section(f"What a batch of {SMALL} shows", html_table(small_table(r)), figure(drawn["small"], small)),
        section(f"Estimates against truth, the first {r.graded_units} units", html_table(grade_table(r))),
        _wire_section(r),
        limits.limits_section(r.checks),
    ]
    return whole_page(TITLE, _facts_dict(r), body)


def _stop_words(r: Report) -> str:
    zero = r.figures["zero"].worth
    if len(zero) < STOP_AT:
        return ""
    worth = _with_half(zero[STOP_AT - 1], 1)
    return f"After the fourth cycle one more lowers the instability of the zero signal by {worth} % of its first value."


def _wire_section(r: Report) -> str:
    if not r.agreements:
        return ""
    words = "The same serial numbers on the bench: chamber, head and supply over SCPI, PSA-2 over CAN."
    return section(f"{r.wire_units} units through the wire", f"<p>{words}</p>", html_table(wire_table(r)))

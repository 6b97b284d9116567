"""report.html and result.json of a fleet, and what the console shows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psabench.campaign import builds
from psabench.campaign.store import Store
from psabench.koi.fleet import plots
from psabench.koi.fleet.claims import Claim, list_claims
from psabench.koi.fleet.conditions import CONDITIONS, USUAL
from psabench.koi.fleet.figures import (
    FilterFigures,
    Harm,
    ModeFigures,
    Rows,
    count_reasons,
    filter_figures,
    harm_figures,
    largest_errors,
    left_by_flight,
    mode_figures,
    rms_curves,
)
from psabench.koi.fleet.linear import Predicted
from psabench.koi.fleet.season import MODES
from psabench.koi.fleet.work import HARM_MODES, Fleet, load_rows, own_digest
from psabench.link.signals import Floats
from psabench.report.grading import aligned
from psabench.report.page import bullets, figure, section, table, whole_page, write_report

TITLE = "A fleet of units with a satellite receiver"
FORMAT = 1  # of result.json
LEFT = {
    "left_nu12_degph": ("drifts 1, 2, deg/h", 4),
    "left_nu3_degph": ("drift 3, deg/h", 4),
    "left_df12_mps2": ("biases 1, 2, m/s2", 6),
    "left_df3_mps2": ("bias 3, m/s2", 6),
}
NOTES = (
    "An error is that of the autonomous solution in the hour from take-off; a flight has a largest one of latitude and "
    "one of longitude. Rms and 95 % are over both. All modes fly the same errors and the same noise.",
    "Rms, factors, shares: flights from the fourth on, when a passport knows something. Intervals: 95 %, a bootstrap "
    "over units. A share has no interval where all units agree.",
    "Sizes of errors are assumptions, made so that units without any procedure err by a mile or more in an hour. The "
    "article has no table of maxima: its figures show one unit and one series of flights; “about twice” is its text.",
    "A mile is read as the nautical mile, 1852 m.",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """All that a report shows."""

    fleet: Fleet
    rows: Mapping[str, Rows]  # by class, then mode; the usual condition
    modes: Mapping[tuple[str, str], ModeFigures]
    filters: Mapping[str, FilterFigures]  # by class, of the mode `both`
    harms: Sequence[tuple[str, Harm]]
    reasons: Mapping[str, Sequence[tuple[str, float]]]  # by class and condition
    predicted: Predicted
    claims: Sequence[Claim]


def gather_report(fleet: Fleet, store: Store, predicted: Predicted) -> Report:
    """From a store that has it all."""

    def load(unit_class: str, condition: str, mode: str) -> Floats:
        return load_rows(fleet.season(unit_class, condition, mode), store, fleet.units)

    usual = USUAL in fleet.conditions
    rows = {n: {m: load(n, USUAL, m) for m in MODES} for n in fleet.classes} if usual else {}
    modes = {(n, m): mode_figures(r, m, fleet.seed) for n, r in rows.items() for m in MODES}
    harms, reasons = list[tuple[str, Harm]](), dict[str, Sequence[tuple[str, float]]]()
    for name in fleet.classes:
        for condition in fleet.conditions:
            none, both = (load(name, condition, mode) for mode in HARM_MODES)
            reasons[f"{name}, {condition}"] = tuple(count_reasons(both))
            harms.append((name, harm_figures(condition, both, none)))
    asked = [(name, h) for name, h in harms if h.condition != USUAL]
    return Report(
        fleet=fleet,
        rows=rows,
        modes=modes,
        filters={n: filter_figures(r, fleet.seed) for n, r in rows.items()},
        harms=harms,
        reasons=reasons,
        predicted=predicted,
        claims=tuple(list_claims(modes, asked)),
    )


# ---- tables


def mode_table(r: Report) -> list[list[str]]:
    """By class and mode."""
    head = ["", "rms, m", "95 %, m", "largest, m", "factor", "within a mile", "corrected", "weight"]
    body = [
        [
            f"{name}, {MODES[mode].title}",
            f.rms_m.text(0),
            f"{f.p95_m:.0f}",
            f"{f.worst_m:.0f}",
            f.factor.text() if mode != "none" else "",
            f.within_mile.text(),
            f"{f.corrected:.2f}",
            f"{f.weight:.2f}",
        ]
        for (name, mode), f in r.modes.items()
    ]
    return [head, *body]


def claim_table(r: Report) -> list[list[str]]:
    """What was asked for."""
    return [
        ["", "asked for", "found", "met"],
        *([c.what, c.asked, c.found, "yes" if c.met else "NO"] for c in r.claims),
    ]


def filter_table(r: Report) -> list[list[str]]:
    """The filter's own account, and its error by its covariance."""
    names = list(r.filters)
    lines = (
        ("heading after the alignment, sd, '", [f"{f.heading_aligned_arcmin:.1f}" for f in r.filters.values()]),
        ("heading at take-off, sd, '", [f"{f.heading_arcmin:.2f}" for f in r.filters.values()]),
        ("heading after take-off, rms error, '", [f"{f.heading_error_arcmin:.2f}" for f in r.filters.values()]),
        ("levels after the alignment, sd, '", [f"{f.level_aligned_arcmin:.2f}" for f in r.filters.values()]),
        ("levels at take-off, sd, '", [f"{f.level_arcmin:.2f}" for f in r.filters.values()]),
        ("squared error by covariance, a state", [f.nees.text() for f in r.filters.values()]),
        ("the same, no place and delays", [f.nees_within.text() for f in r.filters.values()]),
        ("estimates of what is corrected, at take-off, rms by prior", [f"{f.before:.2f}" for f in r.filters.values()]),
        ("the same at the end of the flight", [f"{f.after:.2f}" for f in r.filters.values()]),
    )
    return [["", *names], *([what, *values] for what, values in lines)]


def learned_table(r: Report) -> list[list[str]]:
    """What the passport does not know yet, rms over units, after each flight."""
    head = ["not known after flight", *(str(k + 1) for k in range(r.fleet.flights))]
    body = []
    for name, rows in r.rows.items():
        for key, values in left_by_flight(rows["both"]).items():
            what, digits = LEFT[key]
            body.append([f"{name}, {what}", *(f"{x:.{digits}f}" for x in values)])
    return [head, *body]


def harm_table(r: Report) -> list[list[str]]:
    """Both procedures under each condition."""
    head = [
        "",
        "receiver",
        "rms, m",
        "95 %, m",
        "neither: rms",
        "95 %",
        "rms ratio",
        "95 % ratio",
        "corrected",
        "weight",
    ]
    body = []
    for name, h in r.harms:
        numbers = (h.rms_m, h.p95_m, h.none_rms_m, h.none_p95_m)
        ratios = (*h.ratios, h.corrected, h.weight)
        title = CONDITIONS[h.condition].title
        body.append([f"{name}, {h.condition}", title, *(f"{x:.0f}" for x in numbers), *(f"{x:.2f}" for x in ratios)])
    return [head, *body]


def reason_table(r: Report) -> list[list[str]]:
    """Why units did not correct themselves, shares of flights."""
    rows = [[where, name, f"{share:.2f}"] for where, found in r.reasons.items() for name, share in found]
    return [["", "why not corrected", "share of flights"], *rows]


def linear_table(r: Report) -> list[list[str]]:
    """The largest rms of the hour, last flight: drawn units beside the covariance."""
    rows = []
    for (name, mode), curve in r.predicted.items():
        drawn, alone = (float(plots.largest_rms(x)[-1]) for x in (rms_curves(r.rows[name][mode]), curve))
        whole = float(np.sqrt(np.mean(largest_errors(r.rows[name][mode])[:, -1] ** 2)))
        rows.append([f"{name}, {mode}", f"{alone:.0f}", f"{drawn:.0f}", f"{whole:.0f}", f"{drawn / alone:.2f}"])
    return [["last flight", "covariance, m", "drawn, m", "rms of the largest, m", "drawn / covariance"], *rows]


def list_tables(r: Report) -> Iterator[tuple[str, list[list[str]]]]:
    """All, with their headings."""
    yield "What was asked for", claim_table(r)
    if r.rows:
        yield "Four modes", mode_table(r)
        yield "The filter, both", filter_table(r)
        yield "What flights teach, both", learned_table(r)
    yield "What a receiver can do", harm_table(r)
    yield "Reasons not to correct", reason_table(r)
    if r.predicted and r.rows:
        yield "From the covariance alone", linear_table(r)


def console_lines(r: Report) -> Iterator[str]:
    """Lines of all tables."""
    for heading, rows in list_tables(r):
        yield heading
        yield from aligned(rows)
        yield ""


# ---- files


def draw_pictures(r: Report) -> Iterator[tuple[str, str, str]]:
    """Name, picture, caption."""
    for name, rows in r.rows.items():
        first = (
            f"As fig. 1, class {name}: left of the dotted line nothing is done; right of it the same flights once "
            "more, from nothing known, with both procedures. Dashed: a mile."
        )
        yield f"first_{name}", plots.draw_first(rows, name), first
        series = f"As figs 2 to 5, class {name}: all flights of three units. Dashed: a mile in an hour."
        yield f"curves_{name}", plots.draw_curves(rows, name), series
    if r.rows:
        yield "distributions", plots.draw_distributions(r.rows), "All flights. Dashed: a mile."
        dashed = "Dots: drawn units; dashed: from the filter's covariance." if r.predicted else ""
        yield "by_flight", plots.draw_linear(r.rows, r.predicted), dashed


def write_page(folder: Path, r: Report) -> Path:
    """result.json and report.html into `folder`, each whole or not at all; returns the page."""
    return write_report(folder, result_dict(r), html_page(r))


def html_page(r: Report) -> str:
    """The whole page. Same input, same bytes."""
    tables = [section(heading, table(rows)) for heading, rows in list_tables(r)]
    pictures = [section("Pictures", *(figure(picture, caption) for _, picture, caption in draw_pictures(r)))]
    facts = {
        "units": str(r.fleet.units),
        "flights of each": str(r.fleet.flights),
        "seed": str(r.fleet.seed),
        "build": builds.short(own_digest()),
    }
    body = [*tables[:2], *(pictures if r.rows else []), *tables[2:], section("How to read it", bullets(NOTES))]
    return whole_page(TITLE, facts, body)


def result_dict(r: Report) -> dict[str, Any]:
    """For result.json: the same bytes for the same seed."""
    return {
        "format": FORMAT,
        "fleet": asdict(r.fleet),
        "claims": [asdict(c) for c in r.claims],
        "modes": {f"{n}, {m}": asdict(f) for (n, m), f in r.modes.items()},
        "filters": {n: asdict(f) for n, f in r.filters.items()},
        "harm": [{"class": n, **asdict(h), "ratios": h.ratios} for n, h in r.harms],
        "reasons": {where: dict(found) for where, found in r.reasons.items()},
        "left": {n: {k: v.tolist() for k, v in left_by_flight(x["both"]).items()} for n, x in r.rows.items()},
        "maxima_m": {f"{n}, {m}": largest_errors(x).tolist() for n, rows in r.rows.items() for m, x in rows.items()},
        "linear_m": {f"{n}, {m}": x.tolist() for (n, m), x in r.predicted.items()},
    }

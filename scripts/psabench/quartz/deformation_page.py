"""report.html and result.json of the deformation study, and what the console shows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from html import escape
from pathlib import Path
from typing import Any

from psabench.quartz import deformation as study
from psabench.quartz import deformation_claims as claims
from psabench.quartz import deformation_plots as plots
from psabench.quartz import limits
from psabench.quartz.deformation import DEGC, READINGS, Spread, Study
from psabench.quartz.element import Figure
from psabench.report.grading import aligned
from psabench.report.page import bullets, figure, section, verdict_line, whole_page, write_report
from psabench.report.page import table as html_table

TITLE = "Quartz accelerometer: deformation of the sensing element"
FORMAT = 1  # of result.json
READING_WORDS = {
    "held": "held by the loop, against itself at 30 °C",
    "held, tolerances": "held by the loop, against the design",
    "free": "on the hinges alone, against itself at 30 °C",
    "free, tolerances": "on the hinges alone, against the design",
}
NOTES = (
    "The bodies of (7), (9) and (12) are lost in the copy that we have, the terms of (6) and (11) are in disorder: all "
    "are derived here from a beam with one end clamped and the force beyond its other end.",
    "The article has no size, tolerance, force or coefficient of E(T). Those of the table are ours.",
    "The equations have no electrical spring. On its hinges alone an element of these sizes would lie on the case "
    "under 1 g. In the instrument the loop holds it; the torquer's force is taken to act at the centre of mass (E0).",
    "The zero signal of geometry is the torque of hinges that are bent in balance, by a pendulum sealed off its null.",
    "Fig. 2 and fig. 5 have no numbers that we can read: their curves and bars are drawn from the law of the batch.",
)


def verdict_words(s: Study) -> str:
    """One line."""
    return limits.verdict_words(
        claims.limit_checks(s), "other figures, another batch, or less than 1000 elements or units"
    )


def is_within(s: Study) -> bool:
    """Whether all limits are kept."""
    return all(c.within for c in claims.limit_checks(s))


# ---- tables, for the console and the page


def gap_table(s: Study) -> list[list[str]]:
    """A row a reading: change of the gap in percent."""
    rows = []
    for r in READINGS:
        v = s.deformation.gap_percent[r]
        x = Spread.of(v)
        kept = 100.0 * float((v <= study.CLAIM_PERCENT).mean())
        rows.append([READING_WORDS[r], f"{x.median:.4g}", f"{x.p99:.4g}", f"{x.largest:.4g}", f"{kept:.1f}"])
    return [["change of the gap, %", "median", "p99", "largest", "≤ 0.5 %: share, %"], *rows]


def zero_table(s: Study) -> list[list[str]]:
    """Zero signal over temperature, by the hinges and of the batch."""
    hinge, unit = study.swing_ug(s.deformation.zero_ug), study.swing_ug(s.curve_ug)
    ratio = {"hinges": study.hinge_ratio(s.deformation), "batch": s.curves.ratio()}
    turns = {"hinges": s.deformation.turns, "batch": study.grouped_turns(s)}
    rows = []
    for name, swing, words in (("hinges", hinge, "by the hinges"), ("batch", unit, "of a unit (fig. 2)")):
        x = Spread.of(swing)
        r, t = ratio[name], turns[name]
        many = f"{t.min():.0f}" if t.min() == t.max() else f"{t.min():.0f} to {t.max():.0f}"
        rows.append(
            [words, f"{swing.min():.3g}", f"{x.median:.3g}", f"{x.largest:.4g}", _range_words(r.min(), r.max()), many]
        )
    head = ["zero signal, -60 to +85 °C", "swing, µg: least", "median", "largest", "largest over 30 °C", "turns"]
    return [head, *rows]


def _range_words(low: float, high: float) -> str:
    return f"{low:.3f} to {high:.3f}" if high < 2.0 else f"{low:.1f} to {high:.1f}"


def yield_table(s: Study) -> list[list[str]]:
    """Fig. 5 in numbers."""
    rows = []
    for y in study.batch_yields(s):
        means = ["", "", ""] if math.isnan(y.tolerance) else [f"{y.tolerance:g}", f"{y.before:.3g}", f"{y.after:.3g}"]
        gain = "" if y.quantity == "all" else f"{claims.run_in_gain(s, y.quantity):.2f}"
        name = f"{y.quantity}{y.unit and ', '}{'µg' if y.unit == 'ug' else y.unit}"
        said = limits.ARTICLE.get(y.quantity, ("",))[0]
        rows.append([name, *means, gain, said, *(f"{100 * (1 - x):.1f}" for x in (y.out_before, y.out_after))])
    head = [
        "start to start",
        "tolerance",
        "mean before",
        "after",
        "less by",
        "the article",
        "yield before, %",
        "after, %",
    ]
    return [head, *rows]


def figure_table(s: Study) -> list[list[str]]:
    """The element's figures with source and grade."""
    rows = [[f.about, f"{f.value:g}", f"{f.tolerance:g}", f.unit, f.source, f.grade] for f in s.figures.values()]
    return [["figure", "value", "tolerance ±", "unit", "source", "grade"], *rows]


def verdict_table(s: Study) -> list[list[str]]:
    """The article's statements."""
    return [["the article", "found", "verdict"], *([v.says, v.found, v.verdict] for v in claims.judge_article(s))]


def console_lines(s: Study) -> Iterator[str]:
    """Lines of the tables, then the verdicts."""
    for rows in (gap_table(s), zero_table(s), yield_table(s)):
        yield from aligned(rows)
        yield ""
    for v in claims.judge_article(s):
        yield f"{v.says}: {v.verdict}"
        yield f"  {v.found}"
    yield from limits.outside_lines(claims.limit_checks(s))


# ---- files


def write_page(folder: Path, s: Study) -> Path:
    """result.json and report.html into `folder`, each whole or not at all; returns the page. Raises as write_report."""
    return write_report(folder, result_dict(s), html_page(s))


def result_dict(s: Study) -> dict[str, Any]:
    """For result.json."""
    d = s.deformation
    return {
        "format": FORMAT,
        "facts": _facts_dict(s),
        "within_limits": is_within(s),
        "figures": [_figure_dict(f) for f in s.figures.values()],
        "batch": {"name": s.batch_name, **s.batch},
        "verdicts": [asdict(v) for v in claims.judge_article(s)],
        "checks": [_finite_dict(asdict(c)) | {"within": c.within} for c in claims.limit_checks(s)],
        "gap_percent": {r: asdict(Spread.of(v)) for r, v in d.gap_percent.items()},
        "hinge_swing_ug": asdict(Spread.of(study.swing_ug(d.zero_ug))),
        "unit_swing_ug": asdict(Spread.of(study.swing_ug(s.curve_ug))),
        "one_gap": {"turn_urad": s.one_gap_urad, "zero_ug": s.one_gap_ug},
        "stiff_hinges_um": s.stiff_um,
        "yields": [_finite_dict(asdict(y)) for y in study.batch_yields(s)],
        "instability": {q: v.mean(axis=0).tolist() for q, v in s.instability.items()},
        "temperatures_degc": DEGC.tolist(),
    }


def _figure_dict(f: Figure) -> dict[str, Any]:
    return {n: v for n, v in asdict(f).items() if n not in ("low", "high")}


def _finite_dict(value: Mapping[str, Any]) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in value.items()}


def origin_dict(s: Study) -> dict[str, Any]:
    """All that the numbers depend on beside the seed, for the provenance."""
    figures = {n: [f.value, f.tolerance] for n, f in s.figures.items()}
    return {"figures": figures, "batch": dict(s.batch), "elements": s.elements, "units": s.units}


def _facts_dict(s: Study) -> dict[str, str]:
    return {"elements": str(s.elements), "units": f"{s.units} of {s.batch_name}", "seed": str(s.seed)}


def html_page(s: Study) -> str:
    """The whole page. Same input, same bytes."""
    drawn = plots.draw_all(s)
    fig_2 = "Groups (a) and (b) of the batch, as fig. 2, and what the hinges can do, from 30 °C on."
    fig_5 = "As fig. 5: change of the zero signal from start to start, unit by unit."
    body = [
        verdict_line(verdict_words(s), is_within(s) if claims.limit_checks(s) else None),
        section("The article's statements", html_table(verdict_table(s), numeric=False)),
        section("Gap of the pickoff under 1 g", html_table(gap_table(s)), figure(drawn["gaps"])),
        section("Zero signal against temperature", html_table(zero_table(s)), figure(drawn["zero"], fig_2)),
        section("A serial batch", html_table(yield_table(s)), figure(drawn["batch"], fig_5)),
        section("Figures of the element", html_table(figure_table(s), numeric=False)),
        section("What is derived, and what is ours", bullets([escape(n) for n in NOTES])),
        limits.limits_section(claims.limit_checks(s)),
    ]
    return whole_page(TITLE, _facts_dict(s), body)

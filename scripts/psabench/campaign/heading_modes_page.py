"""What the campaign `heading-modes` shows: errors of each mode with intervals, beside the article's 0.3 deg in 4 h."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psabench.campaign.heading_modes import ROWS
from psabench.procedures.heading_modes import ModeParams
from psabench.procedures.platform_bench import Floats
from psabench.report import plots
from psabench.report.grading import aligned
from psabench.report.page import bullets, figure, section, table, whole_page, write_report

NAME = "heading-modes"
FORMAT = 1  # of result.json
CLAIM_DEG, ABSTRACT_DEG = 0.3, 0.5
RESAMPLES, LEVEL, Z = 1000, (2.5, 97.5), 1.96  # of the intervals, 95 %
NOTES = (
    "In brackets: 95 % intervals over the runs, by resampling; of shares Wilson's.",
    "One flight along a meridian. The same instruments fly in every mode.",
    "magnetic and half-compass are the prototype: what the workshop left of the drift, deviation and the chart's error "
    "have no figure in the article and are ours (E0).",
    "claim is the reading in which the article's 0.1 deg and 0.05 deg/h hold; literal has its errors as printed.",
    "No turns, no wind: levelling has no cut-off, in the article as here.",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A number with its interval."""

    value: float
    low: float
    high: float

    def text(self, digits: int = 2, scale: float = 1.0) -> str:
        low, high = scale * self.low, scale * self.high
        return f"{scale * self.value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """Of a row's runs."""

    start_rms_deg: Figure
    end_rms_deg: Figure
    end_p95_deg: Figure
    within: Figure  # share of runs that stay within CLAIM_DEG all the way
    within_abstract: Figure


def share_figure(good: int, n: int) -> Figure:
    """Wilson's interval."""
    p, z2 = good / n, Z * Z
    centre, half = p + z2 / (2 * n), Z * math.sqrt(p * (1 - p) / n + z2 / (4 * n * n))
    low, high = (centre - half) / (1 + z2 / n), (centre + half) / (1 + z2 / n)
    return Figure(value=p, low=max(0.0, low), high=min(1.0, high))


def summary_of(error_deg: Floats, seed: int) -> Summary:
    """error_deg: (runs, looks)."""
    n = len(error_deg)
    pick = np.random.default_rng([seed, n]).integers(n, size=(RESAMPLES, n))
    start, end, largest = np.abs(error_deg[:, 0]), np.abs(error_deg[:, -1]), np.abs(error_deg).max(axis=1)

    def rms(x: Floats) -> Figure:
        low, high = np.percentile(np.sqrt((x[pick] ** 2).mean(axis=1)), LEVEL)
        return Figure(value=float(np.sqrt((x**2).mean())), low=float(low), high=float(high))

    low, high = np.percentile(np.percentile(end[pick], 95.0, axis=1), LEVEL)
    return Summary(
        start_rms_deg=rms(start),
        end_rms_deg=rms(end),
        end_p95_deg=Figure(value=float(np.percentile(end, 95.0)), low=float(low), high=float(high)),
        within=share_figure(int((largest <= CLAIM_DEG).sum()), n),
        within_abstract=share_figure(int((largest <= ABSTRACT_DEG).sum()), n),
    )


def table_rows(found: Mapping[str, Summary]) -> list[list[str]]:
    heading = ["", "at start, rms, deg", "at the end, rms, deg", "p95, deg", "stay within 0.3°, %", "0.5°, %"]
    return [
        heading,
        *(
            [
                name,
                s.start_rms_deg.text(3),
                s.end_rms_deg.text(),
                s.end_p95_deg.text(),
                s.within.text(0, 100.0),
                s.within_abstract.text(0, 100.0),
            ]
            for name, s in found.items()
        ),
    ]


def console_lines(found: Mapping[str, Summary]) -> list[str]:
    return aligned(table_rows(found))


def draw_picture(errors: Mapping[str, tuple[Floats, Floats]], name: str = NAME) -> str:
    """rms of each row against time; errors: instants, h, and (runs, looks) deg."""
    with plots.drawing(3.4) as (drawn, ax):
        colours = (*plots.SERIES, plots.INK)
        styles = ((colour, dash) for dash in ("-", "--") for colour in colours)
        for (label, (t_h, e)), (colour, dash) in zip(errors.items(), styles, strict=False):
            ax.plot(t_h, np.sqrt((e**2).mean(axis=0)), color=colour, lw=1.5, ls=dash, label=label)
        ax.axhline(CLAIM_DEG, color=plots.MUTED, lw=1.0, ls=":")
        ax.set_yscale("log")
        ax.set_ylim(0.03, 6.0)
        ax.set_yticks([0.05, 0.1, 0.3, 1.0, 3.0], ["0.05", "0.1", "0.3", "1", "3"])
        ax.set_xlabel("time of the flight, h")
        ax.set_ylabel("heading error, rms, deg")
        ax.legend(loc="lower left", ncols=3, bbox_to_anchor=(0.0, 1.0))
        return plots.svg(drawn, name)


def result_dict(found: Mapping[str, Summary], facts: Mapping[str, Any]) -> dict[str, Any]:
    """result.json: the same for the same seed."""

    def pair(f: Figure) -> list[float]:
        return [f.value, f.low, f.high]

    rows = {
        name: {
            "title": ROWS[name].title,
            "start_rms_deg": pair(s.start_rms_deg),
            "end_rms_deg": pair(s.end_rms_deg),
            "end_p95_deg": pair(s.end_p95_deg),
            "within": pair(s.within),
            "within_abstract": pair(s.within_abstract),
        }
        for name, s in found.items()
    }
    return {"format": FORMAT, "procedure": NAME, **facts, "rows": rows}


def write_page(
    out: Path,
    errors: Mapping[str, tuple[Floats, Floats]],
    found: Mapping[str, Summary],
    facts: Mapping[str, Any],
    notes: Sequence[str] = NOTES,
) -> Path:
    """report.html and result.json; the page. Raises OSError, OutputError."""
    out.mkdir(parents=True, exist_ok=True)
    sections = (
        section("Modes", table([["", "what it is"], *([n, ROWS[n].title] for n in found)])),
        section("Errors of the heading", table(table_rows(found))),
        section("Against time", figure(draw_picture(errors))),
        section("How to read it", bullets(notes)),
    )
    page = whole_page("Modes of the heading indicator", {k: str(v) for k, v in facts.items()}, sections)
    return write_report(out, result_dict(found, facts), page)


def look_hours(p: ModeParams, looks: int) -> Floats:
    return np.linspace(0.0, p.hours, looks)

"""report.html and result.json of a season, and what the console shows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from psabench.koi.geodesy import MILE_M
from psabench.koi.sensors import instrument_class
from psabench.koi.wire.season import NAME, Season
from psabench.native.nav import DEGPH
from psabench.report import plots as style
from psabench.report.page import bullets, figure, section, table, verdict_line, whole_page, write_report

NOTES = (
    "Each flight begins with what the passport knows by then: the sensors are corrected by it. What is not known is "
    "the persistent error less that, of the drawn unit; the host does not see it.",
    "Autonomous: the largest horizontal error within an hour of take-off. The article's limit is a mile.",
    "A flight that was cut off stays in the passport as one that began.",
)


def console_lines(season: Season) -> Iterator[str]:
    """A line each flight, the verdict."""
    for row in season.rows:
        nu, df = unknown_rms(row.unknown)
        error = "-" if row.hour_error_m is None else f"{row.hour_error_m:.0f} m"
        weight = f"weight {row.weight:.2f}" if not row.verdict else f"no weight: {row.verdict}"
        yield f"flight {row.number}: autonomous {error}; not known {nu:.4f} deg/h, {df:.2e} m/s2; {weight}"
    yield verdict_words(season)


def unknown_rms(unknown: tuple[float, ...]) -> tuple[float, float]:
    """Of drifts, deg/h, and of biases, m/s2."""
    x = np.array(unknown)
    return float(np.sqrt(np.mean(x[:3] ** 2)) / DEGPH), float(np.sqrt(np.mean(x[3:6] ** 2)))


def verdict_words(season: Season) -> str:
    """One line."""
    kind = instrument_class(season.params.setup().cfg)
    before, after = (
        unknown_rms(tuple((season.persistent - p)[:6].tolist())) for p in (np.zeros(len(kind.names)), season.known.p)
    )
    cut = f", {season.incomplete} cut off" if season.incomplete else ""
    told = f"unit {season.params.unit}: {len(season.rows)} flights{cut}, {season.known.flights} with weight"
    return f"{told}; not known {before[0]:.4f} -> {after[0]:.4f} deg/h, {before[1]:.2e} -> {after[1]:.2e} m/s2"


def result_dict(season: Season) -> dict[str, Any]:
    """For result.json."""
    return {
        "format": 1,
        "procedure": NAME,
        "params": asdict(season.params),
        "flights": [asdict(row) for row in season.rows],
        "incomplete": season.incomplete,
        "known": {
            "p": season.known.p.tolist(),
            "covariance": season.known.covariance.tolist(),
            "flights": season.known.flights,
        },
        "persistent": season.persistent.tolist(),
    }


def write_page(out: Path, season: Season) -> Path:
    """report.html and result.json; the page. Raises OSError, OutputError."""
    rows = [["flight", "autonomous, m", "corrected", "weight", "drifts not known, °/h", "biases, m/s²"]]
    for r in season.rows:
        nu, df = unknown_rms(r.unknown)
        error = "-" if r.hour_error_m is None else f"{r.hour_error_m:.0f}"
        rows.append([f"{r.number}", error, "yes" if r.corrected else "no", f"{r.weight:.2f}", f"{nu:.4f}", f"{df:.2e}"])
    verdicts = [f"flight {r.number}: {r.verdict}" for r in season.rows if r.verdict]
    parts = [
        verdict_line(verdict_words(season).partition(": ")[2], None),  # the unit is in the page's head
        section("Flights", table(rows), figure(_draw_errors(season)), bullets(verdicts)),
        section("How to read it", bullets(NOTES)),
    ]
    facts = {"unit": season.params.unit, "class": season.params.unit_class, "routes": season.params.routes}
    return write_report(out, result_dict(season), whole_page("A season of flights", facts, parts))


def _draw_errors(season: Season) -> str:
    """As the article's fig. 1: the error of each flight."""
    with style.drawing(3.0) as (fig, ax):
        numbers = [r.number for r in season.rows]
        errors = [math.nan if r.hour_error_m is None else r.hour_error_m for r in season.rows]
        ax.plot(numbers, errors, color=style.SERIES[0], marker="o", lw=1.2)
        ax.axhline(MILE_M, color=style.MUTED, lw=1.0, ls=":")
        ax.set_xlabel("flight; dotted: a mile")
        ax.set_ylabel("autonomous error, m")
        ax.set_ylim(bottom=0.0)
        return style.svg(fig, NAME)

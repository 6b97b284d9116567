"""What the campaign `sins-methods` shows: a table of errors for each rate table, and what each method needs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

from psabench.campaign.sins_methods import METHODS, PRIOR, Row
from psabench.campaign.sins_table import BASES, Base
from psabench.report import plots
from psabench.report.grading import aligned
from psabench.report.page import bullets, figure, section, table, whole_page, write_report
from psabench.sins.covariance import QUANTITIES

NAME = "sins-methods"
FORMAT = 1  # of result.json
REFERENCE, MARKS = "filter", "sovDPX"
NOTES = (
    "Each figure is the root mean square error over the units and the elements of a column, in the article's gauge. "
    "Noise: the article's, accelerometers x 4 (reading B), angles of the table 15 arcsec a reading at 10 Hz.",
    "In brackets: more than half of what is known before, so the method does not find it.",
    "Six positions take the table's level and azimuth for true: their errors are those of the table. "
    "Gyros that turn against the table's angles stay in the table's axes, accelerometers in the level's.",
    "The Earth's rate alone is no reference for a gyro's scale and axes: a part in a thousand of it is 0.015 deg/h.",
    "Not in this comparison: wobble and ripple of the table, a shift of its clock, lever arms, temperature.",
)


def _figure(row: Row, key: str) -> str:
    text = f"{row.rms[key]:.2g}"
    return text if row.found(key) else f"({text})"


def error_rows(rows: Sequence[Row], base: Base) -> list[list[str]]:
    """One rate table."""
    heading = [base.name, *(f"{q.label}, {q.unit}" if q.unit else q.label for q in QUANTITIES)]
    before = ["known before", *(f"{PRIOR[q.key]:.2g}" for q in QUANTITIES)]
    chosen = [r for r in rows if r.base == base]
    return [heading, before, *([r.method.name, *(_figure(r, q.key) for q in QUANTITIES)] for r in chosen)]


def cost_rows(rows: Sequence[Row]) -> list[list[str]]:
    """What each method needs of the table, and its time; computing is of this machine."""
    chosen = {r.method.name: r for r in rows if r.base == BASES[0]}
    return [
        ["", "plan", "takes for true", "table, min", "computing, ms"],
        *(
            [m.name, m.plan, m.needs, f"{chosen[m.name].minutes:.1f}", f"{1e3 * chosen[m.name].compute_s:.0f}"]
            for m in METHODS
        ),
    ]


def console_lines(rows: Sequence[Row]) -> list[str]:
    """All tables."""
    parts = [error_rows(rows, base) for base in BASES] + [cost_rows(rows)]
    return "\n\n".join("\n".join(aligned(part)) for part in parts).split("\n")


def result_dict(rows: Sequence[Row], units: int, seed: int) -> dict[str, Any]:
    """result.json: the same for the same seed, but for the provenance; no times of computing."""
    return {
        "format": FORMAT,
        "procedure": NAME,
        "units": units,
        "seed": seed,
        "prior": dict(PRIOR),
        "rows": [
            {"table": r.base.name, "method": r.method.name, "plan": r.method.plan, "rms": dict(r.rms)} for r in rows
        ],
    }


def error_figure(rows: Sequence[Row]) -> str:
    """Errors of each method as multiples of the filter's without angles, a panel each rate table."""
    with plots.drawing(3.6, 1, len(BASES), sharey=True) as (drawn, axes):
        for ax, base in zip(axes, BASES, strict=True):
            chosen = {r.method.name: r.rms for r in rows if r.base == base}
            for (name, rms), colour, mark in zip(chosen.items(), cycle(plots.SERIES), MARKS, strict=False):
                ratio = [rms[q.key] / chosen[REFERENCE][q.key] for q in QUANTITIES]
                ax.plot(range(len(ratio)), ratio, mark, ms=5, color=colour, label=name)
            ax.axhline(1.0, color=plots.MUTED, lw=0.8)
            ax.set_yscale("log")
            ax.set_xticks(range(len(QUANTITIES)), [q.label for q in QUANTITIES])
            ax.set_title(base.name)
        axes[0].set_ylabel("error / error of the filter")
        drawn.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
        return plots.svg(drawn, NAME)


def write_page(out: Path, rows: Sequence[Row], units: int, seed: int) -> Path:
    """report.html and result.json; the page. Raises OSError, OutputError."""
    out.mkdir(parents=True, exist_ok=True)
    sections = (
        *(section(f"Table: {base.name}", table(error_rows(rows, base))) for base in BASES),
        section("Beside the filter", figure(error_figure(rows))),
        section("What each method takes", table(cost_rows(rows))),
        section("How to read it", bullets(NOTES)),
    )
    facts = {"units": str(units), "seed": str(seed)}
    return write_report(out, result_dict(rows, units, seed), whole_page("Methods of calibration", facts, sections))

#!/usr/bin/env python3
"""Write the tables of docs/procedures/quartz_deformation.md and run_in.md and draw their pictures into docs/img.

Computes what `psabench campaign quartz-deformation` and `run-in` do. Same code, same bytes. A table is the fenced
block, or the Markdown table, after a line `<!-- quartz: NAME -->`.

    tools/plots/quartz.py [--check]     --check: write nothing, exit status 1 when a table is not what is computed
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from psabench.progress import Bar
from psabench.quartz import deformation, deformation_page, deformation_plots, element, run_in_command, run_in_page
from psabench.quartz import run_in_plots as plots
from psabench.report import plots as report_plots
from psabench.report.grading import aligned

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "docs/procedures"
IMAGES = ROOT / "docs/img"
TABLE = re.compile(r"(?<=<!-- quartz: )(\w+)( -->\n)(```\n.*?```\n|\|.*?\n(?=\n))", re.DOTALL)
MARKDOWN = ("verdicts", "figures")
RUN_IN_UNITS = 20_000  # of the page: intervals of a fifth of those of the default

Rows = list[list[str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """What is computed for a page: its tables and its pictures by name."""

    tables: Mapping[str, Rows]
    pictures: Mapping[str, str]


def compute_deformation(quiet: Bar) -> Page:
    """As without options."""
    how = {"elements": 20000, "units": 10000, "seed": 1}
    s = deformation.run_study(element.change_figures(), "serial", progress=quiet, **how)
    tables = {
        "verdicts": deformation_page.verdict_table(s),
        "gap": deformation_page.gap_table(s),
        "zero": deformation_page.zero_table(s),
        "batch": deformation_page.yield_table(s),
        "figures": deformation_page.figure_table(s),
    }
    return Page(tables=tables, pictures=deformation_plots.draw_all(s))


def compute_run_in(quiet: Bar) -> Page:
    """As without options, with RUN_IN_UNITS units, on this process alone."""
    with tempfile.TemporaryDirectory() as out:
        o = run_in_command.Options(units=RUN_IN_UNITS, workers=1, out=Path(out))
        r = run_in_command.run_campaign(o, quiet)
    tables = {
        "gain": run_in_page.gain_table(r),
        "means": run_in_page.mean_table(r),
        "stop": run_in_page.stop_table(r),
        "small": run_in_page.small_table(r),
        "grades": run_in_page.grade_table(r),
    }
    return Page(tables=tables, pictures=plots.draw_all(r.figures, r.what.batch["zero_tolerance_ug"]))


COMPUTED: Mapping[str, Callable[[Bar], Page]] = {"quartz_deformation": compute_deformation, "run_in": compute_run_in}


def with_tables(text: str, page: Page) -> str:
    """The page with its tables as computed."""
    return TABLE.sub(lambda m: m[1] + m[2] + _table_text(m[1], page.tables[m[1]]), text)


def _table_text(name: str, rows: Rows) -> str:
    if name in MARKDOWN:
        return "".join(f"| {' | '.join(row)} |\n" for row in (rows[0], ["---"] * len(rows[0]), *rows[1:]))
    return "```\n" + "".join(f"{line}\n" for line in aligned(rows)) + "```\n"


def main(check: bool) -> int:
    stale = 0
    with Path(os.devnull).open("w", encoding="utf-8") as nothing:
        for name, compute in COMPUTED.items():
            page, path = compute(Bar(nothing)), PAGES / f"{name}.md"
            text = path.read_text(encoding="utf-8")
            if check:
                print(f"{path.relative_to(ROOT)}: {'ok' if text == with_tables(text, page) else 'a table is stale'}")
                stale += text != with_tables(text, page)
                continue
            path.write_text(with_tables(text, page), encoding="utf-8")
            for picture, svg in page.pictures.items():
                (IMAGES / f"{name}_{picture}.svg").write_text(report_plots.standalone(svg), encoding="utf-8")
    return int(stale > 0)


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))

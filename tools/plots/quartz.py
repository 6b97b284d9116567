#!/usr/bin/env python3
"""Write the tables of docs/procedures/quartz_deformation.md and draw its pictures into docs/img.

Computes what `psabench campaign quartz-deformation` does. Same code, same bytes. A table is the fenced block, or the
Markdown table, after a line `<!-- quartz: NAME -->`.

    tools/plots/quartz.py [--check]     --check: write nothing, exit status 1 when a table is not what is computed
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from psabench.progress import Bar
from psabench.quartz import deformation, deformation_plots, element
from psabench.quartz import deformation_page as page
from psabench.quartz.deformation import Study
from psabench.report import plots as report_plots
from psabench.report.grading import aligned

ROOT = Path(__file__).resolve().parents[2]
DEFORMATION = ROOT / "docs/procedures/quartz_deformation.md"
IMAGES = ROOT / "docs/img"
TABLE = re.compile(r"(?<=<!-- quartz: )(\w+)( -->\n)(```\n.*?```\n|\|.*?\n(?=\n))", re.DOTALL)
TABLES: Mapping[str, Callable[[Study], list[list[str]]]] = {
    "verdicts": page.verdict_table,
    "gap": page.gap_table,
    "zero": page.zero_table,
    "batch": page.yield_table,
    "figures": page.figure_table,
}
MARKDOWN = ("verdicts", "figures")


def computed() -> Study:
    """As without options."""
    with Path(os.devnull).open("w", encoding="utf-8") as quiet:
        how = {"elements": 20000, "units": 10000, "seed": 1}
        return deformation.run_study(element.change_figures(), "serial", progress=Bar(quiet), **how)


def with_tables(text: str, s: Study) -> str:
    """The page with its tables as computed."""
    return TABLE.sub(lambda m: m[1] + m[2] + _table(m[1], TABLES[m[1]](s)), text)


def _table(name: str, rows: list[list[str]]) -> str:
    if name in MARKDOWN:
        return "".join(f"| {' | '.join(row)} |\n" for row in (rows[0], ["---"] * len(rows[0]), *rows[1:]))
    return "```\n" + "".join(f"{line}\n" for line in aligned(rows)) + "```\n"


def draw(folder: Path, s: Study) -> None:
    """The page's pictures."""
    for name, picture in deformation_plots.draw_all(s).items():
        (folder / f"quartz_deformation_{name}.svg").write_text(report_plots.standalone(picture), encoding="utf-8")


def main(check: bool) -> int:
    s = computed()
    text = DEFORMATION.read_text(encoding="utf-8")
    wanted = with_tables(text, s)
    if check:
        print(f"{DEFORMATION.relative_to(ROOT)}: its tables {'are' if text == wanted else 'are not'} what is computed")
        return int(text != wanted)
    DEFORMATION.write_text(wanted, encoding="utf-8")
    draw(IMAGES, s)
    return 0


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))

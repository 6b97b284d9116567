#!/usr/bin/env python3
"""Write the tables of docs/procedures/gyrocompass_campaign.md and draw its pictures into docs/img.

Computes the campaign as `psabench campaign gyrocompass` does, into a store of its own. Same library, same bytes. A
table is the fenced block, or the Markdown table, after a line `<!-- campaign: STUDY -->`; `claims` names the article's.

    tools/plots/campaign.py [--check]     --check: write nothing, exit status 1 when a table is not what is computed
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

from psabench.campaign import command, page
from psabench.campaign.cases import STUDIES
from psabench.campaign.command import Options
from psabench.campaign.page import Campaign
from psabench.progress import Bar
from psabench.report import plots as report_plots
from psabench.report.grading import aligned

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/procedures/gyrocompass_campaign.md"
RUNS = 100_000  # a case; the third digit of a p95 is
IMAGES = ROOT / "docs/img"
PICTURES = ("step", "latitude", "tilt", "time", "order", "slew", "hold")  # and the distribution
TABLE = re.compile(r"(?<=<!-- campaign: )(\w+)( -->\n)(```\n.*?```\n|\|.*?\n(?=\n))", re.DOTALL)


def computed(out: Path) -> Campaign:
    """All studies, as without options but with more runs."""
    return command.campaign(Options(runs=RUNS, out=out), Bar())


def with_tables(text: str, c: Campaign) -> str:
    """The page with its tables as computed."""
    return TABLE.sub(lambda m: m[1] + m[2] + _table(m[1], c), text)


def _table(name: str, c: Campaign) -> str:
    if name == "claims":
        rows = [("the article", "kindest reading", "honest", "improved", "verdict"), ("---",) * 5]
        rows += [(x.says, x.reading, x.honest, x.improved, x.verdict) for x in c.claims]
        return "".join(f"| {' | '.join(row)} |\n" for row in rows)
    lines = aligned(page.table(c, STUDIES[name]))
    return "```\n" + "".join(f"{line}\n" for line in lines) + "```\n"


def draw(folder: Path, c: Campaign) -> None:
    pictures = {"distribution": c.distribution} | {name: page.picture(c, STUDIES[name]) for name in PICTURES}
    for name, picture in pictures.items():
        (folder / f"campaign_{name}.svg").write_text(report_plots.standalone(picture), encoding="utf-8")


def main(check: bool) -> int:
    with tempfile.TemporaryDirectory() as out:
        c = computed(Path(out))
    text = PAGE.read_text(encoding="utf-8")
    wanted = with_tables(text, c)
    if check:
        print(f"{PAGE.relative_to(ROOT)}: {'its tables are' if text == wanted else 'a table is not'} what is computed")
        return int(text != wanted)
    PAGE.write_text(wanted, encoding="utf-8")
    draw(IMAGES, c)
    return 0


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))

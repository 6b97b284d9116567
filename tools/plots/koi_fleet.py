#!/usr/bin/env python3
"""Write the tables of docs/procedures/koi_fleet.md and draw its pictures into docs/img from finished campaigns.

    tools/plots/koi_fleet.py CLEAN HARM     folders of `psabench campaign koi -o`: the first with both classes and
                                            --linear, the second with --condition all

Same stores, same bytes. A table is the fenced block after a line `<!-- koi_fleet: NAME -->`. A campaign takes an hour
of one core, so this tool computes nothing: it says what is missing.
"""

from __future__ import annotations

import json
import re
import sys
from io import StringIO
from pathlib import Path

from psabench.campaign.store import Store
from psabench.errors import BadInput, expected
from psabench.koi.fleet import linear, page
from psabench.koi.fleet.work import Fleet, list_missing
from psabench.progress import Bar
from psabench.report import plots
from psabench.report.grading import aligned

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/procedures/koi_fleet.md"
NOT_SHOWN = ("first_good", "curves_good")
TABLE = re.compile(r"(?<=<!-- koi_fleet: )(\w+)( -->\n)```\n.*?```\n", re.DOTALL)


def load_report(folder: Path, *, covariance: bool) -> page.Report:
    """Of a finished campaign. Raises BadInput where it is not, or was computed by another build."""
    told = json.loads((folder / "result.json").read_text(encoding="utf-8"))["fleet"]
    told |= {name: tuple(told[name]) for name in ("classes", "conditions")}
    fleet = Fleet(**told)
    with Store(folder / "store.sqlite") as store:
        if missing := list_missing(fleet, store):
            raise BadInput(expected("all seasons of this build", f"{len(missing)} missing", folder))
        predicted = linear.predict_fleet(fleet, store, Bar(StringIO())) if covariance else {}
        return page.gather_report(fleet, store, predicted)


def main(clean: str, harm: str) -> int:
    usual, wrong = load_report(Path(clean), covariance=True), load_report(Path(harm), covariance=False)
    tables = {
        "claims": page.claim_table(usual),
        "modes": page.mode_table(usual),
        "filter": page.filter_table(usual),
        "learned": page.learned_table(usual),
        "linear": page.linear_table(usual),
        "harm": page.harm_table(wrong),
        "reasons": page.reason_table(wrong),
    }
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(TABLE.sub(lambda m: m[1] + m[2] + _fenced(tables[m[1]]), text), encoding="utf-8")
    for name, svg, _ in page.draw_pictures(usual):
        if name in NOT_SHOWN:
            continue
        (ROOT / f"docs/img/koi_{name}.svg").write_text(plots.standalone(svg), encoding="utf-8")
    return 0


def _fenced(rows: list[list[str]]) -> str:
    return "```\n" + "".join(f"{line}\n" for line in aligned(rows)) + "```\n"


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))

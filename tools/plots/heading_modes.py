#!/usr/bin/env python3
"""Draw docs/img/heading_modes.svg for docs/procedures/heading_modes.md, as `psabench campaign heading-modes` does."""

from __future__ import annotations

from pathlib import Path

from psabench.campaign import heading_modes_page as page
from psabench.campaign.heading_modes import ROWS, errors_deg
from psabench.procedures.heading_modes import ModeParams
from psabench.report import plots

ROOT = Path(__file__).resolve().parents[2]
RUNS, SEED = 200, 1


def main() -> None:
    p = ModeParams()
    errors = {name: errors_deg(row, p, SEED, RUNS) for name, row in ROWS.items()}
    drawn = page.draw_picture(
        {name: (page.look_hours(p, e.shape[1]), e) for name, e in errors.items()}, "heading_modes"
    )
    (ROOT / "docs/img/heading_modes.svg").write_text(plots.standalone(drawn), encoding="utf-8")


if __name__ == "__main__":
    main()

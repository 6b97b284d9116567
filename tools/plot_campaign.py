#!/usr/bin/env python3
"""Draw the pictures of docs/procedures/gyrocompass_campaign.md into docs/img, and print the tables of the page.

Computes the campaign as `psabench campaign gyrocompass` does, into a store of its own. Same library, same bytes.

    tools/plot_campaign.py [docs/img]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from psabench import report_plots
from psabench.campaign import command, page
from psabench.campaign.cases import STUDIES
from psabench.campaign.command import Options
from psabench.progress import Bar

PICTURES = ("step", "latitude", "tilt", "time", "order", "slew", "hold")  # and the distribution


def main(folder: Path) -> None:
    with tempfile.TemporaryDirectory() as out:
        c = command.campaign(Options(out=Path(out)), Bar())
    pictures = {"distribution": c.distribution} | {name: page.picture(c, STUDIES[name]) for name in PICTURES}
    for name, picture in pictures.items():
        (folder / f"campaign_{name}.svg").write_text(report_plots.standalone(picture), encoding="utf-8")
    print("\n".join(page.console(c)))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/img"))

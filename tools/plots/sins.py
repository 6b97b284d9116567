#!/usr/bin/env python3
"""Draw docs/img/sins_fig1.svg and sins_snake.svg of docs/procedures/sins_secondary.md. Same bytes each time.

tools/plots/sins.py [docs/img]
"""

from __future__ import annotations

import sys
from pathlib import Path

from psabench.campaign.sins_pairs import params_of, run_pair
from psabench.campaign.sins_unit import read_experiment
from psabench.report import plots
from psabench.sins import snake, snake_page
from psabench.sins.secondary import page as secondary_page
from psabench.sins.secondary.estimate import calibrate_outputs, compensate_outputs

ROOT = Path(__file__).resolve().parents[2]


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/img"
    e = read_experiment("article")
    first, second, _ = run_pair(e, 0)
    done = compensate_outputs(calibrate_outputs(first, e.point, params_of(e).config()), second)
    for name, text in (
        ("sins_fig1", secondary_page.draw_fig1(done)),
        ("sins_snake", snake_page.draw_curves(snake.run_snake(snake.SnakeParams()))),
    ):
        (folder / f"{name}.svg").write_text(plots.standalone(text), encoding="utf-8")


if __name__ == "__main__":
    main()

"""`psabench campaign sins-methods`: options, what is computed, what is printed."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from psabench.errors import BadInput, expected
from psabench.options import Parser, natural, report_folder
from psabench.output import add_json, show_report

ABOUT = """\
Draw strapdown units with the article's errors, put each on three rate tables (level and true; off level; off its
azimuth) and calibrate it by each method: six positions, six positions and whole turns, Fourier series of the three
cycles, the filter with and without the table's angles. The table shows the error that each method leaves.
"""
EPILOG = """\
docs/procedures/sins_methods.md derives the methods and says what each of them needs.

examples:
  psabench campaign sins-methods                       eight units
  psabench campaign sins-methods --units 40 --seed 2

Exit status: 0 done, 2 bad input, 130 ended by Ctrl-C.
"""
MOST_UNITS, MOST_SEED = 100_000, 2**53
UNITS, SEED, OUT = 8, 1, Path("build/sins-methods")


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench campaign sins-methods`. Raises BadInput."""
    p = Parser(prog="psabench campaign sins-methods", description=ABOUT, epilog=EPILOG)
    p.set_defaults(handler=_run_command)
    p.add_argument("--units", type=natural, default=UNITS, help="units to draw (%(default)s)")
    p.add_argument("--seed", type=natural, default=SEED, help="random seed (%(default)s)")
    p.add_argument("--out", type=report_folder, default=OUT, help="folder of the report (%(default)s)")
    add_json(p)
    return p.parse_args(words)


def _run_command(args: argparse.Namespace) -> int:
    from psabench.campaign import sins_methods_page as page
    from psabench.campaign.sins_methods import run_methods
    from psabench.progress import Bar
    from psabench.report import provenance

    for option, value, low, high in (("--units", args.units, 1, MOST_UNITS), ("--seed", args.seed, 0, MOST_SEED)):
        if not low <= value <= high:
            raise BadInput(expected(f"{low} to {high}", value, option))
    provenance.note_digest(page.NAME, args.seed, {"units": args.units})
    rows = run_methods(args.units, args.seed, Bar())
    report = page.write_page(args.out, rows, args.units, args.seed)
    show_report(args, page.console_lines(rows), lambda: report)
    return 0

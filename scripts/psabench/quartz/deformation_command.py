"""`psabench campaign quartz-deformation`: options, what is computed, what is printed."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from psabench.errors import BadInput, expected
from psabench.options import Parser, natural, report_folder
from psabench.output import add_json, show_data, show_report

if TYPE_CHECKING:
    from psabench.quartz.element import Figures

ABOUT = """\
Deform the sensing element of a quartz accelerometer by 1 g over -60 to +85 °C: thousands of elements with their
tolerances, after equations (6) to (12) of the article of Denisov and Akilin. The report compares the gap's change with
the article's 0.5 %, the zero signal of the hinges with the curves of its fig. 2, and draws its fig. 5: a serial batch
before and after run-in.
"""
EPILOG = """\
The article gives no sizes, no tolerances and no E(T): the figures are ours, each with source and grade (--list).
Three equations are lost in our copy and derived; the report says which.

examples:
  psabench campaign quartz-deformation                              20000 elements; build/quartz-deformation/report.html
  psabench campaign quartz-deformation --list                       the figures that --set changes
  psabench campaign quartz-deformation --set thickness_um=160       does a free element keep 0.5 % on thicker hinges?
  psabench campaign quartz-deformation --set thickness_um=50:5      value and tolerance: 50 ± 5 µm
  psabench campaign quartz-deformation --batch mine.yaml            your batch: the keys of proto/batches/serial.yaml

Exit status: 0 done and within limits, 1 done and out of limits, 2 bad input, 130 ended by Ctrl-C. Limits apply to the
study as it is, with 1000 elements and units at least.
"""
MOST = 10_000_000
MOST_SEED = 2**63 - 1


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench campaign quartz-deformation`. Raises BadInput."""
    p = Parser(prog="psabench campaign quartz-deformation", description=ABOUT, epilog=EPILOG)
    p.set_defaults(handler=_run_command)
    p.add_argument("--list", action="store_true", help="list the figures of an element with tolerance, source, grade")
    p.add_argument("--elements", type=natural, default=20000, help="sensing elements to deform (%(default)s)")
    p.add_argument("--units", type=natural, default=10000, help="units of the batch (%(default)s)")
    p.add_argument("--batch", default="serial", metavar="NAME|FILE", help="production batch (%(default)s)")
    p.add_argument("--seed", type=natural, default=1, help="random seed (%(default)s)")
    text = "change a figure of the element; names in --list"
    p.add_argument("--set", action="append", default=[], metavar="NAME=VALUE[:TOLERANCE]", help=text)
    p.add_argument(
        "--out", type=report_folder, default=Path("build/quartz-deformation"), help="folder of the report (%(default)s)"
    )
    add_json(p)
    return p.parse_args(words)


def _run_command(args: argparse.Namespace) -> int:
    from psabench.quartz import element

    figures = element.change_figures(args.set)
    if args.list:
        rows = [{"name": name, **asdict(f)} for name, f in figures.items()]
        show_data(args, rows, element.figure_lines(figures))
        return 0
    _check_numbers(args)
    return _run_study(args, figures)


def _check_numbers(args: argparse.Namespace) -> None:
    for name in ("elements", "units"):
        if not 1 <= (value := getattr(args, name)) <= MOST:
            raise BadInput(expected(f"1 to {MOST}", value, f"--{name}"))
    if args.seed > MOST_SEED:
        raise BadInput(expected(f"0 to {MOST_SEED}", args.seed, "--seed"))


def _run_study(args: argparse.Namespace, figures: Figures) -> int:
    from psabench.progress import Bar
    from psabench.quartz import deformation
    from psabench.quartz import deformation_page as page  # matplotlib takes a second
    from psabench.report import provenance

    how = {"elements": args.elements, "units": args.units, "seed": args.seed}
    found = deformation.run_study(figures, args.batch, progress=Bar(), **how)
    provenance.note_digest("quartz-deformation", args.seed, page.origin_dict(found))
    lines = [*page.console_lines(found), page.verdict_words(found)]
    show_report(args, lines, lambda: page.write_page(args.out, found))
    return 0 if page.is_within(found) else 1

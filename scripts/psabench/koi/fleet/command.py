"""`psabench campaign koi`: options, what is computed, what is printed."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from psabench.errors import BadInput, expected
from psabench.options import KEPT, Parser, natural, report_folder
from psabench.output import add_json, show_report
from psabench.report import provenance

if TYPE_CHECKING:
    from psabench.koi.fleet.page import Report
    from psabench.koi.fleet.work import Fleet
    from psabench.procedures.head_bench import Progress

ABOUT = """\
Fly drawn strapdown units with a satellite receiver, each a season of flights, in four modes on the same errors and
noise: as they are; corrected at take-off; with what earlier flights taught; both. Truth is nonlinear: exact increments
of an aircraft over the ellipsoid. The report has the article's figures 1 to 5 beside ours, factors with intervals, and
what failures of the receiver do.
"""
EPILOG = """\
docs/procedures/koi_fleet.md says what is drawn and what was found. A flight takes about a second; conditions other than
clean are flown in the modes none and both alone.

examples:
  psabench campaign koi                                     10 units of each class; build/koi/report.html
  psabench campaign koi --units 2 --flights 4 --class good
  psabench campaign koi --units 25 --class bins --condition clean --condition outage
  psabench campaign koi --units 40 --condition all --jobs 8 -o build/koi-all

Conditions of --condition: clean, outage, spoof, slow-spoof, jump, late, early, lever, slow-velocity, or all.

Results are in the store (docs/store.md): the same command computes only what is missing, Ctrl-C keeps what is done.
Exit status: 0 done, 2 bad input, 130 ended by Ctrl-C.
"""
MOST_UNITS, MOST_FLIGHTS, MOST_SEED = 100_000, 100, 2**53
UNITS, FLIGHTS, SEED, OUT = 10, 8, 1, Path("build/koi")
CLASSES = ("good", "bins")


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench campaign koi`. Raises BadInput."""
    p = Parser(prog="psabench campaign koi", description=ABOUT, epilog=EPILOG)
    p.set_defaults(handler=_run_command, kept=KEPT)
    p.add_argument("--units", type=natural, default=UNITS, help="units of each class (%(default)s)")
    p.add_argument("--flights", type=natural, default=FLIGHTS, help="flights of a season (%(default)s)")
    p.add_argument("--class", dest="classes", action="append", choices=CLASSES, help="class of units (both)")
    text = "what is wrong with the receiver; repeatable (clean)"
    p.add_argument("--condition", dest="conditions", action="append", metavar="NAME", help=text)
    p.add_argument("--linear", action="store_true", help="predict the same from the filter's covariance, too")
    p.add_argument("--jobs", type=natural, help="processes (one per core); 1: this process alone")
    p.add_argument("--seed", type=natural, default=SEED, help="random seed (%(default)s)")
    p.add_argument("-o", "--out", type=report_folder, default=OUT, help="folder of store and report (%(default)s)")
    p.add_argument("--fresh", action="store_true", help="compute stored results again")
    add_json(p)
    return p.parse_args(words)


def _run_command(args: argparse.Namespace) -> int:
    from psabench.koi.fleet import page
    from psabench.progress import Bar

    found = run_campaign(_fleet_of(args), args, Bar())
    show_report(args, page.console_lines(found), lambda: page.write_page(args.out, found))
    return 0


def _fleet_of(args: argparse.Namespace) -> Fleet:
    from psabench.koi.fleet.conditions import CONDITIONS
    from psabench.koi.fleet.work import Fleet

    limits = (("--units", args.units, MOST_UNITS), ("--flights", args.flights, MOST_FLIGHTS))
    for option, value, most in (*limits, ("--jobs", 1 if args.jobs is None else args.jobs, 1024)):
        if not 1 <= value <= most:
            raise BadInput(expected(f"1 to {most}", value, option))
    if args.seed > MOST_SEED:
        raise BadInput(expected(f"0 to {MOST_SEED}", args.seed, "--seed"))
    conditions = tuple(dict.fromkeys(args.conditions or ("clean",)))
    if "all" in conditions:
        conditions = tuple(CONDITIONS)
    for name in conditions:
        if name not in CONDITIONS:
            raise BadInput(expected(", ".join((*CONDITIONS, "all")), name, "--condition"))
    classes = tuple(name for name in CLASSES if name in (args.classes or CLASSES))
    return Fleet(classes=classes, conditions=conditions, units=args.units, flights=args.flights, seed=args.seed)


def run_campaign(fleet: Fleet, args: argparse.Namespace, progress: Progress) -> Report:
    """Compute what is missing, and gather what a report shows. Ctrl-C keeps what has been computed."""
    from dataclasses import asdict

    from psabench.campaign.store import Store
    from psabench.campaign.workers import workers
    from psabench.koi.fleet import linear, page, work

    provenance.note_digest("koi", fleet.seed, asdict(fleet))
    args.out.mkdir(parents=True, exist_ok=True)
    with Store(args.out / "store.sqlite") as store, provenance.without_notes():
        if args.fresh:
            for season in fleet.seasons():
                store.forget(work.make_origin(season))
        if wanted := work.list_missing(fleet, store):
            with workers(args.jobs) as at_work:
                work.fill_store(wanted, store, at_work, progress)
        predicted = linear.predict_fleet(fleet, store, progress) if args.linear else {}
        return page.gather_report(fleet, store, predicted)

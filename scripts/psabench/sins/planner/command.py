"""`psabench campaign sins-plan`: options, what is computed, what is printed."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from psabench.errors import BadInput, expected
from psabench.options import Parser, natural, of_fields, positive, report_folder
from psabench.output import add_json, show_report
from psabench.report import provenance

if TYPE_CHECKING:
    from psabench.native.sins import SinsConfig
    from psabench.procedures.head_bench import Progress
    from psabench.sins.planner.draft import Limits
    from psabench.sins.planner.page import Found
    from psabench.sins.planner.search import Search

ABOUT = """\
Search the plan of rotations that calibrates a strapdown unit best on your table and in your time. Plans are compared
by the covariance of the filter: no bench takes part. The report has what the article's plan leaves on the table.
"""
EPILOG = """\
A plan is scored by the mean of ln(sigma / sigma of the article's plan in the same time) over 21 parameters. The best
plan is OUT/plan.yaml, for --plan of `psabench run sins-covariance` and `sins-calibration`.

examples:
  psabench campaign sins-plan                                    the article's table and time
  psabench campaign sins-plan --max-rate-degps 60 --minutes 20   a faster table, less time
  psabench campaign sins-plan --axes 1 --remount-s 600           one axis: a person turns the unit over
  psabench campaign sins-plan --azimuths 90,60 --heading-sd-deg 0.1
  psabench campaign sins-plan --plans 20000 --workers 8          the same plan as on one core
  psabench campaign sins-plan --dask tcp://192.0.2.7:8786        on the cluster of this scheduler

Ctrl-C ends the search and keeps the best plan so far.
Exit status: 0 done, 2 bad input, 3 the cluster failed, 130 ended by Ctrl-C.
"""
MOST_PLANS, MOST_SEED = 10_000_000, 2**63 - 1
ALONE_S, PLAN_S_PER_S = 8.0, 2e-5  # of one core: a cluster takes about as long to start; computing of a plan's second


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What the command line asked for."""

    axes: int = 3
    max_rate_degps: float = 10.0
    azimuths: str = "0"
    minutes: float = 45.3  # of the article's plan, with its re-orientations
    remount_s: float = 300.0
    reading: str = "B"
    latitude_deg: float = 55.7
    heading_sd_deg: float = 3.0
    lever: int = 0
    plans: int = 1000
    seed: int = 1
    workers: int | None = None
    dask: str | None = None
    out: Path = Path("build/sins-plan")


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench campaign sins-plan`. Raises BadInput."""
    usual = Options()
    p = Parser(prog="psabench campaign sins-plan", description=ABOUT, epilog=EPILOG)
    p.set_defaults(handler=_run_command)
    p.add_argument("--axes", type=natural, default=usual.axes, help="axes of the table, 1 to 3 (%(default)s)")
    text = "greatest rate of each axis, deg/s (%(default)g); acceleration has no limit"
    p.add_argument("--max-rate-degps", type=positive, default=usual.max_rate_degps, metavar="RATE", help=text)
    text = "azimuths of axis 1 that are allowed, deg from north (%(default)s)"
    p.add_argument("--azimuths", default=usual.azimuths, metavar="A,B...", help=text)
    p.add_argument("--minutes", type=positive, default=usual.minutes, help="time of the calibration (%(default)g)")
    text = "time of a person for a turn that the table cannot make, s (%(default)g)"
    p.add_argument("--remount-s", type=positive, default=usual.remount_s, metavar="TIME", help=text)
    text = "of the noise: A, B, A,S1, B,S1 or B,S50 (%(default)s); S: with the table's angles"
    p.add_argument("--reading", default=usual.reading, help=text)
    p.add_argument("--latitude-deg", type=float, default=usual.latitude_deg, help="of the table (%(default)g)")
    text = "error of the heading at the start, deg (%(default)g)"
    p.add_argument("--heading-sd-deg", type=positive, default=usual.heading_sd_deg, help=text)
    text = "lever arms that are estimated: 0, 3 or 9 (%(default)s)"
    p.add_argument("--lever", type=natural, default=usual.lever, help=text)
    p.add_argument("--plans", type=natural, default=usual.plans, help="plans to compute at least (%(default)s)")
    p.add_argument("--seed", type=natural, default=usual.seed, help="random seed (%(default)s)")
    p.add_argument("--workers", type=natural, help="processes (one per core for long searches); 1: this process alone")
    p.add_argument("--dask", metavar="ADDRESS", help="compute on the workers of this Dask scheduler")
    p.add_argument("--out", type=report_folder, default=usual.out, help="folder of the report (%(default)s)")
    add_json(p)
    return p.parse_args(words)


def _run_command(args: argparse.Namespace) -> int:
    from psabench.progress import Bar
    from psabench.sins.planner import page

    found = find_plan(of_fields(Options, args), Bar())
    where = page.write_page(args.out, found)
    show_report(args, [*page.console_lines(found), f"plan: {args.out / page.PLAN_NAME}"], lambda: where)
    if found.ended_early:
        print("psabench: interrupted; the best plan so far is kept", file=sys.stderr)
        return 130
    return 0


def find_plan(o: Options, progress: Progress) -> Found:
    """Search, and compare what is found. Ctrl-C keeps the best so far. Raises BadInput, LinkError."""
    from psabench.native.nav import Refused
    from psabench.sins.planner.page import gather
    from psabench.sins.planner.search import Search

    limits, cfg = _check_options(o)
    try:
        search = Search(limits=limits, cfg=cfg, seed=o.seed)
    except Refused as e:
        raise BadInput(f"sins-plan: {e}") from e
    provenance.note_digest("sins-plan", o.seed, {"limits": repr(limits), "config": repr(cfg), "plans": o.plans})
    start_s = time.monotonic()
    early = _search(search, o, progress)
    return gather(search, o.reading, early, time.monotonic() - start_s)


def _search(search: Search, o: Options, progress: Progress) -> bool:
    """Whether Ctrl-C has ended it."""
    from psabench.campaign.workers import workers
    from psabench.sins.planner.search import whole_plans

    count = o.workers
    if count is None and o.dask is None and o.plans * search.limits.budget_s * PLAN_S_PER_S < ALONE_S:
        count = 1  # done before a cluster would have started
    try:
        with (
            workers(count, o.dask) as at_work,
            progress.step(f"plans, {at_work.count} at once", whole_plans(o.plans)) as done,
        ):
            search.run(o.plans, at_work, done)
    except KeyboardInterrupt:
        return True
    return False


def _check_options(o: Options) -> tuple[Limits, SinsConfig]:
    from psabench.native.sins import DEG, SinsConfig
    from psabench.sins.covariance import read_as
    from psabench.sins.planner.draft import Limits, article_draft, plan_dict
    from psabench.sins.planner.page import reading_of

    rows = (
        ("--axes", o.axes, 1, 3),
        ("--max-rate-degps", o.max_rate_degps, 0.5, 1000),
        ("--minutes", o.minutes, 1, 1440),
        ("--remount-s", o.remount_s, 1, 86400),
        ("--plans", o.plans, 1, MOST_PLANS),
        ("--seed", o.seed, 0, MOST_SEED),
        ("--workers", 1 if o.workers is None else o.workers, 1, 1024),
    )
    for where, value, low, high in rows:
        if not low <= value <= high:
            raise BadInput(expected(f"{low:g} to {high:g}", f"{value:g}", where))
    if o.workers is not None and o.dask is not None:
        raise BadInput(expected("none with --dask: the cluster has its own workers", o.workers, "--workers"))
    limits = Limits(
        axes=o.axes,
        max_rate_degps=o.max_rate_degps,
        azimuths_deg=_azimuths(o.azimuths),
        budget_s=o.minutes * 60.0,
        remount_s=o.remount_s,
    )
    if plan_dict(article_draft(limits), limits) is None:
        raise BadInput(expected("time for the article's three cycles", f"{o.minutes:g} minutes", "--minutes"))
    cfg = SinsConfig(latitude_rad=o.latitude_deg * DEG, beta_sd_rad=(DEG, DEG, o.heading_sd_deg * DEG), lever=o.lever)
    return limits, read_as(reading_of(o.reading), cfg)


def _azimuths(text: str) -> tuple[float, ...]:
    try:
        found = tuple(float(word) for word in text.split(","))
    except ValueError:
        found = ()
    if not found or not all(-360.0 <= a <= 360.0 for a in found):
        raise BadInput(expected("-360 to 360, separated by commas", repr(text), "--azimuths"))
    return found

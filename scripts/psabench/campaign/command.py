"""`psabench campaign gyrocompass`: options, what is computed, what is printed."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psabench.campaign import builds, chains, runner, settings
from psabench.campaign.cases import DEFAULT_STUDIES, STUDIES, WIRE_STUDIES, Case
from psabench.campaign.runner import Plan
from psabench.campaign.setup import Setup, as_input
from psabench.campaign.store import Store
from psabench.campaign.workers import reach, workers
from psabench.errors import BadInput, expected
from psabench.options import KEPT, Parser, natural, of_fields, report_folder
from psabench.output import add_json, show_data, show_report
from psabench.places import find_emulator
from psabench.procedures.head_bench import Progress
from psabench.progress import Bar
from psabench.report import provenance

if TYPE_CHECKING:
    from psabench.campaign.page import Campaign

ABOUT = """\
Run a procedure on thousands of virtual instruments, each with its own errors, on all cores or on a Dask cluster.
The report shows how often the article's claims hold, which errors matter, and what would improve them.
"""
EPILOG = """\
A study is a list of cases, a case an instrument with its schedule of positions (--list names all):
{studies}

examples:
  psabench campaign gyrocompass                                  20000 runs per case; build/campaign/report.html
  psabench campaign gyrocompass --study readings --runs 1000000
  psabench campaign gyrocompass --study step --chain samples     sample by sample, beside the closed form
  psabench campaign gyrocompass --case article --chain emulated  200 runs, each by an emulator and the host's procedure
  psabench campaign gyrocompass --chain emulated --scenario mine.yaml --set m1_per_s=2
  psabench campaign gyrocompass --study own --set angles_deg=0,120,240 --set gm_sigma_degph=0.05
  psabench campaign gyrocompass --study latitude --set angle_random_arcmin=0.5 --set encoder=yes
  psabench campaign gyrocompass --dask tcp://192.0.2.7:8786      on the cluster of this scheduler, the same numbers

NAME=VALUE of --set, with the article's values; lists with commas, yes or no. A study's own settings win over them:
{settings}

Results are in the store (docs/store.md): the same command computes only what is missing, Ctrl-C keeps what is done.
Exit status: 0 done and within limits, 1 done and out of limits, 2 bad input, 3 the cluster or the bench failed, 130
ended by Ctrl-C.
"""
DEFAULT_RUNS = {"closed": 20000, "samples": 20000, "emulated": 200, "wire": 20}
REFERENCE_RUNS = (20000, 1_000_000)  # of the closed form beside another chain: as many as that has, within these
MOST_RUNS = 100_000_000
MOST_SEED = 2**63 - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What the command line asked for."""

    studies: Sequence[str] = ()
    case: str | None = None
    chain: str = "closed"
    scenario: Path | None = None  # of the emulator's bench; None: the shipped one
    runs: int | None = None
    seed: int = 1
    settings: Sequence[str] = ()  # NAME=VALUE
    workers: int | None = None
    dask: str | None = None
    store: Path | None = None
    out: Path = Path("build/campaign")
    fresh: bool = False
    forget_others: bool = False


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench campaign gyrocompass`. Raises BadInput."""
    studies = (f"  {s.name:9} {s.title}" for s in STUDIES.values())
    p = Parser(
        prog="psabench campaign gyrocompass",
        description=ABOUT,
        epilog=EPILOG.format(studies="\n".join(studies), settings="\n".join(settings.lines())),
    )
    p.set_defaults(handler=_main, kept=KEPT)
    p.add_argument("--list", action="store_true", help="list the studies, their cases and the settings")
    p.add_argument("--study", action="append", default=[], help="study; may be repeated (all but own; emulated: wire)")
    p.add_argument("--case", help="run only the cases of this name")
    p.add_argument("--chain", choices=list(DEFAULT_RUNS), default="closed", help="method of computation (%(default)s)")
    p.add_argument(
        "--scenario",
        type=Path,
        metavar="FILE",
        help="bench of --chain emulated or wire, study own; the campaign draws the seed, the attitude and the "
        "platform's initial angle, --set overrides other values, and the schedule is that of the settings",
    )
    p.add_argument(
        "--runs",
        type=natural,
        help=f"runs of each case ({DEFAULT_RUNS['closed']}; emulated: 200, wire: {DEFAULT_RUNS['wire']})",
    )
    p.add_argument("--seed", type=natural, default=1, help="random seed (%(default)s)")
    p.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="override a setting of the article's error set; names below",
    )
    p.add_argument("--workers", type=natural, help="processes (one per core for long runs); 1: this process alone")
    p.add_argument(
        "--dask", metavar="ADDRESS", help="compute on the workers of this Dask scheduler, as tcp://192.0.2.7:8786"
    )
    p.add_argument("--store", type=Path, help="database of results (OUT/store.sqlite)")
    p.add_argument(
        "--out", type=report_folder, default=Path("build/campaign"), help="folder of the report (%(default)s)"
    )
    p.add_argument("--fresh", action="store_true", help="compute stored results again")
    p.add_argument("--forget-others", action="store_true", help="delete results of other builds")
    add_json(p)
    return p.parse_args(words)


def _main(args: argparse.Namespace) -> int:
    if args.list:
        show_data(args, _studies_dict(), _study_lines())
        return 0
    from psabench.campaign import page  # matplotlib takes a second: other commands and --list do without

    options = of_fields(Options, args, studies=args.study, settings=args.set)
    found = campaign(options, Bar())
    show_report(args, [*page.console(found), page.verdict(found)], lambda: page.write(options.out, found))
    return 0 if found.within else 1


def _study_lines() -> Iterator[str]:
    for study in STUDIES.values():
        yield f"{study.name}: {study.title}"
        yield from (f"  {line}" for line in _case_names(list(study.cases(Setup()))))
    yield "settings of --set, with the article's values"
    yield from settings.lines()


def _studies_dict() -> dict[str, Any]:
    """The same for programs."""
    studies = [
        {"study": s.name, "title": s.title, "cases": [{"case": c.name, "title": c.title} for c in s.cases(Setup())]}
        for s in STUDIES.values()
    ]
    return {"studies": studies, "settings": settings.setting_rows()}


def _case_names(cases: Sequence[Case]) -> list[str]:
    """A line a case; a line a curve of a scan."""
    curves: dict[str, list[str]] = {}
    for case in cases:
        told = case.name if case.title == case.name or case.study == "order" else f"{case.name}: {case.title}"
        curves.setdefault(case.curve or told, []).append(f"{case.x:g}" if case.curve else "")
    return [f"{name}, {' '.join(x)}" if x[0] else name for name, x in curves.items()]


def campaign(options: Options, progress: Progress) -> Campaign:
    """Compute what is missing, and gather all that a report shows. Ctrl-C keeps what has been computed.

    Raises BadInput for options that do not fit together, LinkError for a cluster that is not there.
    """
    from psabench.campaign import report

    plans = _plans(options)
    if options.dask is not None:
        reach(options.dask)  # first: the store may have all results, and --fresh forgets what it has
    _note_plans(plans, options)
    with Store(options.store or options.out / "store.sqlite") as store, provenance.without_notes():
        for plan in plans:
            _fill_store(plan, store, options, progress)
        return report.gather(plans, store)


def _note_plans(plans: Sequence[Plan], options: Options) -> None:
    """The set-ups of all cases are the campaign's scenario; its emulators draw theirs from them."""
    cases = {f"{c.study}, {c.name}": as_input(c.setup, c.hold) for p in plans for c in p.cases}
    provenance.note_digest("cases", options.seed, cases)
    if options.scenario is not None:
        provenance.note_file("scenario", options.scenario)
    if chains.CHAINS[plans[-1].chain].emulates:
        provenance.note_program("psa-emu", find_emulator())


def _plans(options: Options) -> list[Plan]:
    """The closed form beside another chain, then the chain that was asked for."""
    runs = DEFAULT_RUNS[options.chain] if options.runs is None else options.runs
    if not 1 <= runs <= MOST_RUNS:
        raise BadInput(expected(f"1 to {MOST_RUNS}", runs, "--runs"))
    if options.seed > MOST_SEED:
        raise BadInput(expected(f"0 to {MOST_SEED}", options.seed, "--seed"))
    if options.workers is not None and not 1 <= options.workers <= 1024:
        raise BadInput(expected("1 to 1024", options.workers, "--workers"))
    if options.workers is not None and options.dask is not None:
        raise BadInput(expected("none with --dask: the cluster has its own workers", options.workers, "--workers"))
    cases = _cases(options)
    plan = Plan(cases=cases, chain=options.chain, runs=runs, seed=options.seed)
    if options.chain == "closed":
        return [plan]
    return [replace(plan, chain="closed", runs=min(max(runs, REFERENCE_RUNS[0]), REFERENCE_RUNS[1])), plan]


def _cases(options: Options) -> list[Case]:
    emulates = chains.CHAINS[options.chain].emulates
    base = settings.base(options.settings, _base(options))
    usual = WIRE_STUDIES if emulates else DEFAULT_STUDIES
    usual = usual if options.scenario is None else ("own",)
    names = options.studies or (usual if options.case is None else tuple(STUDIES))
    for name in names:
        if name not in STUDIES:
            raise BadInput(expected(", ".join(STUDIES), name, "--study"))
    cases = [c for name in dict.fromkeys(names) for c in STUDIES[name].cases(base)]
    if options.case is not None:
        there = ", ".join(c.name for c in cases)
        cases = [c for c in cases if c.name == options.case]
        if not cases:
            raise BadInput(expected(there, options.case, "--case"))
    if emulates:
        from psabench.campaign import emulated

        for c in cases:
            if c.hold is not None:
                raise BadInput(expected(f"closed or samples for the hold of {c.name}", options.chain, "--chain"))
            emulated.params(c.setup)
    settings.rehearse(cases, options.settings)
    return cases


def _base(options: Options) -> Setup:
    """What --set changes: the article's error set, or that of a scenario."""
    if options.scenario is None:
        return Setup()
    if not chains.CHAINS[options.chain].emulates:
        raise BadInput(expected("--chain emulated or wire with --scenario", options.chain, "--chain"))
    if options.case is not None or any(name != "own" for name in options.studies):
        raise BadInput(expected("no --case, and no --study but own", options.scenario, "--scenario"))
    from psabench.campaign import emulated

    return emulated.setup_of(options.scenario)


def _fill_store(plan: Plan, store: Store, options: Options, progress: Progress) -> None:
    if options.fresh:
        for case in plan.cases:
            store.forget(plan.origin(case))
    _others(plan, store, options.forget_others)
    wanted = runner.missing(plan, store)
    if not wanted:
        return
    count = options.workers
    if count is None and options.dask is None and runner.duration_s(wanted) < runner.ALONE_S:
        count = 1  # done before a cluster would have started
    with workers(count, options.dask, plan.chain) as at_work:
        runner.run(wanted, store, at_work, progress)


def _others(plan: Plan, store: Store, forget: bool) -> None:
    """Report, on stderr, what other builds have computed of these cases, and remove it on request."""
    origins = {o.key: o for o in map(plan.origin, plan.cases)}.values()
    found = Counter[str]()
    for o in origins:
        found.update(store.others(o))
        if forget:
            store.forget_others(o)
    if found:
        told = ", ".join(f"{runs} by {builds.short(build)}" for build, runs in sorted(found.items()))
        what = "removed" if forget else "kept, not used; --forget-others removes them"
        mine = builds.short(chains.CHAINS[plan.chain].build())
        print(f"psabench: {store.path}: runs of other builds than {mine} ({told}) are {what}", file=sys.stderr)

"""`psabench campaign run-in`: options, what is computed, what is printed."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from psabench.errors import BadInput, expected
from psabench.options import KEPT, Parser, natural, of_fields, report_folder
from psabench.output import add_json, show_report
from psabench.report import provenance

if TYPE_CHECKING:
    from psabench.campaign.store import Store
    from psabench.native.quartz_model import Schedule
    from psabench.procedures.head_bench import Progress
    from psabench.quartz.plate import Array
    from psabench.quartz.run_in import Chain, RunIn
    from psabench.quartz.run_in_page import Report
    from psabench.quartz.run_in_wire import Agreement

    Measured = tuple[Array, Array]

ABOUT = """\
Run a production batch of quartz accelerometers in: thermal cycles from -60 to +85 °C after the article of Denisov and
Akilin, a start and readings in four positions after each. The report has the instability of bias, scale and base by
cycle (fig. 8), what run-in gains, when to stop, and how far a batch of 30 may mislead.
"""
EPILOG = """\
Units are drawn by the emulator's generator (docs/instruments.md); without --wire no board takes part. Estimates come
from readings with their noise; truth is used in the grading alone.

examples:
  psabench campaign run-in                                  1000 units; build/run-in/report.html
  psabench campaign run-in --units 100000 --workers 2       on two cores, the same numbers as on one
  psabench campaign run-in --wire 10                        ten of them over CAN and SCPI, compared start by start
  psabench campaign run-in --cycles 8                       is anything gained after the fourth?
  psabench campaign run-in --set soak_min=0 --set ramp_k_per_min=5   too fast: elements lag, and no cycle relaxes them
  psabench campaign run-in --batch mine.yaml --seed 7       your batch: the keys of proto/batches/serial.yaml
  psabench campaign run-in --dask tcp://192.0.2.7:8786      on the cluster of this scheduler

NAME=VALUE of --set, with the defaults:
{settings}

Results are in the store (docs/store.md): the same command computes only what is missing, Ctrl-C keeps what is done.
Exit status: 0 done and within limits, 1 done and out of limits, 2 bad input, 3 the cluster failed, 130 ended by Ctrl-C.
"""
MOST_UNITS, MOST_SEED = 1_000_000, 2**63 - 1
GRADED_UNITS = 2000  # of which truth is computed, too
LEAST_CYCLES, MOST_CYCLES = 5, 50  # the gain needs the fifth
# Of --set: the schedule's field, unit, least and greatest value, meaning. Kept here: NumPy is loaded when it runs.
SETTINGS: dict[str, tuple[float, str, float, float, str]] = {
    "cold_degc": (-60.0, "°C", -60.0, 20.0, "cold end of a cycle: the article"),
    "hot_degc": (85.0, "°C", 40.0, 85.0, "hot end: the article"),
    "read_degc": (30.0, "°C", -60.0, 85.0, "of the readings: the article's normal temperature"),
    "ramp_k_per_min": (1.0, "K/min", 0.1, 5.0, "of the chamber; cooling is limited to 3 (E0)"),
    "soak_min": (60.0, "min", 0.0, 1000.0, "at each end (E0)"),
    "rest_min": (120.0, "min", 0.0, 1000.0, "before a start (E0)"),
    "reading_s": (1.0, "s", 0.01, 1000.0, "reading of a position (E0)"),
    "play_k": (0.3, "K", 0.0, 100.0, "half the width of the hysteresis in temperature (E0)"),
    "noise_a_rthz": (4.0e-10, "A/√Hz", 1e-12, 1e-6, "white noise of the sensor, as in scenario quartz_chamber (E0)"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What the command line asked for."""

    units: int = 1000
    cycles: int = LEAST_CYCLES
    batch: str = "serial"
    seed: int = 1
    settings: Sequence[str] = ()  # NAME=VALUE
    wire: int = 0  # units that are measured again through the wire
    workers: int | None = None
    dask: str | None = None
    store: Path | None = None
    out: Path = Path("build/run-in")
    fresh: bool = False


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench campaign run-in`. Raises BadInput."""
    settings, usual = "\n".join(setting_lines()), Options()
    p = Parser(prog="psabench campaign run-in", description=ABOUT, epilog=EPILOG.format(settings=settings))
    p.set_defaults(handler=_run_command, kept=KEPT)
    p.add_argument("--units", type=natural, default=usual.units, help="units of the batch (%(default)s)")
    p.add_argument("--cycles", type=natural, default=usual.cycles, help="thermal cycles (%(default)s)")
    p.add_argument("--batch", default=usual.batch, metavar="NAME|FILE", help="production batch (%(default)s)")
    p.add_argument("--seed", type=natural, default=usual.seed, help="random seed (%(default)s)")
    text = "change the schedule; names below"
    p.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help=text)
    text = (
        "measure the first N units again through the wire, each on a fork of one bench; a second a unit (%(default)s)"
    )
    p.add_argument("--wire", type=natural, default=usual.wire, metavar="N", help=text)
    p.add_argument("--workers", type=natural, help="processes (one per core for long runs); 1: this process alone")
    p.add_argument(
        "--dask", metavar="ADDRESS", help="compute on the workers of this Dask scheduler, as tcp://192.0.2.7:8786"
    )
    p.add_argument("--store", type=Path, help="database of results (OUT/store.sqlite)")
    p.add_argument("--out", type=report_folder, default=usual.out, help="folder of the report (%(default)s)")
    p.add_argument("--fresh", action="store_true", help="compute stored results again")
    add_json(p)
    return p.parse_args(words)


def setting_lines() -> Sequence[str]:
    """Of --help: name, default, unit, meaning."""
    shown = {name: f"{name}={default:g}" for name, (default, *_) in SETTINGS.items()}
    width = max(map(len, shown.values()))
    return [f"  {shown[n]:{width}}  {unit}; {about}" for n, (_, unit, _, _, about) in SETTINGS.items()]


def _run_command(args: argparse.Namespace) -> int:
    from psabench.progress import Bar
    from psabench.quartz import run_in_page as page  # matplotlib takes a second

    found = run_campaign(of_fields(Options, args, settings=args.set), Bar())
    lines = [*page.console_lines(found), page.verdict_words(found)]
    show_report(args, lines, lambda: page.write_page(args.out, found))
    return 0 if found.within else 1


def run_campaign(o: Options, progress: Progress) -> Report:
    """Compute what is missing, and gather what a report shows. Ctrl-C keeps what has been computed.

    Raises BadInput for options that do not fit together, LinkError for a cluster that is not there.
    """
    from psabench.campaign.store import Store
    from psabench.campaign.workers import reach
    from psabench.quartz import run_in_page

    _check_options(o)
    what = _what_of(o)
    if o.dask is not None:
        reach(o.dask)  # first: the store may have all results, and --fresh forgets what it has
    provenance.note_digest("run-in", o.seed, run_in_page.origin_dict(what, o.units))
    with Store(o.store or o.out / "store.sqlite") as store, provenance.without_notes():
        return _gather_report(o, what, store, progress)


def _measure_units(o: Options, what: RunIn, chain: Chain, units: int, store: Store, progress: Progress) -> Measured:
    """Values and uncertainties of the first units, what is missing computed."""
    from psabench.campaign.workers import workers
    from psabench.quartz import run_in

    if o.fresh:
        store.forget(run_in.make_origin(what, chain))
    if wanted := run_in.list_missing(what, chain, units, store):
        count = o.workers
        if count is None and o.dask is None and chain.unit_s * units < run_in.ALONE_S:
            count = 1  # done before a cluster would have started
        with workers(count, o.dask, own=partial(run_in.name_build, chain)) as at_work:
            run_in.fill_store(wanted, store, at_work, progress)
    return run_in.load_rows(what, chain, store, units)


def _gather_report(o: Options, what: RunIn, store: Store, progress: Progress) -> Report:
    from psabench.quartz import run_in, run_in_figures, run_in_page

    values, uncertain = _measure_units(o, what, run_in.MODEL, o.units, store, progress)
    graded = min(o.units, GRADED_UNITS)
    found = run_in_figures.find_figures(values, what.batch, o.seed)
    grades = run_in_figures.grade_values(values[:graded], uncertain[:graded], run_in.true_values(what, graded))
    agreements = _compare_wire(o, what, store, progress) if o.wire else []
    usual = o.batch == Options().batch and not o.settings
    checks = run_in_figures.limit_checks(found, grades, o.units) if usual else []
    return run_in_page.Report(
        what=what,
        batch_name=o.batch,
        units=o.units,
        figures=found,
        grades=grades,
        graded_units=graded,
        wire_units=o.wire,
        agreements=agreements,
        checks=[*checks, *run_in_figures.wire_checks(agreements)],
        code=run_in.name_build(run_in.MODEL),
    )


def _compare_wire(o: Options, what: RunIn, store: Store, progress: Progress) -> Sequence[Agreement]:
    """The first units again through the wire, beside the model."""
    from psabench.quartz import run_in, run_in_wire

    model = _measure_units(o, what, run_in.MODEL, o.wire, store, progress)
    return run_in_wire.compare_changes(_measure_units(o, what, run_in_wire.WIRE, o.wire, store, progress), model)


# ---- options


def _check_options(o: Options) -> None:
    rows = (
        ("--units", o.units, 2, MOST_UNITS),
        ("--wire", o.wire, 0, min(o.units, 1000)),
        ("--cycles", o.cycles, LEAST_CYCLES, MOST_CYCLES),
        ("--seed", o.seed, 0, MOST_SEED),
        ("--workers", 1 if o.workers is None else o.workers, 1, 1024),
    )
    for where, value, low, high in rows:
        if not low <= value <= high:
            raise BadInput(expected(f"{low} to {high}", value, where))
    if o.workers is not None and o.dask is not None:
        raise BadInput(expected("none with --dask: the cluster has its own workers", o.workers, "--workers"))


def _what_of(o: Options) -> RunIn:
    from psabench.native.quartz_model import Schedule
    from psabench.quartz.batch import load_batch
    from psabench.quartz.run_in import RunIn

    schedule = change_schedule(Schedule(cycles=o.cycles), o.settings)
    return RunIn(schedule=schedule, batch=load_batch(o.batch), seed=o.seed)


def change_schedule(s: Schedule, words: Sequence[str]) -> Schedule:
    """With NAME=VALUE of a command line. Raises BadInput."""
    for word in words:
        name, _, text = word.partition("=")
        if name not in SETTINGS:
            raise BadInput(expected(f"NAME=VALUE with a name of {', '.join(SETTINGS)}", repr(word), "--set"))
        _, unit, low, high, _ = SETTINGS[name]
        try:
            value = float(text)
        except ValueError:
            raise BadInput(expected("a number", repr(text), f"--set {word}")) from None
        if not low <= value <= high:
            raise BadInput(expected(f"{low:g} to {high:g} {unit}", text, f"--set {word}"))
        s = replace(s, **{name: value})  # type: ignore[arg-type]
    return s

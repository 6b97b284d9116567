"""What each procedure of `psabench run` does with its options: run, write the report, print the verdict.

Returns the exit status.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from psabench.errors import BadInput, expected
from psabench.options import given_parameters, of_fields, refuse_beside
from psabench.output import show_report
from psabench.procedures.command_line.offered import ALL, CONDITIONS
from psabench.progress import Bar

if TYPE_CHECKING:
    from pathlib import Path

    from psabench.estimate.uncertainty import Estimate
    from psabench.procedures.head_bench import Progress
    from psabench.procedures.run import RunOptions
    from psabench.report.grading import Section


def run_on_head(args: argparse.Namespace) -> int:
    from psabench.procedures import run
    from psabench.procedures.registry import PROCEDURES
    from psabench.report import calibration as report
    from psabench.report import grading
    from psabench.report.nominal import console_nominal

    options = of_fields(
        run.RunOptions,
        args,
        procedures=list(PROCEDURES) if args.procedure == ALL else [args.procedure],
        conditions=list(CONDITIONS) if args.condition == "both" else [args.condition],
        g_mps2=args.gravity,
        params=given_parameters(args),
    )
    ways = [way for way in ("climate", "batch") if getattr(args, way, False)]
    if len(ways) > 1:
        raise BadInput(expected("one of --climate and --batch", "both", args.procedure))
    if "batch" in ways:
        return _run_batch(args, options)
    if "climate" in ways:
        return _run_in_climate(args, options)
    with progress_of(args) as followers:
        page, sections, nominal = run.run(options, followers.progress)
        followers.show_sections(sections)
    tables = [*map(report.console_table, sections), *console_nominal(sections, nominal).splitlines()]
    show_report(args, [*(tables if args.verbose else ()), grading.verdict(sections)], lambda: page)
    return 0 if report.within_limits(sections) else 1


def _run_in_climate(args: argparse.Namespace, options: RunOptions) -> int:
    from psabench.climate import sensors
    from psabench.report import grading

    with progress_of(args) as followers:
        r = sensors.run_climate(options, followers.progress)
        followers.show_sections(r.sections)
    tables = [grading.console_table(s) for s in r.sections] if args.verbose else []
    verdicts = [grading.verdict(r.sections), sensors.verdict_of_slopes(r)]
    show_report(args, [*tables, sensors.console_table(r), *verdicts], lambda: r.page)
    return 0 if r.within else 1


def _run_batch(args: argparse.Namespace, options: RunOptions) -> int:
    from psabench.batch import run as batch
    from psabench.report import grading

    with progress_of(args) as followers:
        r = batch.run_batch(options, followers.progress)
        sections = list(r.sections.values())
        followers.show_sections(sections)
    tables = [grading.console_table(s) for s in sections] if args.verbose else []
    ends = [batch.console_table(r), grading.verdict(sections), f"passports: {r.store}"]
    show_report(args, [*tables, *ends], lambda: r.page)
    return 0 if r.within else 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Followers:
    """Of a run: each step, each result."""

    progress: Progress
    result: Callable[[str, str, Sequence[Estimate], bool], None]

    def show_sections(self, sections: Sequence[Section]) -> None:
        """Results of a calibration, each with whether it is within its limits."""
        from psabench.report import grading

        for s in sections:
            self.result(s.result.procedure, s.label, s.result.estimates, grading.within_limits([s]))


@contextmanager
def progress_of(args: argparse.Namespace) -> Iterator[Followers]:
    """A bar, and LCM where --lcm asks for it."""
    if args.lcm is None:
        yield Followers(progress=Bar(), result=lambda *_: None)
        return
    from psabench.lcm.channel import publisher
    from psabench.lcm.progress import LcmProgress, publish_result

    with publisher(args.lcm) as out:
        yield Followers(progress=LcmProgress(out, args.procedure, Bar()), result=partial(publish_result, out))


def _show_end(args: argparse.Namespace, table: Callable[[], str], verdict: str, page: Path, *, within: bool) -> int:
    """What a run prints last; returns the exit status."""
    show_report(args, [*([table()] if args.verbose else []), verdict], lambda: page)
    return 0 if within else 1


def compare_units(args: argparse.Namespace) -> int:
    """Its units stand on one bench, their motion in the scenario: it starts an emulator and takes no addresses."""
    from psabench.logs.call_log import refuse_beside_replay
    from psabench.procedures import compare_converters, comparison
    from psabench.report import comparison_page

    if args.chamber:
        return _compare_in_chamber(args)
    p = compare_converters.CompareParams()
    if args.replay:
        refuse_beside_replay({"--record": args.record, "--scenario": args.scenario, "--seed": args.seed})
        c = comparison.replay_comparison(args.out, p, Bar(), args.replay)
    else:
        c = comparison.compare(args.out, p, Bar(), scenario=args.scenario, seed=args.seed, record=args.record)
    page = comparison_page.write(args.out, c)
    return _show_end(args, lambda: comparison.console_table(c), comparison.verdict(c), page, within=c.within)


def _compare_in_chamber(args: argparse.Namespace) -> int:
    from psabench.climate import converters_page, converters_result
    from psabench.climate.converters import ChamberParams

    # table, chamber and supply are not in a recording
    refuse_beside("--chamber", {"--record": args.record, "--replay": args.replay}, "compare-converters")
    c = converters_result.compare_in_chamber(args.out, ChamberParams(), Bar(), scenario=args.scenario, seed=args.seed)
    page = converters_page.write_page(args.out, c)
    verdict = converters_result.verdict_of_drifts(c)
    return _show_end(args, lambda: converters_result.console_table(c), verdict, page, within=c.within)


def run_on_platform(args: argparse.Namespace) -> int:
    """Its platform is a unit on the bus: no dividing head, no volts to average."""
    from psabench.procedures import gyro_run
    from psabench.report import gyro_grading, gyro_page

    options = of_fields(gyro_run.GyroOptions, args, params=given_parameters(args))
    with progress_of(args) as followers:
        sections = gyro_run.run(options, followers.progress)
        for s in sections:
            followers.result(options.procedure, s.label, s.result.estimates, gyro_grading.within_limits([s]))
    page = gyro_page.write(args.out, sections, gyro_run.facts(options))
    doubts = [f"DOUBT: {s.label}: {d}" for s in sections for d in gyro_grading.doubts(s)]
    lines = [gyro_grading.console_table(s) for s in sections] if args.verbose else doubts
    show_report(args, [*lines, gyro_grading.verdict(sections)], lambda: page)
    return 0 if gyro_grading.within_limits(sections) else 1


def run_in_chamber(args: argparse.Namespace) -> int:
    """Hours in a chamber: what it records is kept as it comes, and it can be resumed."""
    from psabench.report import thermal_grading, thermal_page
    from psabench.thermal import run as thermal_run

    options = of_fields(thermal_run.ThermalOptions, args, params=given_parameters(args))
    with thermal_run.run_thermal(options, Bar()) as done:
        truth = thermal_grading.read_truth(done.folder, done.result.recordings)
        report = thermal_grading.graded_report(done.result, truth, done.facts)
        page = thermal_page.write_page(done.folder.path, report)
    verdict, within = thermal_grading.state_verdict(report), thermal_grading.within_limits(report)
    return _show_end(args, lambda: thermal_grading.console_lines(report), verdict, page, within=within)


def calibrate_sins(args: argparse.Namespace) -> int:
    """Minutes on a table through the wire, or a recording of them."""
    from psabench.report.grading import aligned
    from psabench.sins import calibration_page
    from psabench.sins.calibration_params import SinsOptions
    from psabench.sins.calibration_run import run_calibration

    options = of_fields(SinsOptions, args, params=given_parameters(args))
    to = sys.stderr if args.json else sys.stdout
    done = run_calibration(
        options, Bar(), lambda lines: print(*lines, sep="\n", file=to, flush=True) if lines else None
    )
    page = calibration_page.write_page(args.out, done)
    verdict = "\n".join([*(f"DOUBT: {d}" for d in done.result.doubts), calibration_page.verdict_words(done)])
    rows = calibration_page.table_rows(done)
    return _show_end(args, lambda: "\n".join(aligned(rows)), verdict, page, within=done.within)


def calibrate_gyro(args: argparse.Namespace) -> int:
    """A gyro of volts on a rate table."""
    from psabench.mems_gyro import page as gyro_page
    from psabench.mems_gyro.params import MemsGyroOptions
    from psabench.mems_gyro.run import run_gyro, verdict_words
    from psabench.report.grading import aligned

    done = run_gyro(of_fields(MemsGyroOptions, args, params=given_parameters(args)), Bar())
    page = gyro_page.write_page(args.out, done)
    verdict = "\n".join([*(f"DOUBT: {d}" for d in done.result.doubts), verdict_words(done)])
    rows = gyro_page.table_rows(done)
    return _show_end(args, lambda: "\n".join(aligned(rows)), verdict, page, within=done.within)


def predict_sins(args: argparse.Namespace) -> int:
    """A covariance: no bench, no data."""
    from psabench.procedures.result import made_params
    from psabench.sins import covariance_run

    study = covariance_run.run_study(
        made_params(covariance_run.CovarianceParams, args.procedure, given_parameters(args))
    )
    show_report(args, [covariance_run.console_lines(study)], lambda: covariance_run.write_page(args.out, study))
    return 0


def fly_snake(args: argparse.Namespace) -> int:
    from psabench.procedures.result import made_params
    from psabench.sins import snake, snake_page

    found = snake.run_snake(made_params(snake.SnakeParams, snake.NAME, given_parameters(args)))
    lines = [*snake_page.console_lines(found), snake_page.verdict_words(found)]
    show_report(args, lines, lambda: snake_page.write_page(args.out, found))
    return 1 if found.within is False else 0


def calibrate_secondary(args: argparse.Namespace) -> int:
    """From recordings, or a unit on a bench that navigates by itself."""
    from psabench.procedures.result import made_params
    from psabench.sins.secondary import page as secondary_page
    from psabench.sins.secondary import run as secondary_run

    params = made_params(secondary_run.SecondaryParams, secondary_run.NAME, given_parameters(args))
    found = secondary_run.run_secondary(params, of_fields(secondary_run.SecondaryOptions, args), Bar())
    lines = [*secondary_page.console_lines(found), secondary_page.verdict_words(found)]
    show_report(args, lines, lambda: secondary_page.write_page(args.out, found))
    return 1 if found.within is False else 0


def fly_koi(args: argparse.Namespace) -> int:
    """A flight through the wire, or its recording."""
    from psabench.koi.wire import page as flight_page
    from psabench.koi.wire.params import KoiOptions
    from psabench.koi.wire.run import run_flight

    done = run_flight(of_fields(KoiOptions, args, params=given_parameters(args)), Bar())
    page = flight_page.write_page(args.out, done)
    show_report(args, flight_page.console_lines(done, verbose=args.verbose), lambda: page)
    return 1 if done.found.verdict else 0


def fly_season(args: argparse.Namespace) -> int:
    """Flights until so many are complete; the passport is in --store."""
    from psabench.koi.wire import season_page
    from psabench.koi.wire.season import SeasonOptions, run_season

    season = run_season(of_fields(SeasonOptions, args, params=given_parameters(args)), Bar())
    page = season_page.write_page(args.out, season)
    show_report(args, season_page.console_lines(season), lambda: page)
    return 0

"""`psabench campaign heading-modes`: options, what is computed, what is printed."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

from psabench.errors import BadInput, expected
from psabench.options import Parser, add_parameter, given_parameters, natural, report_folder
from psabench.output import add_json, show_report

if TYPE_CHECKING:
    from psabench.procedures.heading_modes import ModeParams
    from psabench.procedures.platform_bench import Floats

ABOUT = """\
Fly a heading indicator for hours in three modes: magnetic (aligned and slaved by an induction sensor), half-compass
(aligned by it, then the gyroscope and a latitude panel) and self-orienting (gyrocompassing, then the gyroscope). Many
instruments, the same in each mode; the table shows the errors with intervals beside the article's 0.3 deg in 4 h.
"""
EPILOG = """\
docs/procedures/heading_modes.md derives the errors and says which figures are assumptions.

examples:
  psabench campaign heading-modes                                  200 instruments by the algebra
  psabench campaign heading-modes --chain emulated --runs 2        two of them through an emulator, minutes

Exit status: 0 done, 2 bad input, 3 an emulated run failed, 130 ended by Ctrl-C.
"""
CHAINS = ("algebra", "emulated")
MOST_RUNS, MOST_SEED = 100_000, 2**31
RUNS, SEED, HOURS, OUT = 200, 1, 4.0, Path("build/heading-modes")
# Of ModeParams: what does not belong to the shipped scenario, which has the place, its field and the drift.
OFFERED = ("speed_kmh", "fix_s", "panel_step_deg", "setter_step_deg", "align_s", "slave_s", "slave_limit_dpm")
LEAST_H, MOST_H = 0.2, 5.5  # beyond it the flight comes near the pole


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench campaign heading-modes`. Raises BadInput."""
    p = Parser(prog="psabench campaign heading-modes", description=ABOUT, epilog=EPILOG)
    p.set_defaults(handler=_run_command)
    p.add_argument("--runs", type=natural, default=RUNS, help="instruments to draw (%(default)s)")
    p.add_argument("--seed", type=natural, default=SEED, help="random seed (%(default)s)")
    p.add_argument("--hours", type=float, default=HOURS, help="time of the flight, h (%(default)s)")
    p.add_argument("--chain", choices=CHAINS, default=CHAINS[0], help="how a run is computed (%(default)s)")
    p.add_argument("--out", type=report_folder, default=OUT, help="folder of the report (%(default)s)")
    add_json(p)
    _add_parameters(p)
    return p.parse_args(words)


def _add_parameters(p: Parser) -> None:
    from psabench.procedures.heading_modes import ModeParams

    group = p.add_argument_group("the flight and the crew")
    of = {f.name: f for f in fields(ModeParams)}
    for name in OFFERED:
        add_parameter(group, name, of[name], {})


def _run_command(args: argparse.Namespace) -> int:
    from psabench.campaign import heading_modes_page as page
    from psabench.campaign.heading_modes import ROWS
    from psabench.procedures.heading_modes import ModeParams
    from psabench.procedures.result import made_params
    from psabench.report import provenance

    _check_limits(args)
    p = made_params(ModeParams, page.NAME, {"hours": args.hours, **given_parameters(args)})
    facts = {"runs": args.runs, "seed": args.seed, "hours": args.hours, "chain": args.chain, **given_parameters(args)}
    provenance.note_digest(page.NAME, args.seed, facts)
    fly = _emulated_flight(args) if args.chain == "emulated" else _algebra_flight(args)
    errors = {name: fly(name, p) for name in ROWS}
    timed = {name: (page.look_hours(p, e.shape[1]), e) for name, e in errors.items()}
    found = {name: page.summary_of(e, args.seed) for name, e in errors.items()}
    report = page.write_page(args.out, timed, found, facts)
    show_report(args, page.console_lines(found), lambda: report)
    return 0


def _check_limits(args: argparse.Namespace) -> None:
    limits = (
        ("--runs", args.runs, 1, MOST_RUNS),
        ("--seed", args.seed, 0, MOST_SEED),
        ("--hours", args.hours, LEAST_H, MOST_H),
    )
    for option, value, low, high in limits:
        if not low <= value <= high:
            raise BadInput(expected(f"{low:g} to {high:g}", value, option))


Flight = Callable[[str, "ModeParams"], "Floats"]  # of a row's name and the flight: (runs, looks), deg


def _algebra_flight(args: argparse.Namespace) -> Flight:
    from psabench.campaign.heading_modes import ROWS, errors_deg

    return lambda name, p: errors_deg(ROWS[name], p, args.seed, args.runs)


def _emulated_flight(args: argparse.Namespace) -> Flight:
    import numpy as np

    from psabench.campaign.heading_modes import ROWS
    from psabench.campaign.heading_modes_emulated import fly_run
    from psabench.progress import Bar

    bar = Bar()

    def flown(name: str, p: ModeParams) -> Floats:
        with bar.step(name, args.runs) as done:
            rows = []
            for run in range(args.runs):
                rows.append(fly_run(ROWS[name], p, args.seed, run).error_deg)
                done()
        return np.array(rows)

    return flown

"""`psabench campaign sins-secondary`: draws units, writes recordings of their outputs, calibrates and compensates."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from psabench.errors import BadInput, expected
from psabench.options import Parser, natural, report_folder
from psabench.output import add_json, show_data

if TYPE_CHECKING:
    from psabench.campaign.sins_unit import Experiment

ABOUT = """\
Draw strapdown units with sensor errors, let each navigate itself on a rate table in two experiments, calibrate it from
the first one's outputs and compensate the second. The outputs of the first unit are written as recordings that
psabench run sins-calibration-secondary takes.
"""
EPILOG = """\
An experiment is a YAML file (proto/sins_experiments): place, plan of rotations, standard deviations of the errors,
repeatability.

examples:
  psabench campaign sins-secondary                                 the article's two experiments, in build/sins
  psabench campaign sins-secondary --pairs 12 --repeatability 0.2  another change between both experiments
  psabench campaign sins-secondary --experiment mine.yaml --out build/mine

Exit status: 0 done, 2 bad input, 130 ended by Ctrl-C.
"""
MOST = 100_000


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench campaign sins-secondary`. Raises BadInput."""
    p = Parser(prog="psabench campaign sins-secondary", description=ABOUT, epilog=EPILOG)
    p.set_defaults(handler=_run_command)
    p.add_argument("--experiment", default="article", metavar="NAME|FILE", help="article, or a YAML file (%(default)s)")
    p.add_argument("--pairs", type=natural, default=1, help="units, two experiments each (%(default)s)")
    text = "change between both experiments, of an error's standard deviation (the experiment's)"
    p.add_argument("--repeatability", type=float, metavar="X", help=text)
    p.add_argument("--seed", type=natural, help="random seed (the experiment's)")
    p.add_argument(
        "--out", type=report_folder, default=Path("build/sins"), help="folder of recordings and report (%(default)s)"
    )
    add_json(p)
    return p.parse_args(words)


def _run_command(args: argparse.Namespace) -> int:
    from psabench.campaign import sins_pairs
    from psabench.progress import Bar
    from psabench.report.grading import aligned

    e = _chosen_experiment(args)
    pairs = sins_pairs.run_pairs(e, args.pairs, Bar())
    paths = [str(path) for path in _write_recordings(args.out, e)]
    rows = [{**asdict(pair), "factor": pair.factor} for pair in pairs]
    show_data(
        args,
        {"recordings": paths, "repeatability": e.repeatability, "seed": e.seed, "pairs": rows},
        [
            *(f"recording: {path}" for path in paths),
            *aligned(sins_pairs.pair_table(pairs)),
            sins_pairs.pair_words(pairs, e.repeatability),
        ],
    )
    return 0


def _chosen_experiment(args: argparse.Namespace) -> Experiment:
    from psabench.campaign.sins_unit import LIMITS, read_experiment

    if not 1 <= args.pairs <= MOST:
        raise BadInput(expected(f"1 to {MOST}", args.pairs, "--pairs"))
    e = read_experiment(args.experiment)
    for name in ("repeatability", "seed"):
        value = getattr(args, name)
        if value is None:
            continue
        low, high = LIMITS[name]
        if not low <= value <= high:
            raise BadInput(expected(f"{low:g} to {high:g}", value, f"--{name}"))
        e = replace(e, **{name: value})
    return e


def _write_recordings(folder: Path, e: Experiment) -> list[Path]:
    """Recordings of the first unit."""
    from psabench.campaign.sins_pairs import run_pair
    from psabench.sins.secondary.outputs import write_outputs

    folder.mkdir(parents=True, exist_ok=True)
    first, second, _ = run_pair(e, 0)
    recordings = {folder / "first.csv": first, folder / "second.csv": second}
    for path, outputs in recordings.items():
        write_outputs(path, outputs)
    return list(recordings)

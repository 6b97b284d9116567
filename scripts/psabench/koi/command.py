"""`psabench koi`: what is done with recorded flights of a unit with a satellite receiver."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from psabench.options import Parser, yes_no
from psabench.output import add_json, show_data
from psabench.progress import Bar

EPILOG = """\
FOLDER is OUT of `psabench run koi-flight`, or a flight-NNN of `run koi-season`, with the emulator's truth.jsonl in it.
PASSPORT@N: what the unit's passport knows after its N-th complete flight; PASSPORT: after all.

examples:
  psabench koi replay build/season/flight-* --with-estimates build/passports.sqlite@4 --unit SP-1

Exit status: 0 done; 2 bad input.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench koi`. Raises BadInput."""
    p = Parser(prog="psabench koi", description="Recorded flights with a satellite receiver.", epilog=EPILOG)
    commands = p.add_subparsers(required=True, metavar="COMMAND")
    text = "fly recorded flights again, without and with a passport's estimates"
    made = commands.add_parser("replay", help=text, description=f"{text.capitalize()}.", epilog=EPILOG)
    made.set_defaults(handler=_replay_recordings)
    made.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    made.add_argument("--with-estimates", required=True, metavar="PASSPORT[@N]", help="store of passports")
    made.add_argument("--unit", default="SP-1", metavar="SERIAL", help="serial number in it (%(default)s)")
    made.add_argument("--unit-class", default="bins", metavar="CLASS", help="good or bins (%(default)s)")
    made.add_argument("--align-s", type=float, default=600.0, metavar="S", help="alignment, parked (%(default)g s)")
    made.add_argument(
        "--corrects", type=yes_no, default=False, metavar="YES|NO", help="correct at take-off as well (no)"
    )
    add_json(made)
    return p.parse_args(words)


def _replay_recordings(args: argparse.Namespace) -> int:
    from psabench.koi.wire.params import KoiParams
    from psabench.koi.wire.replay import read_estimates, replay_flights, replay_lines
    from psabench.procedures.result import made_params

    given = {"unit_class": args.unit_class, "align_s": args.align_s, "corrects": args.corrects}
    p = made_params(KoiParams, "koi replay", given)
    known = read_estimates(args.with_estimates, args.unit, p)
    rows = list(replay_flights(args.folders, known, p, Bar()))
    show_data(args, [{**asdict(row), "folder": str(row.folder)} for row in rows], replay_lines(rows))
    return 0

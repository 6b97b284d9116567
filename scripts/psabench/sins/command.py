"""`psabench nav`: what is done with a calibration of an inertial unit."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from psabench.options import Parser
from psabench.output import add_json, show_data

if TYPE_CHECKING:
    from psabench.sins.increments import Increments

EPILOG = """\
CALIBRATION is a report's result.json with a correction in it, or the correction alone. RECORDING is a file of
increments or rates: .csv, .mcap, .mf4, or raw numbers; LAYOUT says in YAML what its columns are
(docs/procedures/sins_data.md).

examples:
  psabench nav apply run.csv --calibration build/run/result.json --out corrected.csv
  psabench nav apply imu.bin --layout layout.yaml --calibration unit.json --out corrected.csv
  psabench nav header build/run/result.json --name unit7 --out unit7.h
  psabench nav check imu.bin --layout layout.yaml

Exit status: 0 done, for check: nothing found; 1 check found something; 2 bad input.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench nav`. Raises BadInput."""
    p = Parser(prog="psabench nav", description="Corrections of an inertial unit: apply, export.", epilog=EPILOG)
    commands = p.add_subparsers(required=True, metavar="COMMAND")
    apply = _add_subcommand(commands, "apply", "take a unit's errors out of a recording", _apply)
    _add_recording(apply)
    apply.add_argument("--calibration", type=Path, required=True, metavar="FILE", help="result.json with a correction")
    apply.add_argument("--out", type=Path, required=True, metavar="FILE", help="increments as CSV")
    add_json(apply)
    check = _add_subcommand(commands, "check", "look for what is wrong with a recording", _check)
    _add_recording(check)
    add_json(check)
    header = _add_subcommand(commands, "header", "write a correction as a C header", _write_header)
    header.add_argument("calibration", type=Path, metavar="CALIBRATION")
    header.add_argument("--name", default="unit", metavar="NAME", help="that names in C begin with (%(default)s)")
    header.add_argument("--out", type=Path, metavar="FILE", help="in place of the terminal")
    return p.parse_args(words)


def _add_recording(p: argparse.ArgumentParser) -> None:
    p.add_argument("recording", type=Path, metavar="RECORDING")
    p.add_argument("--layout", type=Path, metavar="FILE", help="what its columns are; default: what `apply` writes")


def _add_subcommand(commands: argparse._SubParsersAction[Parser], name: str, text: str, handler: object) -> Parser:
    made = commands.add_parser(name, help=text, description=f"{text.capitalize()}.", epilog=EPILOG)
    made.set_defaults(handler=handler)
    return made


def _apply(args: argparse.Namespace) -> int:
    from psabench.sins.correction import read_correction
    from psabench.sins.readers import write_csv

    correction = read_correction(args.calibration)
    corrected = correction.apply(_read(args))
    write_csv(args.out, corrected)
    data = {"file": str(args.out), "intervals": len(corrected), "interval_s": corrected.dt_s}
    show_data(args, data, [f"{args.out}: {len(corrected)} intervals of {corrected.dt_s:g} s"])
    return 0


def _check(args: argparse.Namespace) -> int:
    from psabench.sins.data_check import findings

    data = _read(args)
    found = findings(data)
    show_data(
        args,
        {"file": str(args.recording), "intervals": len(data), "interval_s": data.dt_s, "findings": found},
        [
            f"{args.recording}: {len(data)} intervals of {data.dt_s:g} s, {len(found)} findings",
            *(f"  {f}" for f in found),
        ],
    )
    return 1 if found else 0


def _read(args: argparse.Namespace) -> Increments:
    from psabench.sins.layout import read_layout
    from psabench.sins.readers import read_increments

    return read_increments(args.recording, read_layout(args.layout) if args.layout else None)


def _write_header(args: argparse.Namespace) -> int:
    from psabench.link.own import replace_file
    from psabench.sins.correction import c_header, read_correction

    text = c_header(read_correction(args.calibration), args.name)
    if args.out is None:
        print(text, end="")
        return 0
    replace_file(args.out, text)
    print(args.out)
    return 0

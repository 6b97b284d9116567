"""`psabench passport`: its options, and what is printed."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from psabench.options import Parser
from psabench.output import add_json, print_json, show_data

STORE = Path("build/passports.sqlite")

EPILOG = """\
A unit is known by its serial number. `add` enters the sections of a calibration's result.json, a run of the unit each;
a run of the same method that began later supersedes the one before, which stays. What is there already is not entered
twice. `header` is for runs with curves against temperature, as of `psabench run thermal`.

examples:
  psabench run turns --out build/a
  psabench passport add build/a --serial QA-0001 --type mems
  psabench passport list
  psabench passport show QA-0001 --all       with the runs that are superseded
  psabench passport diff QA-0001@1 QA-0001   the first run, and the last of the same method
  psabench passport export QA-0001 --out qa-0001.json

Exit status: 0 done, for diff: the same; 1 diff: they differ; 2 bad input, 3 the store cannot be written.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench passport`. Raises BadInput."""
    p = Parser(prog="psabench passport", description="Passports of instruments, in one SQLite file.", epilog=EPILOG)
    commands = p.add_subparsers(required=True, metavar="COMMAND")
    add = _add_subcommand(commands, "add", "enter the results of a calibration", _add_results)
    add.add_argument("result", type=Path, metavar="RESULT", help="folder of a report, or its result.json")
    add.add_argument("--serial", required=True, metavar="SERIAL", help="of the unit; made where it is new")
    add.add_argument("--type", required=True, metavar="TYPE", help="of the unit: mems, quartz, ...")
    add_json(add)
    add_json(_add_subcommand(commands, "list", "list the units", _list_units))
    show = _add_subcommand(commands, "show", "show what is valid of a unit", _show_unit)
    show.add_argument("serial", metavar="SERIAL")
    show.add_argument("--all", action="store_true", help="show the runs that are superseded as well")
    add_json(show)
    export = _add_subcommand(commands, "export", "write a passport as JSON (proto/passport.schema.json)", _export_unit)
    export.add_argument("serial", metavar="SERIAL")
    export.add_argument("--out", type=Path, metavar="FILE", help="in place of the terminal")
    diff = _add_subcommand(commands, "diff", "compare two runs", _compare_runs)
    diff.add_argument("a", metavar="A", help="SERIAL@NUMBER of a run; SERIAL: its latest one")
    diff.add_argument("b", metavar="B", help="the other one; SERIAL: its latest of the same method")
    add_json(diff)
    header = _add_subcommand(commands, "header", "write a compensation as a C header in integers", _write_header)
    header.add_argument("serial", metavar="SERIAL[@NUMBER]")
    header.add_argument("--quantity", required=True, metavar="NAME", help="that was fitted against temperature")
    header.add_argument("--step", required=True, type=float, metavar="STEP", help="of the result, the quantity's unit")
    header.add_argument("--name", metavar="NAME", help="of the C function (the quantity's)")
    header.add_argument("--out", type=Path, metavar="FILE", help="in place of the terminal")
    return p.parse_args(words)


def _add_subcommand(commands: argparse._SubParsersAction[Parser], name: str, text: str, handler: object) -> Parser:
    made = commands.add_parser(name, help=text, description=f"{text.capitalize()}.", epilog=EPILOG)
    made.set_defaults(handler=handler)
    made.add_argument("--store", type=Path, default=STORE, metavar="FILE", help="(%(default)s)")
    return made


def _add_results(args: argparse.Namespace) -> int:
    from psabench.passport.entry import runs_of_result
    from psabench.passport.store import PassportStore

    runs = runs_of_result(args.result)
    with PassportStore(args.store) as store:
        entered = [
            {
                "serial": args.serial,
                "run": store.put_run(args.serial, args.type, run),
                "method": run.method,
                "quantities": len(run.quantities),
            }
            for run in runs
        ]
    show_data(args, entered, ("{serial}: run {run}, {method}, {quantities} quantities".format(**e) for e in entered))
    return 0


def _list_units(args: argparse.Namespace) -> int:
    from psabench.passport.document import list_lines, passport_dict
    from psabench.passport.store import PassportStore

    with PassportStore(args.store, read_only=True) as store:
        units = [store.read_passport(serial) for serial in store.unit_serials()]
    show_data(args, [passport_dict(unit) for unit in units], list_lines(units))
    return 0


def _show_unit(args: argparse.Namespace) -> int:
    from psabench.passport.document import passport_dict, passport_lines
    from psabench.passport.store import PassportStore

    with PassportStore(args.store, read_only=True) as store:
        unit = store.read_passport(args.serial)
    if args.json:
        print_json(passport_dict(unit if args.all else replace(unit, runs=unit.current_runs())))
    else:
        print("\n".join(passport_lines(unit, history=args.all)))
    return 0


def _export_unit(args: argparse.Namespace) -> int:
    from psabench.passport.document import passport_dict
    from psabench.passport.store import PassportStore

    with PassportStore(args.store, read_only=True) as store:
        made = passport_dict(store.read_passport(args.serial))
    return _write_text(json.dumps(made, indent=1, ensure_ascii=False) + "\n", args.out)


def _compare_runs(args: argparse.Namespace) -> int:
    from psabench.passport.document import comparable_dict
    from psabench.passport.store import PassportStore, find_run
    from psabench.report import diff

    with PassportStore(args.store, read_only=True) as store:
        a = find_run(store, args.a)
        b = find_run(store, args.b, lambda run: run.method == a.method, f"a run of {a.method}")
    found = diff.compare_results(comparable_dict(a), comparable_dict(b))
    show_data(args, diff.diff_dict(found), diff.diff_lines(found))
    return 0 if found.same else 1


def _write_header(args: argparse.Namespace) -> int:
    from psabench.errors import BadInput, expected
    from psabench.passport.store import PassportStore, find_run
    from psabench.thermal.fixed_point import c_header, fixed_point

    with PassportStore(args.store, read_only=True) as store:
        run = find_run(
            store,
            args.serial,
            lambda run: args.quantity in run.curves,
            f"a run with a curve of {args.quantity}",
        )
    if args.quantity not in run.curves:
        known = ", ".join(run.curves) or "a run with a curve"
        raise BadInput(expected(known, args.quantity, f"{args.serial}: run {run.number}"))
    made = fixed_point(run.curves[args.quantity], args.step)
    return _write_text(c_header(made, args.name or args.quantity), args.out)


def _write_text(text: str, path: Path | None) -> int:
    """To a file, whole or not at all, or to the terminal."""
    from psabench.link.own import replace_file

    if path is None:
        print(text, end="")
    else:
        replace_file(path, text)
        print(path)
    return 0

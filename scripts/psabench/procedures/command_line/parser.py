"""`psabench run`: a parser for each procedure with its own options, and what is printed.

`run turns` is one command of two words (`words`): each procedure has its own help, and rejects the options of others.
"""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Sequence
from typing import Any

from psabench.errors import BadInput, expected
from psabench.options import Parser, add_parameter, did_you_mean, option_name
from psabench.output import add_json, show_data
from psabench.procedures.command_line.bench_options import EVERY
from psabench.procedures.command_line.commands import COMMANDS, Command
from psabench.shell import command_line

EPILOG = """\
psabench run PROCEDURE --help lists its options with units and defaults, and examples.

Exit status: 0 done and within limits, 1 a result is off by more than its limits or is doubtful,
2 bad input, 3 the bench or a link failed, 130 ended by Ctrl-C.
"""

SCRIPT = "script"  # psabench.shell.command_line has its parser
BENCH_THERE = ("can", "control", "head", "replay")  # options with which no emulator is started
# The options that take no value.
FLAGS = ("-h", "--help", "--list", "--real-time", "--fresh", "--json", "-v", "--verbose")


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench run`. Raises BadInput."""
    name, rest = words(argv)
    if name == SCRIPT:
        return command_line.parse_script(rest)
    args = (_parser_of(COMMANDS[name]) if name else _parser()).parse_args(rest)
    given = vars(args)
    if given.get("truth") and not any(given.get(way) for way in BENCH_THERE):  # an emulator of ours has its own
        raise BadInput(expected("--control of its emulator with it", args.truth, "--truth"))
    return args


def _parser() -> Parser:
    """Of `run` without a procedure."""
    p = Parser(
        prog="psabench run",
        usage="psabench run [-h] [--list] PROCEDURE [option...]",
        description="Run a procedure over CAN, compare its results with the truth where it is known, and write a "
        "report.\n\n" + _table(),
        epilog=EPILOG,
    )
    p.set_defaults(handler=_without_procedure)
    p.add_argument("--list", action="store_true", help="list the procedures and their parameters")
    add_json(p)
    p.add_argument("procedure", nargs="?", metavar="PROCEDURE", help=argparse.SUPPRESS)
    return p


def words(argv: Sequence[str]) -> tuple[str, list[str]]:
    """The procedure, wherever among its options it is, and the other words; "": none, and what `run` takes."""
    rest = list(argv)
    if "--list" in rest:
        return "", [w for w in rest if w in ("--list", "--json")]
    at = _procedure_at(rest)
    if at is None:
        return "", [w for w in rest if w in ("-h", "--help")]
    name = rest.pop(at)
    return (name, rest) if name in (*COMMANDS, SCRIPT) else ("", [name])


def _procedure_at(rest: Sequence[str]) -> int | None:
    """Where the first word is that is neither an option nor the value of one."""
    k = 0
    while k < len(rest):
        word = rest[k]
        if not word.startswith("-"):
            return k
        k += 1 if "=" in word or any(flag.startswith(word) for flag in FLAGS) else 2
    return None


def _parser_of(command: Command) -> Parser:
    p = Parser(
        prog=f"psabench run {command.name}",
        usage=f"psabench run {command.name} [-h] [option...]",
        description=f"{command.summary[0].upper()}{command.summary[1:]}.",
        epilog=f"examples:\n{command.examples}{command.notes}",
    )
    p.set_defaults(handler=command.handler, procedure=command.name, kept=command.kept, needs="reports")
    taken = command.parameters
    if taken.fields:
        group = p.add_argument_group(f"parameters of {command.name}")
        for name, f in taken.fields.items():
            others = {label: changed.get(name, f.default) for label, changed in taken.defaults.items()}
            add_parameter(group, name, f, {k: v for k, v in others.items() if v != f.default})
    group = p.add_argument_group("the bench and the report")
    for option, how in command.own.items():
        group.add_argument(option, **how)
    for option in command.common:
        group.add_argument(*(["-v"] if option == "--verbose" else []), option, **EVERY[option])
    return p


def _table() -> str:
    rows = [*((c.name, c.summary) for c in COMMANDS.values()), (SCRIPT, "lines of the shell from a file")]
    indent = 4 + max(len(name) for name, _ in rows)
    filled = (
        textwrap.fill(f"  {name:{indent - 2}}{text}", width=100, subsequent_indent=" " * indent) for name, text in rows
    )
    return "\n".join(["procedures:", *filled])


def _without_procedure(args: argparse.Namespace) -> int:
    if args.list:
        show_data(args, [_command_dict(c) for c in COMMANDS.values()], map(_list_lines, COMMANDS.values()))
        return 0
    known = f"{', '.join(COMMANDS)} or {SCRIPT}"
    if args.procedure is None:
        raise BadInput(expected(f"{known} (psabench run --help explains them)", "none", "run"))
    raise BadInput(expected(known, f"{args.procedure!r}{did_you_mean(args.procedure, list(COMMANDS))}", "run"))


def _list_lines(c: Command) -> str:
    return f"{c.name}: {c.summary}\n  {' '.join([*map(option_name, c.parameters.fields), *c.common])}"


def _command_dict(c: Command) -> dict[str, Any]:
    """Of JSON's types: parameters with their defaults, and the options of the bench and the report."""
    taken = [
        {"option": option_name(name), "unit": f.metadata["unit"], "default": f.default, "help": f.metadata["help"]}
        for name, f in c.parameters.fields.items()
    ]
    return {"name": c.name, "summary": c.summary, "parameters": taken, "options": [*c.own, *c.common]}

"""Options that commands share, and values of options: each type returns the value or raises ArgumentTypeError."""

from __future__ import annotations

import argparse
import difflib
import errno
import os
import re
import stat
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from psabench.boards.registry import NAMES, of_name
from psabench.errors import BadInput, expected, output_error
from psabench.output import add_json

Options = TypeVar("Options")

KEPT = "what was measured is kept"  # default `kept` of a command that stores as it measures; Ctrl-C ends it with that
LISTED = 12  # options that an error lists
LINE_HZ = 8_000_000.0  # psabench.link.lineport.SAMPLE_HZ, without loading NumPy
BUS_HELP = """\
CAN bus, as INTERFACE:CHANNEL[,key=value...] of python-can: socketcand:127.0.0.1:29536, slcan:/dev/pts/7,
socketcan:vcan0,fd=true"""
CAN_HELP = f"""\
{BUS_HELP}. Default: python-can's configuration ($CAN_INTERFACE, $CAN_CHANNEL, ~/.canrc)"""


def _choice_text(given: str, choices: str) -> str:
    return expected(choices, f"{given!r}{did_you_mean(given, choices.split(', '))}")


def did_you_mean(given: str, known: Sequence[str]) -> str:
    """For the end of an error: the known word that is nearest to a mistyped one, if any is near."""
    return "".join(f" (did you mean {near}?)" for near in difflib.get_close_matches(given, known, 1))


# argparse's messages: what to make of the parts that each pattern finds, in the form of `expected`.
_VALUES = {"int": "an integer", "float": "a number", "Path": "a path"}
_MESSAGES: tuple[tuple[str, Callable[[re.Match[str]], str]], ...] = (
    (r"invalid (\w+) value: (.*)", lambda m: expected(_VALUES.get(m[1], f"a value ({m[1]})"), m[2])),
    (r"invalid choice: '?(.*?)'? \(choose from (.*)\)", lambda m: _choice_text(m[1], m[2].replace("'", ""))),
    (r"expected one argument", lambda m: expected("a value", "none")),
    (r"expected at least one argument", lambda m: expected("at least one value", "none")),
    (r"ignored explicit argument (.*)", lambda m: expected("no value", m[1])),
    (r"not allowed with argument (.*)", lambda m: expected(f"one of it and {m[1]}", "both")),
    (r"the following arguments are required: (.*)", lambda m: expected(m[1], "none")),
    (r"one of the arguments (.*) is required", lambda m: expected(f"one of {m[1].replace(' ', ', ')}", "none")),
    (r"ambiguous option: (.*) could match (.*)", lambda m: expected(f"one of {m[2]}", m[1])),
)


class Parser(argparse.ArgumentParser):
    """A parser whose errors are BadInput of one line, `<where>: expected <what>, got <value>`."""

    def __init__(self, *args: Any, **how: Any) -> None:
        super().__init__(*args, **{"formatter_class": Help, **how})
        self.color = False  # Python 3.14 would colour the help of a terminal; nothing else of ours has colours

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Raises BadInput, for an unknown argument as well."""
        found, rest = super().parse_known_args(args, namespace)
        if rest and not rest[0].startswith("-"):
            raise BadInput(expected("no more arguments", repr(rest[0]), self._name()))
        if rest:
            given = rest[0].partition("=")[0]
            options = [a.option_strings[-1] for a in self._actions if a.option_strings and a.dest != "help"]
            known = ", ".join(options) if len(options) <= LISTED else "an option that --help lists"
            raise BadInput(expected(known, f"{given}{did_you_mean(given, options)}", self._name()))
        return found, rest

    def error(self, message: str) -> NoReturn:
        """Raises BadInput: argparse's message in the form of `expected`."""
        option, text = re.match(r"(?:argument ([^:]+): )?(.*)", message, re.DOTALL).groups()  # type: ignore[union-attr]
        where = option.rpartition("/")[2] if option else self._name()
        texts = (make(m) for pattern, make in _MESSAGES if (m := re.fullmatch(pattern, text)))
        raise BadInput(f"{where}: {next(texts, text)}")

    def _name(self) -> str:
        return self.prog.removeprefix("psabench ").removeprefix("run ")


class Help(argparse.RawDescriptionHelpFormatter):
    """Keeps the examples as they are written, and most options on the line of their explanation."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=32)


def of_fields(kind: type[Options], args: argparse.Namespace, **others: Any) -> Options:
    """A dataclass of options: each field the argument of its name, and others."""
    named = {k: v for k, v in vars(args).items() if k in kind.__dataclass_fields__}  # type: ignore[attr-defined]
    return kind(**{**named, **others})


def refuse_beside(way: str, given: Mapping[str, object], where: str) -> None:
    """given: options that an option `way` excludes, None: it was not given. Raises BadInput."""
    for option, value in given.items():
        if value is not None:
            raise BadInput(expected(f"no {option} beside {way}", value, where))


def option_name(parameter: str) -> str:
    return f"--{parameter.replace('_', '-')}"


def add_parameter(group: Any, name: str, f: Any, others: Mapping[str, Any]) -> None:
    """The option of a procedure's parameter, a dataclass field made by `psabench.procedures.result.option`.

    others: defaults that have a label. `given_parameters` reads it.
    """
    unit = f.metadata["unit"]
    kind = type(f.default) if f.default is not None else float
    metavar = unit.upper() or {bool: "YES|NO", int: "N", float: "X", str: "WORD"}[kind]
    defaults = " ".join(x for x in (_default(f.default), unit) if x)
    defaults += "".join(f"; {label} {_default(value)}" for label, value in others.items())
    text = f"{f.metadata['help']} ({defaults})".replace("%", "%%")
    group.add_argument(
        option_name(name), dest=f"param_{name}", type=yes_no if kind is bool else kind, metavar=metavar, help=text
    )


def _default(value: Any) -> str:
    if value is None or isinstance(value, bool):
        return {None: "none", True: "yes", False: "no"}[value]
    return f"{value:g}" if isinstance(value, float) else str(value)


def given_parameters(args: argparse.Namespace) -> dict[str, Any]:
    """The parameters that were given."""
    return {k.removeprefix("param_"): v for k, v in vars(args).items() if k.startswith("param_") and v is not None}


def report_folder(text: str) -> Path:
    """One that is there or can be made: looked at before hours of work, made with its first file. Raises BadInput."""
    path = Path(text)
    there = next((p for p in (path, *path.parents) if os.path.lexists(p)), Path())
    try:
        if not stat.S_ISDIR(there.stat().st_mode):
            raise FileExistsError(errno.EEXIST, "") if there == path else NotADirectoryError(errno.ENOTDIR, "")
        if not os.access(there, os.W_OK | os.X_OK):
            read_only = os.statvfs(there).f_flag & os.ST_RDONLY
            raise PermissionError(errno.EROFS if read_only else errno.EACCES, "")
    except OSError as e:
        raise output_error(path, e) from e
    return path


def yes_no(text: str) -> bool:
    if text.lower() in ("1", "yes", "true", "on"):
        return True
    if text.lower() in ("0", "no", "false", "off"):
        return False
    raise argparse.ArgumentTypeError(expected("yes or no", repr(text)))


def natural(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(expected("an integer of 0 or more", repr(text)))
    return int(text)


def port_number(text: str) -> int:
    """A TCP port; 0: any free one."""
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(expected("a TCP port, 0 to 65535", repr(text)))
    return int(text)


def positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(expected("a number above 0", repr(text)))
    return value


def board_name(text: str) -> str:
    """A board; another name of it, as psa1 or pik5, is that of the board."""
    board = of_name(text)
    if board is None:
        raise argparse.ArgumentTypeError(expected(", ".join(NAMES), repr(text)))
    return board.name


def node_id(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 127:
        raise argparse.ArgumentTypeError(expected("a CANopen node, 1 to 127", repr(text)))
    return int(text)


def add_scpi(p: Any, what: str) -> None:
    """--scpi NAME=ADDRESS, which may be repeated."""
    p.add_argument("--scpi", action="append", default=[], metavar="NAME=ADDRESS", help=what)


def add_inputs(p: Any) -> None:
    text = "voltage at an input during the test: x=2.5"
    p.add_argument("--input", action="append", default=[], metavar="AXIS=V", help=text)


def add_clock_ppm(p: Any) -> None:
    text = "tolerance of all clocks (%(default)g)"
    p.add_argument("--clock-ppm", type=float, default=100.0, metavar="PPM", help=text)


def add_default_node(p: Any) -> None:
    """--node ID, none unless it is given."""
    p.add_argument("--node", type=int, metavar="ID", help="CANopen node (the board's default)")


def add_selection(p: Any, beginning: str, out: str, default: Path | None = None) -> None:
    """Options of every conformance suite. beginning: of ids; out: the folder, for the help."""
    p.add_argument("--only", nargs="+", default=[], metavar="ID", help=f"requirement ids or prefixes: {beginning}")
    text = "requirements that the run must judge: N, or P%% of those that an interface shows (90%%)"
    p.add_argument("--min-judged", metavar="N|P%", help=text)
    text = "requirement ids or prefixes: each must have passed"
    p.add_argument("--require", nargs="+", default=[], metavar="ID", help=text)
    p.add_argument("--out", type=report_folder, default=default, metavar="FOLDER", help=f"folder of the report ({out})")
    p.add_argument("-v", "--verbose", action="store_true", help="list passed requirements as well")
    add_json(p, "print the report's conform.json instead of text")


def add_board(p: Any, what: str) -> None:
    """--board and --node of the unit `what`."""
    names = ", ".join(NAMES)
    text = f"board {what}: {names} (%(default)s)"
    p.add_argument("--board", type=board_name, metavar="BOARD", default="psa2", help=text)
    p.add_argument("--node", type=node_id, help=f"CANopen node {what} (the board's default)")


def node_of(args: argparse.Namespace) -> int:
    """The node that `add_board` took, else the board's default."""
    from psabench.link.protocol_files import dbc_node

    return dbc_node(args.board) if args.node is None else int(args.node)

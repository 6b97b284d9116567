"""Options that commands share, and values of options: each type returns the value or raises ArgumentTypeError."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from psabench.boards.registry import NAMES, of_name
from psabench.errors import BadInput, expected

LINE_HZ = 8_000_000.0  # psabench.link.lineport.SAMPLE_HZ, without loading NumPy
BUS_HELP = """\
the bus: INTERFACE:CHANNEL[,key=value...] of python-can. Examples: socketcand:127.0.0.1:29536, slcan:/dev/pts/7,
socketcan:vcan0,fd=true"""
CAN_HELP = f"""\
{BUS_HELP}. Without it python-can's own configuration is used ($CAN_INTERFACE, $CAN_CHANNEL, ~/.canrc)"""


class Parser(argparse.ArgumentParser):
    """A parser that refuses a word it does not know in one line, with what there is instead of it."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Raises BadInput."""
        found, rest = super().parse_known_args(args, namespace)
        if rest:
            name = self.prog.removeprefix("psabench ").removeprefix("run ")
            if not rest[0].startswith("-"):
                raise BadInput(f"{rest[0]}: one word too many for {name}")
            options = (a.option_strings[-1] for a in self._actions if a.option_strings and a.dest != "help")
            raise BadInput(f"{rest[0].partition('=')[0]}: {name} has no such parameter; it has {', '.join(options)}")
        return found, rest


class Help(argparse.RawDescriptionHelpFormatter):
    """Keeps the examples as they are written, and most options on the line of their explanation."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=32)


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
    """--only, --out and --verbose of a conformance suite. beginning: of ids; out: the folder, for the help."""
    p.add_argument("--only", nargs="+", default=[], metavar="ID", help=f"requirement ids or prefixes: {beginning}")
    p.add_argument("--out", type=Path, default=default, metavar="FOLDER", help=f"folder of the report ({out})")
    p.add_argument("-v", "--verbose", action="store_true", help="list passed requirements as well")


def add_board(p: argparse.ArgumentParser, what: str) -> None:
    """--board and --node of the unit `what`."""
    names = ", ".join(NAMES)
    text = f"board of the unit {what}: {names} (%(default)s)"
    p.add_argument("--board", type=board_name, metavar="BOARD", default="psa2", help=text)
    p.add_argument("--node", type=node_id, help=f"node {what} (the board's usual one)")


def node_of(args: argparse.Namespace) -> int:
    """The node that `add_board` took, else the board's default."""
    from psabench.link.protocol_files import dbc_node

    return dbc_node(args.board) if args.node is None else int(args.node)

"""`psabench conform`: the options of its suites. What a suite needs is loaded when it runs."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psabench.boards.registry import BUS_BOARDS, NAMES, PLAYED
from psabench.conform.defaults import LINKS, MAX_S, OUT
from psabench.options import (
    BUS_HELP,
    LINE_HZ,
    Parser,
    add_clock_ppm,
    add_default_node,
    add_inputs,
    add_scpi,
    add_selection,
)
from psabench.output import add_json, show_data

if TYPE_CHECKING:
    from psabench.conform.requirements import Requirement

EPILOG = """\
examples:
  psabench conform device --board psa2                   on an emulator, in lockstep, with all lines
  psabench conform device --board psa2 --profile w24 --can socketcand:127.0.0.1:29536 --lines /dev/pts/7
  psabench conform device --board psd1 --can slcan:/dev/ttyACM0 --bus-port /dev/ttyUSB1
  psabench conform recording run.log lines.vcd --board psa2    recorded files
  psabench conform recording run.log --board psa2 --min-judged 60 --require PSA2-FRAME    what must have been judged
  psabench conform host --command "build/host {can} {node}"
  psabench conform list --board psa2                     requirements, and how each is observed
"""

DEVICE_EPILOG = """\
Black box: the suite uses CAN, the lines and the bus port only. A requirement that needs a missing probe is reported as
not observable, never as passed. OUT has report.html, and junit.xml and conform.json for programs; each failure comes
with its waveform.

Exit status: 0 conforms, or no violation was seen and as much was judged as --min-judged and --require say; 1 a
requirement is violated; 4 no violation was seen, but too little was judged; 2 bad input; 3 the bench or a
link failed; 130 ended by Ctrl-C.
"""

RECORDING_EPILOG = """\
FILE: at most one log of the CAN bus (.log of candump, .blf, .mcap, .mf4 ...), at most one recording of lines
(.vcd of any tool, .sr of sigrok, .bin: bytes of the line port). Together they form one recording of one bench.

A requirement that the files do not show is reported as not observable, never as passed.

Exit status: 0 conforms, or no violation was seen and as much was judged as --min-judged and --require say; 1 a
requirement is violated; 4 no violation was seen, but too little was judged; 2 bad input; 130 ended by Ctrl-C.
"""

HOST_EPILOG = """\
The program is started once for each case, after power-on of the board; it must exit when its link closes. In COMMAND
  {can}      127.0.0.1:PORT of a socketcand server          {node}     CANopen node of the board
  {form}     frame form to select, for hosts that support form 1
  {pty}      pseudo-terminal of an slcan adapter            {results}  file for results (default: standard output)
  {line}     pseudo-terminal of the lines, one byte per sample; {word_bits}, {code_bits}: of its words and codes
  {bus}      pseudo-terminal of a bus port: PSD-1, PIK
The program reports what it reads in JSON (docs/conform_host.md): {"frame": 7, "x": ...}, {"lost": 2}, {"stale": true}.

examples:
  psabench conform host --command "build/host {can} {node}"
  psabench conform host --command "build/host_line {line}" --only HOST-TORN
  psabench conform host --board pik --command ".venv/bin/python examples/vins_boards.py pik socketcand:{can} {node}"
  psabench conform host --manual can --results build/results.jsonl     start it by hand, case by case

OUT has report.html, junit.xml and conform.json, and for each case the bus log and the reported results.
Exit status: 0 conforms, or no violation was seen and as much was judged as --min-judged and --require say; 1 a
requirement is violated; 4 no violation was seen, but too little was judged; 2 bad input; 3 the bench
failed; 130 ended by Ctrl-C.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench conform`. Raises BadInput."""
    p = Parser(
        prog="psabench conform",
        description="Check a board against docs/reference/requirements.md, using only its external interfaces.",
        epilog=EPILOG,
    )
    suites = p.add_subparsers(required=True, metavar="SUITE")
    _add_device(suites)
    _add_recording(suites)
    _add_host(suites)
    _add_list(suites)
    return p.parse_args(words)


def _add_device(suites: Any) -> None:
    p = suites.add_parser(
        "device",
        help="check a board, emulated or real",
        description="Check a board, emulated or real, over its interfaces.",
        epilog=DEVICE_EPILOG,
    )
    p.set_defaults(handler=_handler("device_command"))
    _add_board(p)
    at = p.add_argument_group("interfaces of the board (without --can: an emulator is started)")
    at.add_argument("--can", metavar="BUS", help=BUS_HELP)
    at.add_argument("--lines", type=Path, metavar="PORT", help="line port: pseudo-terminal or serial adapter")
    at.add_argument("--line-hz", type=float, default=LINE_HZ, metavar="HZ", help="its sample rate (%(default)g)")
    at.add_argument("--bus-port", type=Path, metavar="PORT", help=f"bus port (boards {', '.join(BUS_BOARDS)})")
    add_scpi(at, "an instrument: supply=TCPIP::...")
    at.add_argument("--control", type=Path, metavar="SOCKET", help="control socket of an emulator, for lockstep")
    add_default_node(at)
    add_inputs(at)
    own = p.add_argument_group("emulator")
    own.add_argument("--adapter", default="socketcand:0", metavar="KIND", help="CAN adapter, or slcan (%(default)s)")
    own.add_argument("--port-only", action="store_true", help="observe the line port only, not all pins")
    own.add_argument("--seed", type=int, default=1, help="random seed of the emulator (%(default)s)")
    own.add_argument(
        "--clock-error", type=float, default=0.0, metavar="PPM", help="error of the emulator's clocks; positive: fast"
    )
    own.add_argument(
        "--recorder-error", type=float, default=0.0, metavar="PPM", help="error of the probes' clock; positive: fast"
    )
    what = p.add_argument_group("checks and report")
    add_clock_ppm(what)
    add_selection(what, "PSA2-FRAME", f"{OUT}/BOARD-PROFILE")


def _add_recording(suites: Any) -> None:
    p = suites.add_parser(
        "recording",
        help="check recordings of a bench",
        description="Check recordings of a board's CAN bus and lines.",
        epilog=RECORDING_EPILOG,
    )
    p.set_defaults(handler=_handler("recording_command"))
    p.add_argument("files", nargs="+", type=Path, metavar="FILE")
    _add_board(p)
    add_default_node(p)
    p.add_argument(
        "--line", action="append", default=[], metavar="LINE=CHANNEL", help="analyser channel of a line: Int=D0"
    )
    p.add_argument("--line-hz", type=float, metavar="HZ", help="sample rate of the lines (.bin: 8e6, else the file's)")
    add_inputs(p)
    text = "check at most the first S seconds of each file (%(default)g)"
    p.add_argument("--max-seconds", type=float, default=MAX_S, metavar="S", help=text)
    add_clock_ppm(p)
    add_selection(p, "PSA2-FRAME", f"{OUT}/recording-BOARD-PROFILE")


def _add_host(suites: Any) -> None:
    p = suites.add_parser(
        "host",
        help="check a host program that reads a board",
        description="Simulate good and faulty boards for a host program and check what it reports.",
        epilog=HOST_EPILOG.replace("%", "%%"),
    )
    p.set_defaults(handler=_handler("host.command"))
    how = p.add_mutually_exclusive_group(required=True)
    how.add_argument("--command", metavar="COMMAND", help="command line with {can}, {pty}, {line} or {bus}")
    how.add_argument("--manual", choices=list(LINKS), help="link for a program that you start by hand when asked")
    p.add_argument("--results", type=Path, metavar="FILE", help="with --manual: the program's results")
    p.add_argument("--port", type=int, default=29536, help="with --manual can: socketcand port (%(default)s)")
    p.add_argument("--board", default="psa2", help=f"simulated board: {', '.join(PLAYED)} (%(default)s)")
    p.add_argument("--profile", help="profile of the board (article for psa2, else the board's name)")
    p.add_argument("--case", nargs="+", default=[], metavar="NAME", help="run only these cases (docs/conform_host.md)")
    p.add_argument("--speed", type=float, default=1.0, metavar="X", help="speed; 1: real time")
    add_selection(p, "HOST-LOST", f"{OUT}/host", OUT / "host")


def _add_list(suites: Any) -> None:
    p = suites.add_parser(
        "list",
        help="list the requirements of a board",
        description="List the requirements of a board: grade, how each is observed, the text.",
    )
    p.set_defaults(handler=_list)
    _add_board(p)
    add_json(p)


def _add_board(p: argparse.ArgumentParser) -> None:
    p.add_argument("--board", required=True, help=f"board: {', '.join(NAMES)}")
    p.add_argument("--profile", help="profile of the board (psa-emu --list-profiles)")


def _handler(module: str) -> Callable[[argparse.Namespace], int]:
    """`handle` of a module that is loaded when its suite runs."""

    def handle(args: argparse.Namespace) -> int:
        return int(import_module(f"psabench.conform.{module}").handle(args))

    return handle


def _list(args: argparse.Namespace) -> int:
    from psabench.conform.profile import variant
    from psabench.conform.selection import requirements_of

    found = requirements_of(variant(args.board, args.profile))
    lines = (f"{r.id:16} {r.grade} {'/'.join(r.observe) or '-':16} {r.text}" for r in found)
    show_data(args, [_requirement_dict(r) for r in found], lines)
    return 0


def _requirement_dict(r: Requirement) -> dict[str, Any]:
    """Of JSON's types."""
    found: dict[str, Any] = {name: getattr(r, name) for name in ("id", "kind", "grade", "text", "original", "source")}
    return found | {"observe": dict(r.observe), "unobservable": r.unobservable, "limits": dict(r.limits)}

"""`psabench conform`: the options of its suites. What a suite needs is loaded when it runs."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from psabench.boards.registry import BUS_BOARDS, NAMES, PLAYED
from psabench.conform.defaults import LINKS, MAX_S, OUT
from psabench.options import (
    BUS_HELP,
    LINE_HZ,
    Help,
    Parser,
    add_clock_ppm,
    add_default_node,
    add_inputs,
    add_scpi,
    add_selection,
)

EPILOG = """\
examples:
  psabench conform device --board psa2                   an emulator started for it, in lockstep, all lines seen
  psabench conform device --board psa2 --profile w24 --can socketcand:127.0.0.1:29536 --lines /dev/pts/7
  psabench conform device --board psd1 --can slcan:/dev/ttyACM0 --bus-port /dev/ttyUSB1
  psabench conform recording run.log lines.vcd --board psa2    files that were recorded at a bench
  psabench conform host --command "build/host {can} {node}"
  psabench conform list --board psa2                     its requirements, and how each is seen
"""

DEVICE_EPILOG = """\
Black box: the suite sees CAN, lines and the bus port, and nothing else. What a missing probe would show is reported
as not observable, never as passed. OUT/report.html is the report, OUT/junit.xml and OUT/conform.json the same for
machines; a failure has its waveform beside it.

Exit status: 0 conforms, 1 does not, 2 bad input, 3 the bench or a link failed, 130 ended by Ctrl-C.
"""

RECORDING_EPILOG = """\
FILE: at most one log of the CAN bus (.log of candump, .blf, .asc, .trc, .csv, .mf4), at most one recording of lines
(.vcd of any tool, .sr of sigrok, .bin: bytes of the line port). Together they are one recording of one bench.

What the files do not show is reported as not observable, never as passed.

Exit status: 0 conforms, 1 does not, 2 bad input, 130 ended by Ctrl-C.
"""

HOST_EPILOG = """\
The program is started once for each case, as soon as its board is powered; it ends when its link ends. In COMMAND
  {can}      127.0.0.1:PORT of a socketcand server          {node}     CANopen node of the board
  {form}     frame form to ask for, for hosts that take 1, too
  {pty}      pseudo-terminal of an slcan adapter            {results}  file to tell into (without it: standard output)
  {line}     pseudo-terminal of the lines, a byte a sample; {word_bits}, {code_bits}: of its words and codes
  {bus}      pseudo-terminal of a bus port: PSD-1, PIK
and it tells what it takes in JSON (docs/conform_host.md): {"frame": 7, "x": ...}, {"lost": 2}, {"stale": true}.

examples:
  psabench conform host --command "build/host {can} {node}"
  psabench conform host --command "build/host_line {line}" --only HOST-TORN
  psabench conform host --board pik --command ".venv/bin/python examples/vins_boards.py pik socketcand:{can} {node}"
  psabench conform host --manual can --results build/told.jsonl     start it by hand, case by case

OUT has report.html, junit.xml and conform.json, and of each case what was on the bus and what was reported.
Exit status: 0 conforms, 1 does not, 2 bad input, 3 the bench failed, 130 ended by Ctrl-C.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench conform`. Raises BadInput."""
    p = Parser(
        prog="psabench conform",
        description="Conformance of a board to docs/reference/requirements.md, over its wires alone.",
        formatter_class=Help,
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
        help="a board, emulated or real",
        description="Test a board at the end of its wires.",
        formatter_class=Help,
        epilog=DEVICE_EPILOG,
    )
    p.set_defaults(handler=_device)
    _add_board(p)
    at = p.add_argument_group("where its wires end (without --can an emulator is started)")
    at.add_argument("--can", metavar="BUS", help=BUS_HELP)
    at.add_argument("--lines", type=Path, metavar="PORT", help="line port: pseudo-terminal or adapter of that kind")
    at.add_argument("--line-hz", type=float, default=LINE_HZ, metavar="HZ", help="its samples a second (%(default)g)")
    at.add_argument("--bus-port", type=Path, metavar="PORT", help=f"bus port of {', '.join(BUS_BOARDS)}")
    add_scpi(at, "an instrument: supply=TCPIP::...")
    at.add_argument("--control", type=Path, metavar="SOCKET", help="control socket of an emulator: lockstep")
    add_default_node(at)
    add_inputs(at)
    own = p.add_argument_group("of the emulator that is started")
    own.add_argument(
        "--adapter", default="socketcand:0", metavar="KIND", help="its CAN adapter (%(default)s), or slcan"
    )
    own.add_argument("--port-only", action="store_true", help="see its line port alone, not all its pins")
    own.add_argument("--seed", type=int, default=1, help="of its noise (%(default)s)")
    own.add_argument("--clock-error", type=float, default=0.0, metavar="PPM", help="by which its clocks are fast")
    own.add_argument(
        "--recorder-error", type=float, default=0.0, metavar="PPM", help="by which the clock of the probes is fast"
    )
    what = p.add_argument_group("what is tested, and where it is")
    add_clock_ppm(what)
    add_selection(what, "PSA2-FRAME", f"{OUT}/BOARD-PROFILE")


def _add_recording(suites: Any) -> None:
    p = suites.add_parser(
        "recording",
        help="files that were recorded at a bench",
        description="Check recordings of a board's CAN bus and lines.",
        formatter_class=Help,
        epilog=RECORDING_EPILOG,
    )
    p.set_defaults(handler=_recording)
    p.add_argument("files", nargs="+", type=Path, metavar="FILE")
    _add_board(p)
    add_default_node(p)
    p.add_argument(
        "--line", action="append", default=[], metavar="LINE=CHANNEL", help="a line by the analyser's name: Int=D0"
    )
    p.add_argument(
        "--line-hz", type=float, metavar="HZ", help="samples a second of the lines (of .bin 8e6, else the file's)"
    )
    add_inputs(p)
    text = "check at most this much of each file, from its start (%(default)g)"
    p.add_argument("--max-seconds", type=float, default=MAX_S, metavar="S", help=text)
    add_clock_ppm(p)
    add_selection(p, "PSA2-FRAME", f"{OUT}/recording-BOARD-PROFILE")


def _add_host(suites: Any) -> None:
    p = suites.add_parser(
        "host",
        help="a program that takes a board's data",
        description="Simulate good and bad boards for a program and check what it reports.",
        formatter_class=Help,
        epilog=HOST_EPILOG.replace("%", "%%"),
    )
    p.set_defaults(handler=_host)
    how = p.add_mutually_exclusive_group(required=True)
    how.add_argument("--command", metavar="COMMAND", help="how the program is started, with {can}, {pty} or {line}")
    how.add_argument("--manual", choices=list(LINKS), help="it is started by hand when we say so, at this link")
    p.add_argument("--results", type=Path, metavar="FILE", help="with --manual: the file that the program tells into")
    p.add_argument("--port", type=int, default=29536, help="with --manual can: of socketcand, each time (%(default)s)")
    p.add_argument("--board", default="psa2", help=f"simulated board: {', '.join(PLAYED)} (%(default)s)")
    p.add_argument("--profile", help="of the board (article for psa2, else of its own name)")
    p.add_argument("--case", nargs="+", default=[], metavar="NAME", help="these cases alone (docs/conform_host.md)")
    p.add_argument("--speed", type=float, default=1.0, metavar="X", help="times real time, while nothing is silent")
    add_selection(p, "HOST-LOST", f"{OUT}/host", OUT / "host")


def _add_list(suites: Any) -> None:
    p = suites.add_parser(
        "list",
        help="the requirements of a board",
        description="Requirements of a board: grade, how each is seen, the sentence.",
        formatter_class=Help,
    )
    p.set_defaults(handler=_list)
    _add_board(p)


def _add_board(p: argparse.ArgumentParser) -> None:
    p.add_argument("--board", required=True, help=", ".join(NAMES))
    p.add_argument("--profile", help="which of its profiles it is said to have (psa-emu --list-profiles)")


def _device(args: argparse.Namespace) -> int:
    from psabench.conform import device_command

    return device_command.device(args)


def _recording(args: argparse.Namespace) -> int:
    from psabench.conform import recording_command

    return recording_command.handle(args)


def _host(args: argparse.Namespace) -> int:
    from psabench.conform.host import command

    return command.host(args)


def _list(args: argparse.Namespace) -> int:
    from psabench.conform import list_command

    return list_command.list_requirements(args)

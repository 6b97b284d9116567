"""The `psabench` command: parses, calls `run`, `record` or `decode`, prints, and gives the exit status."""

from __future__ import annotations

import argparse
import logging
import os
import signal
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from psabench import decode, record, run_command
from psabench.arguments import Help, Parser, board_name, natural, node_id, positive
from psabench.campaign import command as campaign_command
from psabench.can_host import open_bus
from psabench.conform import command as conform_command
from psabench.devices import ALIASES
from psabench.errors import BadInput, BenchError
from psabench.lineport import LineFormat
from psabench.protocol_files import BOARDS, dbc_node
from psabench.shell import command_line

ABOUT = """\
The host's end of the bench: talks to a converter board over CAN or the line port, whether it is psa-emu or a real one.
"""

TOP_EPILOG = """\
a first hour:
  psabench run all                  calibrate an accelerometer on an emulator started for it; build/run/report.html
  psabench run gyrocompass          a gyro platform finds north; psabench run --help names all procedures
  psa-emu stream &                  a board on the bus, 1000 frames a second, until Ctrl-C
  psabench record run.log --can socketcand:127.0.0.1:29536 --for 10
  psabench decode run.log --out run.csv   volts against time
  psabench shell                    registers, instruments and faults at the keyboard
  psabench campaign gyrocompass     thousands of virtual gyrocompasses; build/campaign/report.html
  psabench conform device --board psa2   does a board do what its documents say? build/conform/psa2-article/report.html

psabench COMMAND --help says more. Exit status: 0 done and within limits, 1 done and out of limits, 2 bad input,
3 the bench or a link failed, 130 ended by Ctrl-C.
"""

BUS_HELP = """\
the bus: INTERFACE:CHANNEL[,key=value...] of python-can. Examples: socketcand:127.0.0.1:29536, slcan:/dev/pts/7,
socketcan:vcan0,fd=true"""
CAN_HELP = f"""\
{BUS_HELP}. Without it python-can's own configuration is used ($CAN_INTERFACE, $CAN_CHANNEL, ~/.canrc)"""

RECORD_EPILOG = """\
examples:
  psabench record run.log --can socketcand:127.0.0.1:29536         until Ctrl-C, in candump's format
  psabench record run.blf --can slcan:/dev/ttyACM0 --for 60        a minute, for CANalyzer
  psabench record run.asc --can socketcan:vcan0,fd=true --count 1000

Ends with --for, --count, Ctrl-C, SIGTERM or when the link breaks (exit status 3); the file is complete each time.
lost: frame numbers missing; torn: halves of a frame without the other; overruns: conversions the board itself missed.
"""

DECODE_EPILOG = """\
examples:
  psabench decode run.log --out run.csv        frames of node 5: time of reception and of sampling, volts at the load
  psabench decode run.blf --node 7 | head
  psabench decode --line capture.bin           words from INT/DATA/CLK samples; capture: cat LINK > capture.bin

Counters stand on stderr at the end: frames, lost, torn (CAN); also late, early, gaps with --line.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of the command."""
    words = run_command.words(list(sys.argv[1:] if argv is None else argv))
    if not words:
        parser().print_help(sys.stderr)
        return BadInput.exit_status
    for library in ("can", "canopen"):  # what goes wrong there is raised as well, and told in one line
        logging.getLogger(library).setLevel(logging.CRITICAL)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: files are closed, the emulator ended
    try:
        args = parser().parse_args(words)
        handler: Callable[[argparse.Namespace], int] = args.handler
        status = handler(args)
        sys.stdout.flush()
        return status
    except BenchError as e:
        print(f"psabench: {e}", file=sys.stderr)
        return e.exit_status
    except BrokenPipeError:  # `| head` has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as e:
        print(f"psabench: {e.filename or 'output'}: {e.strerror or e}", file=sys.stderr)
        return BadInput.exit_status
    except KeyboardInterrupt:
        print("psabench: interrupted; what was measured is kept", file=sys.stderr)
        return 130


def parser() -> argparse.ArgumentParser:
    """Of all commands; the words that it takes come from `run_command.words`."""
    top = Parser(prog="psabench", description=ABOUT, epilog=TOP_EPILOG, formatter_class=Help)
    top.add_argument("--version", action="version", version=f"psabench {version('psabench')}")
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    run_command.add(commands)
    _add_record(commands)
    _add_decode(commands)
    campaign_command.add(commands, Help, natural)
    conform_command.add(commands, Help, BUS_HELP)
    command_line.add(commands, Help, BUS_HELP, node_id)
    return top


def _add_record(commands: Any) -> None:
    p = commands.add_parser(
        "record",
        help="record the bus into a log file",
        description="Record all that is on the bus; count what the stream of one node lost.",
        formatter_class=Help,
        epilog=RECORD_EPILOG,
    )
    p.set_defaults(handler=_record)
    p.add_argument("file", type=Path, help=f"its ending is its format: {' '.join(record.FORMATS)}")
    p.add_argument("--can", help=CAN_HELP)
    _add_board(p, "whose frames are counted")
    p.add_argument("--for", dest="for_s", type=positive, metavar="SECONDS", help="end after this much wall time")
    p.add_argument("--count", type=natural, help="end after this many CAN messages")


def _add_board(p: argparse.ArgumentParser, what: str) -> None:
    names = ", ".join([*BOARDS, *ALIASES])
    text = f"board of the unit {what}: {names} (%(default)s)"
    p.add_argument("--board", type=board_name, metavar="BOARD", default="psa2", help=text)
    p.add_argument("--node", type=node_id, help=f"node {what} (the board's usual one)")


def _node(args: argparse.Namespace) -> int:
    return dbc_node(args.board) if args.node is None else int(args.node)


def _add_decode(commands: Any) -> None:
    p = commands.add_parser(
        "decode",
        help="a log or a line capture to CSV in SI units",
        description="Frames of one node from a CAN log, or words from a capture of the line port, as CSV.",
        formatter_class=Help,
        epilog=DECODE_EPILOG,
    )
    p.set_defaults(handler=_decode)
    p.add_argument("file", type=Path, help="CAN log of python-can, or samples of the line port with --line")
    p.add_argument("--out", type=Path, help="CSV file (standard output)")
    _add_board(p, "to decode")
    p.add_argument("--line", action="store_true", help="the file holds INT/DATA/CLK samples, one byte each")
    p.add_argument("--word-bits", type=int, default=32, help="word width on the line: 16, 24 or 32 (%(default)s)")
    p.add_argument("--sample-hz", type=positive, default=8e6, help="sample rate of the capture (%(default)g)")


def _record(args: argparse.Namespace) -> int:
    r = record.record(open_bus(args.can), args.file, _node(args), args.for_s, args.count, args.board)
    c = r.counters
    print(f"{r.messages} messages, {r.last_s - r.first_s:.3f} s, in {args.file}")
    print(f"frames of node {_node(args)}: {c.frames}, lost {c.lost}, torn {c.torn}, overruns {c.overruns}")
    if r.broken:
        print(f"psabench: {r.broken}; the recording up to there is complete", file=sys.stderr)
        return 3
    return 0


def _decode(args: argparse.Namespace) -> int:
    if args.line and args.board != "psa2":
        raise BadInput(f"--line: line frames are PSA-2's; of a {args.board} a CAN log is decoded: leave --line out")
    with args.out.open("w", encoding="utf-8") if args.out else _Stdout() as out:
        if args.line:
            decoder = decode.decode_line(args.file, _line_format(args), out)
            print(decoder.counts, file=sys.stderr)
            return 0
        counters = decode.decode_can(args.file, _node(args), out, args.board).counters
    print(f"frames {counters.frames}, lost {counters.lost}, torn {counters.torn}", file=sys.stderr)
    return 0


def _line_format(args: argparse.Namespace) -> LineFormat:
    try:
        return LineFormat(word_bits=args.word_bits, sample_hz=args.sample_hz)
    except ValueError as e:
        raise BadInput(str(e)) from e


class _Stdout:
    """Standard output as a context that does not close it."""

    def __enter__(self) -> Any:
        return sys.stdout

    def __exit__(self, *_: object) -> None:
        sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())

"""The `psabench` command: loads the command that is called, prints, and gives the exit status."""

from __future__ import annotations

import argparse
import logging
import os
import signal
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any

from psabench.errors import PROGRAM_FAULT, BadInput, BenchError, expected, output_error
from psabench.options import Parser
from psabench.places import need_extra, no_package
from psabench.report import provenance
from psabench.report.language import reports_in, take_option

# Module and help line of each command. The module and its libraries are loaded when the command is called (`parse`).
COMMANDS: Mapping[str, tuple[str, str]] = {
    "run": (
        "procedures.command_line.parser",
        "run a calibration or gyrocompassing procedure and report it; psabench run --help lists them",
    ),
    "record": ("link.record_command", "record the CAN bus to a log file"),
    "convert": ("logs.convert_command", "convert a CAN log to another format, or to a ROS 2 bag"),
    "decode": ("boards.decode_command", "convert a log or a line capture to CSV in SI units"),
    "view": (
        "logs.view_command",
        "open a recording of lines in PulseView or GTKWave, or show the CAN bus live in Foxglove",
    ),
    "tap": ("logs.tap_command", "record what is on a serial port, for Wireshark"),
    "waveform": ("logs.viewers", "write viewer files and pictures of a VCD file, install decoders and dissectors"),
    "campaign": ("campaign.procedures", "run a procedure on thousands of virtual instruments"),
    "conform": ("conform.command", "check a board, a recording or a host program against the requirements"),
    "report": ("report.diff_command", "compare the results of two runs"),
    "passport": ("passport.command", "keep what was measured of each instrument: passports in one file"),
    "koi": ("koi.command", "fly recorded flights of a unit with a satellite receiver again"),
    "nav": ("sins.command", "apply the calibration of an inertial unit to a recording, or export it"),
    "explore": ("explore.command", "play random schedules of faults and host behaviours, and check the requirements"),
    "mavlink": ("mavlink.command", "be a MAVLink system for ground stations: readings, parameters, calibration"),
    "panel": ("panel.command_line", "show a bench as a web page: channels, registers, instruments, faults"),
    "shell": ("shell.command_line", "open an interactive shell: instruments, device, faults"),
}

ABOUT = """\
Host tools for a converter board on CAN or the line port, emulated (psa-emu) or real.
"""

TOP_EPILOG = """\
examples:
  psabench run all                  calibrate an accelerometer on an emulator; report: build/run/report.html
  psabench run gyrocompass          find north with a gyro platform
  psa-emu stream &                  emulate a board that sends 1000 frames a second
  psabench record run.log --can socketcand:127.0.0.1:29536 --for 10
  psabench decode run.log --out run.csv   convert the log to volts against time
  psabench shell                    read registers, move instruments, inject faults
  psabench campaign gyrocompass     Monte-Carlo study; report: build/campaign/report.html
  psabench conform device --board psa2   check a board; report: build/conform/psa2-article/report.html

psabench COMMAND --help lists the options. --lang ru with any command: its report in Russian.
--json with a command that prints data: JSON on stdout (docs/tools/json.md).
Exit status: 0 done and within limits, 1 done and out of limits, 2 bad input, 3 the bench or a link failed, 70 a
fault of psabench itself, 130 ended by Ctrl-C.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of the command."""
    words = list(sys.argv[1:] if argv is None else argv)
    if not words:
        parser().print_help(sys.stderr)
        return BadInput.exit_status
    # Before numpy is loaded. Matrices here have hundreds of rows at most: more threads spend the time on waiting for
    # each other, and sums that are split by the number of cores are not everywhere the same to the last bit.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for library in ("can", "canopen"):  # what goes wrong there is raised as well, and told in one line
        logging.getLogger(library).setLevel(logging.CRITICAL)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: files are closed, the emulator ended
    kept = ""  # what the command leaves behind when it is interrupted
    try:
        rest, language = take_option(words)
        if not rest:
            raise BadInput(expected("a command", "none", "psabench"))
        args = parse(rest)
        kept = getattr(args, "kept", "")
        if needed := getattr(args, "needs", ""):
            need_extra(needed, words[0])
        handler: Callable[[argparse.Namespace], int] = args.handler
        with reports_in(language), provenance.command_run(["psabench", *words]):
            status = handler(args)
        sys.stdout.flush()
        return status
    except BenchError as e:
        print(f"psabench: {e}", file=sys.stderr)
        return e.exit_status
    except ModuleNotFoundError as e:
        if (e.name or "").partition(".")[0] == "psabench":
            return _show_fault()
        print(f"psabench: {no_package(e, words[0])}", file=sys.stderr)
        return BadInput.exit_status
    except BrokenPipeError:  # `| head` has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as e:
        error = output_error(e.filename or "output", e)
        print(f"psabench: {error}", file=sys.stderr)
        return error.exit_status
    except KeyboardInterrupt:
        print("; ".join(filter(None, ("psabench: interrupted", kept))), file=sys.stderr)
        return 130
    except Exception:
        return _show_fault()


def _show_fault() -> int:
    """Of an error of ours. Left alone, Python would end with 1, which is a result out of limits."""
    traceback.print_exc()
    print("psabench: the lines above show a fault of psabench itself; please report them", file=sys.stderr)
    return PROGRAM_FAULT


def parse(words: Sequence[str]) -> argparse.Namespace:
    """Reads the command line; `handler` of the result carries it out; `kept`: see options.KEPT; `needs`: an extra.

    Raises BadInput.
    """
    if words[0] not in COMMANDS:  # an option, or no command: the parser says so
        return parser().parse_args(words)
    module, _ = COMMANDS[words[0]]
    args: argparse.Namespace = import_module(f"psabench.{module}").parse(words[1:])
    return args


def parser() -> argparse.ArgumentParser:
    """Of `psabench` itself: --help, --version, and the list of commands."""
    top = Parser(prog="psabench", description=ABOUT, epilog=TOP_EPILOG)
    top.add_argument("--version", action=Version, nargs=0, help="show program's version number and exit")
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    for name, (_, line) in COMMANDS.items():
        commands.add_parser(name, help=line)
    return top


class Version(argparse.Action):
    """Prints the version that is installed; importlib.metadata is loaded for it alone."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"psabench {version('psabench')}")
        parser.exit()


if __name__ == "__main__":
    sys.exit(main())

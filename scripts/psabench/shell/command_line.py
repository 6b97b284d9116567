"""`psabench shell` and `psabench run script`: their options. What they need is loaded when they run."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from psabench.options import BUS_HELP, Parser, add_scpi, node_id
from psabench.output import STREAM, add_json

SHELL_EPILOG = """\
examples:
  psabench shell                                  an emulator with the scenario calibrate, in real time
  psabench shell quiet --pace step --seed 3       time advances by commands only: repeatable results
  psabench shell --connect /tmp/psa.ctl           a running emulator; its bus and instruments are found
  psabench shell --can slcan:/dev/ttyACM0         a real device: registers, stream, can>
  psabench shell quiet --json --command 'head.turn 30' --command head.read

Lines come from the terminal, from --command, or from a pipe; the last two use step pace, print text or JSON, and have
the exit status of a script: 0 done, 1 an expectation failed, 2 a line is wrong, 3 the bench or a link failed.
"""

SCRIPT_EPILOG = """\
examples:
  psabench run script session.psa                 a script written by `save` or by hand
  psabench run script session.psa --scenario my.yaml --json
  psabench run script session.psa --control /tmp/psa.ctl     on a running emulator

Exit status: 0 done and every `expect` held, 1 an `expect` failed, 2 a line is wrong (reported with file, line and
column before anything runs), 3 the bench or a link failed.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench shell`. Raises BadInput."""
    shell = Parser(
        prog="psabench shell",
        description="Open an interactive shell for the bench (docs/shell.md).",
        epilog=SHELL_EPILOG,
    )
    shell.set_defaults(handler=_shell)
    shell.add_argument("scenario", nargs="?", help="scenario of the emulator to start: name or file (calibrate)")
    shell.add_argument("--pace", choices=["wall", "step"], help="pace of that emulator (wall at a terminal, else step)")
    shell.add_argument("--command", action="append", metavar="LINE", help="run LINE and exit; may be repeated")
    shell.add_argument("--connect", type=Path, metavar="CONTROL", help="control socket of a running emulator")
    _add_common(shell)
    return shell.parse_args(words)


def parse_script(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench run script`. Raises BadInput."""
    script = Parser(
        prog="psabench run script",
        description="Run a script of the shell.",
        epilog=SCRIPT_EPILOG,
    )
    script.set_defaults(handler=_script)
    script.add_argument("file", type=Path, help="script: lines of the shell; the first may be: start SCENARIO [seed=N]")
    script.add_argument("--scenario", help="scenario; overrides that of the script")
    script.add_argument("--pace", choices=["wall", "step"], help="pace; overrides that of the script")
    script.add_argument("--control", dest="connect", type=Path, help="control socket of a running emulator")
    _add_common(script)
    return script.parse_args(words)


def _add_common(p: argparse.ArgumentParser) -> None:
    p.add_argument("--seed", type=int, help="random seed; overrides the scenario")
    p.add_argument("--can", help=f"{BUS_HELP}; default: the bus of the emulator")
    add_scpi(p, "VISA address of an instrument; may be repeated")
    p.add_argument("--node", type=node_id, help="CANopen node of the unit (the emulator's, else 5)")
    add_json(p, STREAM)


def _shell(args: argparse.Namespace) -> int:
    from psabench.shell import command_run

    return command_run.run_shell(args)


def _script(args: argparse.Namespace) -> int:
    from psabench.shell import command_run

    return command_run.run_script(args)

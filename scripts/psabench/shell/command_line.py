"""`psabench shell` and `psabench run script`: options, and who carries the lines out."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from psabench.errors import BadInput
from psabench.shell.opening import Opening, addresses
from psabench.shell.script import Voice, run_file, run_lines, run_stream
from psabench.shell.session import Session

SHELL_EPILOG = """\
examples:
  psabench shell                                  an emulator with the scenario calibrate, in real time
  psabench shell quiet --pace step --seed 3       time moves when a line says so; the same lines give the same results
  psabench shell --connect /tmp/psa.ctl           an emulator that is there; it tells where its bus and instruments are
  psabench shell --can slcan:/dev/ttyACM0         a real device: registers, stream, can>
  psabench shell quiet --json --command 'head.turn 30' --command head.read

Lines come from the terminal, from --command, or from a pipe; the last two in step pace, as text or JSON, with the exit
status of a script: 0 done, 1 an expectation did not hold, 2 a line is wrong, 3 the bench refused or a link failed.
"""

SCRIPT_EPILOG = """\
examples:
  psabench run script session.psa                 what `save` wrote, or a hand; build servers read the exit status
  psabench run script session.psa --scenario my.yaml --json
  psabench run script session.psa --control /tmp/psa.ctl     on an emulator that is there

Exit status: 0 done and every `expect` held, 1 one did not hold, 2 a line is wrong (told with file, line and column
before anything is done), 3 the bench refused or a link failed.
"""


def add(commands: Any, formatter: Any, bus_help: str, node: Callable[[str], int]) -> None:
    """Both commands to the parsers of `psabench`."""
    shell = commands.add_parser(
        "shell",
        help="talk to a bench: instruments, device, faults, with completion",
        description="An interactive shell for the bench; docs/shell.md tells all of it.",
        formatter_class=formatter,
        epilog=SHELL_EPILOG,
    )
    shell.set_defaults(handler=_shell)
    shell.add_argument("scenario", nargs="?", help="name or file, for an emulator that is started (calibrate)")
    shell.add_argument("--pace", choices=["wall", "step"], help="of it: wall at a terminal, else step")
    shell.add_argument(
        "--command", action="append", metavar="LINE", help="carry out this line and end; may be repeated"
    )
    shell.add_argument("--connect", type=Path, metavar="CONTROL", help="control socket of an emulator that is there")
    _add_common(shell, bus_help, node)

    script = commands.add_parser(
        "run script",
        help="run a script of the shell",
        description="Run a script of the shell.",
        formatter_class=formatter,
        epilog=SCRIPT_EPILOG,
    )
    script.set_defaults(handler=_script)
    script.add_argument("file", type=Path, help="lines of the shell; the first may be: start SCENARIO [seed=N]")
    script.add_argument("--scenario", help="instead of that of the script")
    script.add_argument("--pace", choices=["wall", "step"], help="instead of that of the script")
    script.add_argument("--control", dest="connect", type=Path, help="control socket of an emulator that is there")
    _add_common(script, bus_help, node)


def _add_common(p: argparse.ArgumentParser, bus_help: str, node: Callable[[str], int]) -> None:
    p.add_argument("--seed", type=int, help="of the emulator's noise, instead of the scenario's")
    p.add_argument("--can", help=f"{bus_help}; without it that of an emulator: there, or started")
    p.add_argument(
        "--scpi",
        action="append",
        default=[],
        metavar="NAME=ADDRESS",
        help="VISA address of an instrument; may be repeated",
    )
    p.add_argument("--node", type=node, help="CANopen node of the unit (what the emulator tells, else 5)")
    p.add_argument("--json", action="store_true", help="one JSON object a line instead of text")


def _opening(args: argparse.Namespace, pace: str | None) -> Opening:
    return Opening(
        scenario=args.scenario,
        pace=args.pace or pace,
        seed=args.seed,
        connect=args.connect,
        can=args.can,
        scpi=addresses(args.scpi),
        node=args.node,
    )


def _shell(args: argparse.Namespace) -> int:
    typed = sys.stdin.isatty() and sys.stdout.isatty() and not args.command
    if typed and args.json:
        raise BadInput("--json: for --command and pipes; at a terminal the shell talks to people")
    opening = _opening(args, "wall" if typed else "step")
    for number in (signal.SIGTERM, signal.SIGHUP):  # Ctrl-C ends a command; these end the shell, and its emulator
        signal.signal(number, _leave)
    with opening.open() as bench:
        session = Session(bench, opening.start)
        if typed:
            from psabench.shell.terminal import Terminal

            return Terminal(session).run()
        voice = Voice(_say, json=args.json)
        return run_lines(session, args.command, voice) if args.command else run_stream(session, sys.stdin, voice)


def _leave(number: int, _: object) -> None:
    sys.exit(128 + number)


def _script(args: argparse.Namespace) -> int:
    return run_file(args.file, _opening(args, None), Voice(_say, json=args.json, echo=True))


def _say(text: str) -> None:
    print(text, flush=True)

"""What `psabench shell` and `psabench run script` do: who carries the lines out."""

from __future__ import annotations

import argparse
import os
import signal
import sys

from psabench.errors import BadInput, expected
from psabench.options import of_fields
from psabench.shell.connect import Opening, addresses
from psabench.shell.script import Voice, run_file, run_lines, run_stream
from psabench.shell.session import Session

LEAVE_S = 5  # real time after a signal


def _opening(args: argparse.Namespace, pace: str | None) -> Opening:
    return of_fields(Opening, args, pace=args.pace or pace, scpi=addresses(args.scpi))


def run_shell(args: argparse.Namespace) -> int:
    """Handler of `psabench shell`."""
    typed = sys.stdin.isatty() and sys.stdout.isatty() and not args.command
    if typed and args.json:
        raise BadInput(expected("--command or a pipe with --json", "a terminal", "--json"))
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
    """Ends the program, also where an event loop has swallowed the exit: the emulator ends with its standard input."""
    signal.signal(signal.SIGALRM, lambda *_: os._exit(128 + number))
    signal.alarm(LEAVE_S)
    sys.exit(128 + number)


def run_script(args: argparse.Namespace) -> int:
    """Handler of `psabench run script`."""
    return run_file(args.file, _opening(args, None), Voice(_say, json=args.json, echo=True))


def _say(text: str) -> None:
    print(text, flush=True)

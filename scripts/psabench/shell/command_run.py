"""What `psabench shell` and `psabench run script` do: who carries the lines out."""

from __future__ import annotations

import argparse
import signal
import sys

from psabench.errors import BadInput, expected
from psabench.options import of_fields
from psabench.shell.connect import Opening, addresses
from psabench.shell.script import Voice, run_file, run_lines, run_stream
from psabench.shell.session import Session

ENDING = (signal.SIGTERM, signal.SIGHUP)  # end the shell and its emulator; Ctrl-C ends a command


def _opening(args: argparse.Namespace, pace: str | None) -> Opening:
    return of_fields(Opening, args, pace=args.pace or pace, scpi=addresses(args.scpi))


def run_shell(args: argparse.Namespace) -> int:
    """Handler of `psabench shell`."""
    typed = sys.stdin.isatty() and sys.stdout.isatty() and not args.command
    if typed and args.json:
        raise BadInput(expected("--command or a pipe with --json", "a terminal", "--json"))
    opening = _opening(args, "wall" if typed else "step")
    for number in ENDING:
        signal.signal(number, lambda number, _: sys.exit(128 + number))
    with opening.open() as bench:
        session = Session(bench, opening.start)
        if typed:
            from psabench.shell.terminal import Terminal

            terminal = Terminal(session)
            for number in ENDING:
                signal.signal(number, lambda number, _: terminal.leave(128 + number))
            return terminal.run()
        voice = Voice(_say, json=args.json)
        return run_lines(session, args.command, voice) if args.command else run_stream(session, sys.stdin, voice)


def run_script(args: argparse.Namespace) -> int:
    """Handler of `psabench run script`."""
    return run_file(args.file, _opening(args, None), Voice(_say, json=args.json, echo=True))


def _say(text: str) -> None:
    print(text, flush=True)

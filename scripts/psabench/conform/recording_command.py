"""`psabench conform recording FILE...`: its options, and its report."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from psabench.conform import identity, recording, report, suite
from psabench.conform.exhibits import Exhibits
from psabench.conform.outcome import Outcome
from psabench.conform.requirements import requirements
from psabench.conform.sources.files import read_files
from psabench.conform.sources.taken import Bounds
from psabench.conform.variant import variant
from psabench.errors import BadInput
from psabench.progress import Bar
from psabench.protocol_files import dbc_node

OUT = Path("build/conform")

EPILOG = """\
FILE: at most one log of the CAN bus (.log of candump, .blf, .asc, .trc, .csv, .mf4), at most one recording of lines
(.vcd of any tool, .sr of sigrok, .bin: bytes of the line port). Together they are one recording of one bench.

What the files do not show is told as not observable, never as passed.

Exit status: 0 conforms, 1 does not, 2 bad input, 130 ended by Ctrl-C.
"""


def add(suites: Any, formatter: Any, add_board: Callable[[argparse.ArgumentParser], None]) -> None:
    """The sub-command."""
    p = suites.add_parser(
        "recording",
        help="files that were recorded at a bench",
        description="Judge recordings of a board's CAN bus and lines.",
        formatter_class=formatter,
        epilog=EPILOG,
    )
    p.set_defaults(handler=handle)
    p.add_argument("files", nargs="+", type=Path, metavar="FILE")
    add_board(p)
    p.add_argument("--node", type=int, metavar="ID", help="CANopen node (the board's default)")
    p.add_argument(
        "--line", action="append", default=[], metavar="LINE=CHANNEL", help="a line by the analyser's name: Int=D0"
    )
    p.add_argument(
        "--line-hz", type=float, metavar="HZ", help="samples a second of the lines (of .bin 8e6, else the file's)"
    )
    p.add_argument("--input", action="append", default=[], metavar="AXIS=V", help="volts at an input meanwhile: x=2.5")
    p.add_argument(
        "--max-seconds",
        type=float,
        default=Bounds().max_s,
        metavar="S",
        help="of each file, from its begin (%(default)g)",
    )
    p.add_argument("--clock-ppm", type=float, default=100.0, metavar="PPM", help="allowed between clocks (%(default)g)")
    p.add_argument("--only", nargs="+", default=[], metavar="ID", help="requirements, or beginnings: PSA2-FRAME")
    p.add_argument("--out", type=Path, metavar="FOLDER", help=f"for the report ({OUT}/recording-BOARD-PROFILE)")
    p.add_argument("--verbose", action="store_true", help="tell what passed, too")


def handle(args: argparse.Namespace) -> int:
    """Handler of `conform recording`."""
    v = variant(args.board, args.profile)
    rows = [r for r in requirements() if r.group != "host" and r.applies(v.board, v.profile)]
    rows = [r for r in rows if not args.only or r.id.startswith(tuple(args.only))]
    if not rows:
        raise BadInput(f"--only {' '.join(args.only)}: no requirement of {v.name} begins so")
    bench = _bench(args)
    suite.load()
    folder = args.out or OUT / f"recording-{v.board}-{v.profile}"
    outcomes: list[Outcome] = []
    interrupted = False
    try:
        recording.run(bench, Bar(), only=args.only, told=outcomes.append, keep=Exhibits(folder).keep)
    except KeyboardInterrupt:
        interrupted = True
    outcomes += [] if interrupted else recording.untested(rows, outcomes)
    facts = _facts(bench)
    run = report.Run(
        suite="recording", subject=v.name, facts=facts, outcomes=outcomes, rows=rows, interrupted=interrupted
    )
    page = report.write(folder, run)
    for line in [*_about(bench), *report.lines(run, everything=args.verbose)]:
        print(line)
    print(f"report: {page}", file=sys.stderr)
    return 130 if interrupted else 0 if run.conforms else 1


def _bench(args: argparse.Namespace) -> recording.Bench:
    v = variant(args.board, args.profile)
    for name, value in (("--line-hz", args.line_hz), ("--max-seconds", args.max_seconds)):
        if value is not None and not 0.0 < value < 1e12:
            raise BadInput(f"{name} {value:g}: more than 0 is wanted")
    node = dbc_node(v.family) if args.node is None else args.node
    told = dict(_pair(word, "--line") for word in args.line)
    inputs = {axis: _volts(value, axis) for axis, value in (_pair(word, "--input") for word in args.input)}
    found = read_files(args.files, v.family, told, Bounds(max_s=args.max_seconds, line_hz=args.line_hz))
    recording.check_node(found, v, node)
    return recording.Bench(recording=found, variant=v, node=node, clock_ppm=args.clock_ppm, inputs_v=inputs)


def _facts(bench: recording.Bench) -> dict[str, str]:
    facts = {"board": bench.variant.name, "node": str(bench.node), "probes": ", ".join(sorted(bench.probes))}
    facts |= {f"file {path}": said for path, said in bench.recording.files.items()}
    facts |= bench.clocks.facts()
    if bench.whose():
        facts["clocks"] = bench.whose()
    return facts | identity.suite_facts()


def _about(bench: recording.Bench) -> list[str]:
    """For the terminal: files that ended early, clocks."""
    return [*bench.recording.notes, *(f"{name}: {said}" for name, said in bench.clocks.facts().items())]


def _pair(word: str, option: str) -> tuple[str, str]:
    name, _, value = word.partition("=")
    if not name or not value:
        raise BadInput(f"{option} {word}: NAME=VALUE is wanted")
    return name, value


def _volts(text: str, axis: str) -> float:
    try:
        return float(text)
    except ValueError as e:
        raise BadInput(f"--input {axis}={text}: {text!r} is no number") from e

"""`psabench conform recording FILE...`: the recording, checked and reported."""

from __future__ import annotations

import argparse

from psabench.conform import identity, recording, report, suite
from psabench.conform.defaults import OUT
from psabench.conform.excerpts import Excerpts
from psabench.conform.profile import variant
from psabench.conform.selection import goal_of, selected, selection_of
from psabench.conform.sources.files import read_files
from psabench.conform.sources.taken import Bounds
from psabench.conform.verdict import Outcome
from psabench.errors import BadInput, expected
from psabench.link.protocol_files import dbc_node
from psabench.progress import Bar
from psabench.report import provenance


def handle(args: argparse.Namespace) -> int:
    """Handler of `conform recording`."""
    v = variant(args.board, args.profile)
    rows = selected(v, args.only)
    goal = goal_of(args, rows)
    bench = _bench(args)
    suite.load()
    folder = args.out or OUT / f"recording-{v.board}-{v.profile}"
    folder.mkdir(parents=True, exist_ok=True)  # before minutes of checks, not after
    outcomes: list[Outcome] = []
    interrupted = False
    try:
        recording.run(bench, Bar(), only=args.only, told=outcomes.append, keep=Excerpts(folder).keep)
    except KeyboardInterrupt:
        interrupted = True
    outcomes += [] if interrupted else recording.untested(rows, outcomes)
    facts = _facts(bench)
    for path in args.files:
        provenance.note_file("recording", path)
    run = report.Run(
        suite="recording",
        subject=v.name,
        facts=facts,
        outcomes=outcomes,
        rows=rows,
        interrupted=interrupted,
        goal=goal,
        selection=selection_of(("--only", args.only)),
    )
    return report.publish(folder, run, args, _about(bench))


def _bench(args: argparse.Namespace) -> recording.Bench:
    v = variant(args.board, args.profile)
    for name, value in (("--line-hz", args.line_hz), ("--max-seconds", args.max_seconds)):
        if value is not None and not 0.0 < value < 1e12:
            raise BadInput(expected("more than 0", f"{value:g}", name))
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
        raise BadInput(expected("NAME=VALUE", repr(word), option))
    return name, value


def _volts(text: str, axis: str) -> float:
    try:
        return float(text)
    except ValueError as e:
        raise BadInput(expected("a number", repr(text), f"--input {axis}")) from e

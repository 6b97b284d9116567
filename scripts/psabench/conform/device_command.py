"""`psabench conform device`: what it does, and what is printed."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from psabench.conform import identity, report, runner, suite
from psabench.conform.coverage import USUAL, Goal
from psabench.conform.defaults import OUT
from psabench.conform.dut import INPUTS_V, Addresses, Dut
from psabench.conform.excerpts import Excerpts
from psabench.conform.profile import Variant, variant
from psabench.conform.selection import goal_of, selected, selection_of
from psabench.conform.verdict import Outcome
from psabench.errors import BadInput, expected
from psabench.procedures.head_bench import Progress
from psabench.progress import Bar


def handle(args: argparse.Namespace) -> int:
    """Handler of `conform device`."""
    v = variant(args.board, args.profile)
    folder = args.out or OUT / f"{v.board}-{v.profile}"
    goal = goal_of(args, selected(v, args.only))
    run = device_run(
        v,
        _addresses(args),
        folder,
        Bar(),
        only=args.only,
        seed=args.seed,
        clock_error=args.clock_error,
        recorder_error=args.recorder_error,
        clock_ppm=args.clock_ppm,
        goal=goal,
    )
    return report.publish(folder, run, args)


def device_run(
    v: Variant,
    at: Addresses,
    folder: Path,
    progress: Progress,
    *,
    only: Sequence[str] = (),
    seed: int = 1,
    clock_error: float = 0.0,
    recorder_error: float = 0.0,
    clock_ppm: float = 100.0,
    goal: Goal = USUAL,
) -> report.Run:
    """Check a board; what shows a failure goes into the folder. Ctrl-C ends it, and what was checked stays.

    clock_error, recorder_error: ppm by which clocks of an emulator that is started are fast, and its probes'. Raises
    BadInput where `only` selects nothing, LinkError or BenchError where the board cannot be reached.
    """
    rows = selected(v, only)
    suite.load()
    outcomes: list[Outcome] = []
    interrupted = False
    with Dut.open(v, at, seed=seed, clock_ppm=clock_error, recorder_ppm=recorder_error) as dut:
        facts = identity.dut_facts(dut) | identity.suite_facts()
        keep = Excerpts(folder).keep
        try:
            runner.run(dut, progress, only=only, clock_ppm=clock_ppm, told=outcomes.append, keep=keep)
        except KeyboardInterrupt:
            interrupted = True
    return report.Run(
        suite="device",
        subject=v.name,
        facts=facts,
        outcomes=outcomes,
        rows=rows,
        interrupted=interrupted,
        goal=goal,
        selection=selection_of(("--only", only)),
    )


def _addresses(args: argparse.Namespace) -> Addresses:
    if args.can is None and (args.lines or args.bus_port or args.control or args.scpi):
        raise BadInput(expected("--can with --lines, --bus-port, --control and --scpi", "no --can", "conform device"))
    inputs = _pairs(args.input, "--input", float)
    return Addresses(
        can=args.can,
        lines=args.lines,
        line_hz=args.line_hz,
        bus_port=args.bus_port,
        scpi=_pairs(args.scpi, "--scpi", str),
        control=args.control,
        node=args.node,
        inputs_v=inputs if args.can or inputs else INPUTS_V,
        adapter=args.adapter,
        port_only=args.port_only,
    )


def _pairs(words: list[str], option: str, kind: Callable[[str], Any]) -> dict[str, Any]:
    found = {}
    for word in words:
        name, equals, value = word.partition("=")
        try:
            found[name] = kind(value)
        except ValueError as e:
            raise BadInput(expected("a number", repr(value), f"{option} {word}")) from e
        if not equals or not name or not value:
            raise BadInput(expected("NAME=VALUE", repr(word), option))
    return found

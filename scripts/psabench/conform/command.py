"""`psabench conform`: does a board, a recording of one, or a host conform?"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from psabench.conform import identity, recording_command, report, runner, suite
from psabench.conform.exhibits import Exhibits
from psabench.conform.host import command as host_command
from psabench.conform.outcome import Outcome
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.subject import INPUTS_V, Addresses, Subject
from psabench.conform.variant import Variant, variant
from psabench.errors import BadInput
from psabench.lineport import SAMPLE_HZ
from psabench.procedures.head_bench import Progress
from psabench.progress import Bar

OUT = Path("build/conform")

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
Black box: the suite sees CAN, lines and the bus port, and nothing else. What a missing probe would have shown is told
as not observable, never as passed. OUT/report.html is the report, OUT/junit.xml and OUT/conform.json the same for
machines; a failure has its waveform beside it.

Exit status: 0 conforms, 1 does not, 2 bad input, 3 the bench or a link failed, 130 ended by Ctrl-C.
"""


def add(commands: Any, formatter: Any, bus_help: str) -> None:
    """The command and its sub-commands."""
    p = commands.add_parser(
        "conform",
        help="does a board conform to its requirements?",
        description="Conformance of a board to docs/requirements.md, over its wires alone.",
        formatter_class=formatter,
        epilog=EPILOG,
    )
    suites = p.add_subparsers(required=True, metavar="SUITE")
    _add_device(suites, formatter, bus_help)
    recording_command.add(suites, formatter, _add_board)
    host_command.add(suites, formatter)
    _add_list(suites, formatter)


def _add_device(suites: Any, formatter: Any, bus_help: str) -> None:
    p = suites.add_parser(
        "device",
        help="a board, emulated or real",
        description="Test a board at the end of its wires.",
        formatter_class=formatter,
        epilog=DEVICE_EPILOG,
    )
    p.set_defaults(handler=device)
    _add_board(p)
    at = p.add_argument_group("where its wires end (without --can an emulator is started)")
    at.add_argument("--can", metavar="BUS", help=bus_help)
    at.add_argument("--lines", type=Path, metavar="PORT", help="line port: pseudo-terminal or adapter of that kind")
    at.add_argument("--line-hz", type=float, default=SAMPLE_HZ, metavar="HZ", help="its samples a second (%(default)g)")
    at.add_argument("--bus-port", type=Path, metavar="PORT", help="bus port of PSD-1, PMKA and PIK")
    at.add_argument(
        "--scpi", action="append", default=[], metavar="NAME=ADDRESS", help="an instrument: supply=TCPIP::..."
    )
    at.add_argument("--control", type=Path, metavar="SOCKET", help="control socket of an emulator: lockstep")
    at.add_argument("--node", type=int, metavar="ID", help="CANopen node (the board's default)")
    at.add_argument(
        "--input", action="append", default=[], metavar="AXIS=V", help="volts at an input while it is tested: x=2.5"
    )
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
    what = p.add_argument_group("what is tested, and where it is told")
    what.add_argument(
        "--clock-ppm", type=float, default=100.0, metavar="PPM", help="allowed to all clocks (%(default)g)"
    )
    what.add_argument("--only", nargs="+", default=[], metavar="ID", help="requirements, or beginnings: PSA2-FRAME")
    what.add_argument("--out", type=Path, metavar="FOLDER", help=f"for the report ({OUT}/BOARD-PROFILE)")
    what.add_argument("--verbose", action="store_true", help="tell what passed, too")


def _add_board(p: argparse.ArgumentParser) -> None:
    p.add_argument("--board", required=True, help="psa2, psa1, psd1, pmka, pik, pik5, pik6 or gyro")
    p.add_argument("--profile", help="which of its profiles it is said to have (psa-emu --list-profiles)")


def _add_list(suites: Any, formatter: Any) -> None:
    p = suites.add_parser(
        "list",
        help="the requirements of a board",
        description="Requirements of a board: grade, how each is seen, the sentence.",
        formatter_class=formatter,
    )
    p.set_defaults(handler=list_requirements)
    _add_board(p)


def list_requirements(args: argparse.Namespace) -> int:
    """Handler of `conform list`."""
    for r in _rows(variant(args.board, args.profile)):
        print(f"{r.id:16} {r.grade} {'/'.join(r.observe) or '-':16} {r.text}")
    return 0


def device(args: argparse.Namespace) -> int:
    """Handler of `conform device`."""
    v = variant(args.board, args.profile)
    folder = args.out or OUT / f"{v.board}-{v.profile}"
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
    )
    return _told(run, folder, everything=args.verbose)


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
) -> report.Run:
    """Judge a board; what shows a failure goes into the folder. Ctrl-C ends it, and what was judged stays.

    clock_error, recorder_error: ppm by which clocks of an emulator that is started are fast, and its probes'. Raises
    BadInput where `only` selects nothing, LinkError or BenchError where the board cannot be reached.
    """
    rows = [r for r in _rows(v) if not only or r.id.startswith(tuple(only))]
    if not rows:
        raise BadInput(f"--only {' '.join(only)}: no requirement of {v.name} begins so; psabench conform list has them")
    suite.load()
    outcomes: list[Outcome] = []
    interrupted = False
    with Subject.open(v, at, seed=seed, clock_ppm=clock_error, recorder_ppm=recorder_error) as subject:
        facts = identity.subject_facts(subject) | identity.suite_facts()
        keep = Exhibits(folder).keep
        try:
            runner.run(subject, progress, only=only, clock_ppm=clock_ppm, told=outcomes.append, keep=keep)
        except KeyboardInterrupt:
            interrupted = True
    return report.Run(
        suite="device", subject=v.name, facts=facts, outcomes=outcomes, rows=rows, interrupted=interrupted
    )


def _told(run: report.Run, folder: Path, *, everything: bool) -> int:
    page = report.write(folder, run)
    for line in report.lines(run, everything=everything):
        print(line)
    print(f"report: {page}", file=sys.stderr)
    return 130 if run.interrupted else 0 if run.conforms else 1


def _rows(v: Variant) -> list[Requirement]:
    return [r for r in requirements() if r.group != "host" and r.applies(v.board, v.profile)]


def _addresses(args: argparse.Namespace) -> Addresses:
    if args.can is None and (args.lines or args.bus_port or args.control or args.scpi):
        raise BadInput("--lines, --bus-port, --control and --scpi are of a board that is there: --can says where")
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
            raise BadInput(f"{option} {word}: {value!r} is no number") from e
        if not equals or not name or not value:
            raise BadInput(f"{option} {word}: NAME=VALUE is wanted")
    return found

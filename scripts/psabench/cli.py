"""The `psabench` command: parses, calls `run`, `record` or `decode`, prints, and gives the exit status."""

from __future__ import annotations

import argparse
import logging
import os
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from psabench import (
    comparison,
    comparison_page,
    decode,
    grading,
    gyro_grading,
    gyro_page,
    gyro_run,
    record,
    report,
    run,
)
from psabench.campaign import command as campaign_command
from psabench.can_host import open_bus
from psabench.devices import ALIASES
from psabench.errors import BadInput, BenchError
from psabench.instruments import EXAMPLES
from psabench.lineport import LineFormat
from psabench.procedures import PROCEDURES, compare_converters
from psabench.progress import Bar
from psabench.protocol_files import BOARDS, DBC_NODE, dbc_node
from psabench.shell import command_line
from psabench.wire_bench import G_MPS2

ABOUT = """\
The host's end of the bench: talks to a converter board over CAN or the line port, whether it is psa-emu or a real one.
"""

TOP_EPILOG = """\
a first hour:
  psabench run all                  calibrate an accelerometer on an emulator started for it; build/run/report.html
  psa-emu stream &                  a board on the bus, 1000 frames a second, until Ctrl-C
  psabench record run.log --can socketcand:127.0.0.1:29536 --for 10
  psabench decode run.log --out run.csv   volts against time
  psabench shell                    registers, instruments and faults at the keyboard
  psabench campaign gyrocompass     thousands of virtual gyrocompasses; build/campaign/report.html

psabench COMMAND --help says more. Exit status: 0 done and within limits, 1 done and out of limits, 2 bad input,
3 the bench or a link failed, 130 ended by Ctrl-C.
"""

BUS_HELP = """\
the bus: INTERFACE:CHANNEL[,key=value...] of python-can. Examples: socketcand:127.0.0.1:29536, slcan:/dev/pts/7,
socketcan:vcan0,fd=true"""
CAN_HELP = f"""\
{BUS_HELP}. Without it python-can's own configuration is used ($CAN_INTERFACE, $CAN_CHANNEL, ~/.canrc)"""

RUN_EPILOG = """\
examples:
  psabench run all                        every procedure, quiet and realistic, on an emulator started for it
  psabench run reversal --realisations 2  a shorter reversal
  psabench run fourier --scenario my.yaml --average 32
  psabench run compare-converters         every generation of converters through one motion, beside the exact integral
  psabench run gyrocompass                a gyro platform finds north, the article's way and a better one
  psabench run heading-hold --hours 4     and keeps heading by its gyroscope
  psabench run turns --can slcan:/dev/ttyACM0 --head TCPIP::192.0.2.7::5025::SOCKET   on the bench at these addresses

Ctrl-C ends a run; the readings taken so far stay in OUT/PROCEDURE-CONDITION.csv. Exit status 1: something measured
misses the truth by more than its limits.
"""

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
    words = command_line.words(list(sys.argv[1:] if argv is None else argv))
    if not words:
        _parser().print_help(sys.stderr)
        return BadInput.exit_status
    args = _parser().parse_args(words)
    for library in ("can", "canopen"):  # what goes wrong there is raised as well, and told in one line
        logging.getLogger(library).setLevel(logging.CRITICAL)
    handler: Callable[[argparse.Namespace], int] = args.handler
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: files are closed, the emulator ended
    try:
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


def _parser() -> argparse.ArgumentParser:
    top = argparse.ArgumentParser(prog="psabench", description=ABOUT, epilog=TOP_EPILOG, formatter_class=_Help)
    top.add_argument("--version", action="version", version=f"psabench {version('psabench')}")
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    _add_run(commands)
    _add_record(commands)
    _add_decode(commands)
    campaign_command.add(commands, _Help, natural)
    command_line.add(commands, _Help, BUS_HELP, node_id)
    return top


class _Help(argparse.RawDescriptionHelpFormatter):
    """Keeps the examples as they are written."""


def _add_run(commands: Any) -> None:
    p = commands.add_parser(
        "run",
        help="run calibration procedures over the wire and report them",
        description="Calibrate the accelerometer on the dividing head through the wire, and report.",
        formatter_class=_Help,
        epilog=RUN_EPILOG,
    )
    p.set_defaults(handler=_run)
    p.add_argument("procedure", nargs="?", help="name from --list, or all")
    p.add_argument("--list", action="store_true", help="name the procedures and their parameters")
    p.add_argument("--out", type=Path, default=Path("build/run"), help="folder of the report (%(default)s)")
    p.add_argument("--condition", choices=[*run.CONDITIONS, "both"], default="both", help="which reading (%(default)s)")
    p.add_argument("--scenario", type=Path, help="scenario for the emulator, instead of the conditions' own")
    p.add_argument("--can", help=f"{BUS_HELP}. Without it --control tells; with --head alone python-can's own")
    p.add_argument("--head", metavar="VISA-ADDRESS", help=f"the dividing head, real or emulated: {EXAMPLES}")
    p.add_argument("--control", type=Path, help="control socket of an emulator: tells CAN and head, moves time")
    p.add_argument("--truth", type=Path, help="truth socket of an emulator, asked after the run to grade it")
    p.add_argument("--node", type=node_id, default=DBC_NODE, help="CANopen node of the unit (%(default)s)")
    p.add_argument("--average", type=natural, help="samples in a reading; 0: whole 32-bit words by SDO")
    p.add_argument("--gravity", type=positive, metavar="M/S2", help=f"local g, m/s^2 (the scenario's, else {G_MPS2})")
    p.add_argument("--seed", type=int, help="seed of the emulator's noise, instead of the scenario's")
    p.add_argument("--real-time", action="store_true", help="at wall-clock pace, as a real bench would take")
    group = p.add_argument_group("parameters of the procedures", "which procedure has which: --list")
    for name, (help_text, kind) in _parameters().items():
        group.add_argument(
            _option(name), dest=f"param_{name}", type=kind, metavar=kind.__name__.upper(), help=help_text
        )


def _add_record(commands: Any) -> None:
    p = commands.add_parser(
        "record",
        help="record the bus into a log file",
        description="Record all that is on the bus; count what the stream of one node lost.",
        formatter_class=_Help,
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
        formatter_class=_Help,
        epilog=DECODE_EPILOG,
    )
    p.set_defaults(handler=_decode)
    p.add_argument("file", type=Path, help="CAN log of python-can, or samples of the line port with --line")
    p.add_argument("--out", type=Path, help="CSV file (standard output)")
    _add_board(p, "to decode")
    p.add_argument("--line", action="store_true", help="the file holds INT/DATA/CLK samples, one byte each")
    p.add_argument("--word-bits", type=int, default=32, help="word width on the line: 16, 24 or 32 (%(default)s)")
    p.add_argument("--sample-hz", type=positive, default=8e6, help="sample rate of the capture (%(default)g)")


def _parameters() -> dict[str, tuple[str, Callable[[str], Any]]]:
    """Fields of all procedures' parameters: help text and type, by name."""
    found: dict[str, tuple[str, Callable[[str], Any]]] = {}
    kinds = [procedure.params for procedure in PROCEDURES.values()]
    for params in [*kinds, *(kind for of in gyro_run.PARAMS.values() for kind in of)]:
        for name, f in params.__dataclass_fields__.items():
            kind = type(f.default) if f.default is not None else float
            unit = f", {f.metadata['unit']}" if f.metadata["unit"] else ""
            text = f"{f.metadata['help']}{unit} ({f.default})".replace("%", "%%")
            found.setdefault(name, (text, yes_no if kind is bool else kind))
    return found


def yes_no(text: str) -> bool:
    if text.lower() in ("1", "yes", "true", "on"):
        return True
    if text.lower() in ("0", "no", "false", "off"):
        return False
    raise argparse.ArgumentTypeError(f"{text!r}; expected yes or no")


def natural(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r}; expected an integer of 0 or more")
    return int(text)


def positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r}; expected a number above 0")
    return value


def board_name(text: str) -> str:
    """A board; another name of it, as psa1 or pik5, is that of the board."""
    board = ALIASES.get(text, text)
    if board not in BOARDS:
        raise argparse.ArgumentTypeError(f"{text!r}; expected {', '.join([*BOARDS, *ALIASES])}")
    return board


def node_id(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 127:
        raise argparse.ArgumentTypeError(f"{text!r}; expected a CANopen node, 1 to 127")
    return int(text)


def _list_procedures() -> None:
    for p in PROCEDURES.values():
        print(f"{p.name:10} {p.summary}")
        print(f"{'':10} {' '.join(_option(name) for name in p.params.__dataclass_fields__)}")
    print(f"{compare_converters.NAME}  {compare_converters.SUMMARY}; not in all")
    for name, summary in gyro_run.SUMMARIES.items():
        print(f"{name}  {summary}; not in all")
        print(f"{'':10} {' '.join(map(_option, gyro_run.fields_of(name)))}")


def _option(parameter: str) -> str:
    return f"--{parameter.replace('_', '-')}"


def _check_procedure(name: str | None, params: Mapping[str, Any]) -> None:
    """Raises BadInput for an unknown procedure, or one that does not have a parameter given."""
    known = f"{', '.join([*PROCEDURES, compare_converters.NAME, *gyro_run.SUMMARIES])} or all"
    if name is None:
        raise BadInput(f"run: which procedure? {known}; psabench run --list tells of each")
    if name not in (*PROCEDURES, "all"):
        raise BadInput(f"run {name}: no such procedure; {known}")
    fields = PROCEDURES[name].params.__dataclass_fields__ if name in PROCEDURES else params
    for p in params:
        if p not in fields:
            raise BadInput(f"{_option(p)}: {name} has no such parameter; it has {', '.join(map(_option, fields))}")


def _run(args: argparse.Namespace) -> int:
    if args.list:
        _list_procedures()
        return 0
    params = {k.removeprefix("param_"): v for k, v in vars(args).items() if k.startswith("param_") and v is not None}
    if args.procedure == compare_converters.NAME:
        return _compare(args, params)
    if args.procedure in gyro_run.SUMMARIES:
        return _gyro(args, params)
    _check_procedure(args.procedure, params)
    options = run.RunOptions(
        procedures=list(PROCEDURES) if args.procedure == "all" else [args.procedure],
        out=args.out,
        conditions=list(run.CONDITIONS) if args.condition == "both" else [args.condition],
        can=args.can,
        head=args.head,
        control=args.control,
        truth=args.truth,
        scenario=args.scenario,
        node=args.node,
        average=args.average,
        real_time=args.real_time,
        seed=args.seed,
        g_mps2=args.gravity,
        params=params,
    )
    page, sections = run.run(options, Bar())
    for section in sections:
        print(report.console_table(section))
    print(grading.console_comparison(sections))
    print(grading.verdict(sections))
    print(f"report: {page}")
    return 0 if report.within_limits(sections) else 1


def _compare(args: argparse.Namespace, params: Mapping[str, Any]) -> int:
    """Its units stand on one bench, their motion in the scenario: it starts an emulator and takes no addresses."""
    given = {"--can": args.can, "--head": args.head, "--control": args.control, "--truth": args.truth}
    for option in [*(o for o, v in given.items() if v is not None), *(_option(p) for p in params)]:
        raise BadInput(f"{option}: {args.procedure} has no such parameter; it has --scenario, --seed, --out")
    p = compare_converters.CompareParams()
    c = comparison.compare(args.out, p, Bar(), scenario=args.scenario, seed=args.seed)
    page = comparison_page.write(args.out, c)
    print(comparison.console_table(c))
    print(comparison.verdict(c))
    print(f"report: {page}")
    return 0 if c.within else 1


def _gyro(args: argparse.Namespace, params: Mapping[str, Any]) -> int:
    """Its platform is a unit on the bus: no dividing head, no volts to average."""
    fields = gyro_run.fields_of(args.procedure)
    known = ", ".join(["--can, --control, --truth, --scenario, --seed, --real-time, --out", *map(_option, fields)])
    given = {"--head": args.head, "--average": args.average, "--gravity": args.gravity}
    for option in [*(o for o, v in given.items() if v is not None), *(_option(p) for p in params if p not in fields)]:
        raise BadInput(f"{option}: {args.procedure} has no such parameter; it has {known}")
    options = gyro_run.GyroOptions(
        procedure=args.procedure,
        out=args.out,
        can=args.can,
        control=args.control,
        truth=args.truth,
        scenario=args.scenario,
        seed=args.seed,
        real_time=args.real_time,
        params=params,
    )
    sections = gyro_run.run(options, Bar())
    page = gyro_page.write(args.out, sections, gyro_run.facts(options))
    for section in sections:
        print(gyro_grading.console_table(section))
    print(gyro_grading.verdict(sections))
    print(f"report: {page}")
    return 0 if gyro_grading.within_limits(sections) else 1


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

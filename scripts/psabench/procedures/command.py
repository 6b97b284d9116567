"""`psabench run`: a parser for each procedure with its own options, and what is printed.

`run turns` is one command of two words (`words`): each procedure has its own help, and rejects the options of others.
"""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psabench.boards.registry import DBC_NODE
from psabench.errors import BadInput, expected
from psabench.instruments import EXAMPLES
from psabench.options import KEPT, Parser, natural, node_id, of_fields, positive, yes_no
from psabench.procedures.run_table import (
    COMPARE,
    CONDITIONS,
    COVARIANCE,
    G_MPS2,
    ON_THE_HEAD,
    ON_THE_PLATFORM,
    SECONDARY,
    SINS,
    SNAKE,
    THERMAL,
)
from psabench.progress import Bar
from psabench.shell import command_line

if TYPE_CHECKING:
    from psabench.estimate.uncertainty import Estimate
    from psabench.procedures.head_bench import Progress

EPILOG = """\
psabench run PROCEDURE --help lists its options with units and defaults, and examples.

Exit status: 0 done and within limits, 1 a result is off by more than its limits or is doubtful,
2 bad input, 3 the bench or a link failed, 130 ended by Ctrl-C.
"""

NOTES_HEAD = """
Without --head or --control an emulator is started for each condition. Ctrl-C ends a run; the readings so far stay
in OUT/PROCEDURE-CONDITION.csv. Exit status 1: a result is off by more than its limits.
"""

NOTES_PLATFORM = """
Without --can or --control an emulator is started for each reading, with the scenario gyrocompass. Exit status 1:
a result is off by more than its limits, or is doubtful; the reason is printed.
"""

NOTES_CHAMBER = """
Without --head, --chamber or --control an emulator is started, with the scenario quartz_run_in, whose chain and head
are exact. Each recording is in OUT/thermal.csv as soon as it is made. Exit status 1: a compensation is off the true
outputs by more than its limits.
"""

NOTES_OUTPUTS = """
Exit status 1: a figure is out of its limits. docs/procedures/sins_secondary.md derives the method.
"""

ALL = "all"
SCRIPT = "script"  # psabench.shell.command_line has its parser
FLAGS = ("-h", "--help", "--list", "--real-time", "-v", "--verbose")  # the options that take no value

# Options of more than one procedure.
COMMON: Mapping[str, Mapping[str, Any]] = {
    "--condition": {
        "choices": [*CONDITIONS, "both"],
        "default": "both",
        "help": "emulated bench (%(default)s)",
    },
    "--scenario": {"type": Path, "metavar": "FILE", "help": "scenario of the emulator (the procedure's default)"},
    "--passport": {
        "type": Path,
        "metavar": "FILE",
        "help": "nominal values of the sensor to compare with: YAML of u0_v, kx_v_per_g ... (the scenario's)",
    },
    "--can": {
        "metavar": "BUS",
        "help": "CAN bus of an existing bench, as INTERFACE:CHANNEL[,key=value...] of python-can: "
        "socketcand:127.0.0.1:29536, slcan:/dev/pts/7, socketcan:vcan0,fd=true. Default: the bus that --control names",
    },
    "--head": {
        "metavar": "VISA-ADDRESS",
        "help": f"dividing head, real or emulated: {EXAMPLES}. Bus without --can: python-can's configuration",
    },
    "--control": {
        "type": Path,
        "metavar": "SOCKET",
        "help": "control socket of a running emulator; its bus and instruments are used",
    },
    "--truth": {
        "type": Path,
        "metavar": "SOCKET",
        "help": "truth socket of an emulator, read after the run to compare the results",
    },
    "--node": {"type": node_id, "default": DBC_NODE, "metavar": "N", "help": "CANopen node of the unit (%(default)s)"},
    "--average": {
        "type": natural,
        "metavar": "N",
        "help": f"samples per reading; 0: whole 32-bit words by SDO (quiet {CONDITIONS['quiet'].average}, "
        f"else {CONDITIONS['realistic'].average})",
    },
    "--gravity": {
        "type": positive,
        "metavar": "M/S2",
        "help": f"local g, m/s^2 (the scenario's, else {G_MPS2})",
    },
    "--seed": {"type": int, "metavar": "N", "help": "random seed; overrides the scenario"},
    "--real-time": {"action": "store_true", "help": "run at wall-clock pace"},
    "--record": {
        "type": Path,
        "metavar": "FILE",
        "help": "store the frames of the run in a log (.log .blf .asc ...) and its calls in FILE.calls.csv",
    },
    "--replay": {"type": Path, "metavar": "FILE", "help": "run on such a log instead of a bench"},
    "--out": {"type": Path, "default": Path("build/run"), "metavar": "FOLDER", "help": "report folder (%(default)s)"},
    "--lcm": {
        "metavar": "URL",
        "help": "publish progress and results with LCM: udpm://GROUP:PORT, or file://PATH an event log",
    },
    "--verbose": {"action": "store_true", "help": "print the tables of results as well"},
}
# Of the calibration on a rate table alone.
ON_THE_TABLE: Mapping[str, Mapping[str, Any]] = {
    "--table": {"metavar": "VISA-ADDRESS", "help": f"rate table, real or emulated: {EXAMPLES}"},
    "--data": {"type": Path, "metavar": "FILE", "help": "increments of a recording in place of a bench"},
    "--layout": {
        "type": Path,
        "metavar": "FILE",
        "help": "what the recording's columns are (docs/procedures/sins_data.md)",
    },
    "--angles": {"type": Path, "metavar": "FILE", "help": "angles of the table, as table_angles.csv of a run"},
}
# Recordings of a unit that navigates.
FROM_OUTPUTS: Mapping[str, Mapping[str, Any]] = {
    "--first": {
        "type": Path,
        "metavar": "FILE",
        "help": "recording of the experiment that calibrates: what the unit gave out, CSV",
    },
    "--second": {
        "type": Path,
        "metavar": "FILE",
        "help": "recording of the experiment that is compensated; none: calibrate alone",
    },
}
# Of the thermal run alone.
IN_THE_CHAMBER: Mapping[str, Mapping[str, Any]] = {
    "--schedule": {"metavar": "NAME|FILE", "help": "quick, full or a YAML file (quick)"},
    "--resume": {"type": Path, "metavar": "FOLDER", "help": "continue the run of this folder where it was interrupted"},
    "--chamber": {"metavar": "VISA-ADDRESS", "help": f"thermal chamber, real or emulated: {EXAMPLES}"},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """Of a procedure."""

    fields: Mapping[str, Any] = field(default_factory=dict)  # of its parameters' dataclasses
    defaults: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # others for its fields, by who has them


@dataclass(frozen=True, kw_only=True)
class Command:
    """A procedure as the command line has it."""

    name: str
    summary: str
    handler: Callable[[argparse.Namespace], int]
    common: Sequence[str]  # of COMMON
    load: Callable[[], Parameters] = Parameters  # imports the procedure, and NumPy with it
    examples: str
    notes: str = ""
    kept: str = ""  # when it is interrupted

    @cached_property
    def parameters(self) -> Parameters:
        return self.load()


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench run`. Raises BadInput."""
    name, rest = words(argv)
    if name == SCRIPT:
        return command_line.parse_script(rest)
    return (_parser_of(COMMANDS[name]) if name else _parser()).parse_args(rest)


def _parser() -> Parser:
    """Of `run` without a procedure."""
    p = Parser(
        prog="psabench run",
        usage="psabench run [-h] [--list] PROCEDURE [option...]",
        description="Run a procedure over CAN, compare its results with the truth where it is known, and write a "
        "report.\n\n" + _table(),
        epilog=EPILOG,
    )
    p.set_defaults(handler=_without_procedure)
    p.add_argument("--list", action="store_true", help="list the procedures and their parameters")
    p.add_argument("procedure", nargs="?", metavar="PROCEDURE", help=argparse.SUPPRESS)
    return p


def words(argv: Sequence[str]) -> tuple[str, list[str]]:
    """The procedure, wherever among its options it is, and the other words; "": none, and what `run` takes."""
    rest = list(argv)
    if "--list" in rest:
        return "", ["--list"]
    at = _procedure_at(rest)
    if at is None:
        return "", [w for w in rest if w in ("-h", "--help")]
    name = rest.pop(at)
    return (name, rest) if name in (*COMMANDS, SCRIPT) else ("", [name])


def _procedure_at(rest: Sequence[str]) -> int | None:
    """Where the first word is that is neither an option nor the value of one."""
    k = 0
    while k < len(rest):
        word = rest[k]
        if not word.startswith("-"):
            return k
        k += 1 if "=" in word or any(flag.startswith(word) for flag in FLAGS) else 2
    return None


def _parser_of(command: Command) -> Parser:
    p = Parser(
        prog=f"psabench run {command.name}",
        usage=f"psabench run {command.name} [-h] [option...]",
        description=f"{command.summary[0].upper()}{command.summary[1:]}.",
        epilog=f"examples:\n{command.examples}{command.notes}",
    )
    p.set_defaults(handler=command.handler, procedure=command.name, kept=command.kept)
    taken = command.parameters
    if taken.fields:
        group = p.add_argument_group(f"parameters of {command.name}")
        for name, f in taken.fields.items():
            others = {label: changed.get(name, f.default) for label, changed in taken.defaults.items()}
            _add_parameter(group, name, f, {k: v for k, v in others.items() if v != f.default})
    group = p.add_argument_group("the bench and the report")
    for option in command.common:
        how = {**COMMON, **IN_THE_CHAMBER, **ON_THE_TABLE, **FROM_OUTPUTS}[option]
        group.add_argument(*(["-v"] if option == "--verbose" else []), option, **how)
    return p


def _add_parameter(group: Any, name: str, f: Any, others: Mapping[str, Any]) -> None:
    unit = f.metadata["unit"]
    kind = type(f.default) if f.default is not None else float
    metavar = unit.upper() or {bool: "YES|NO", int: "N", float: "X", str: "WORD"}[kind]
    defaults = " ".join(x for x in (_default(f.default), unit) if x)
    defaults += "".join(f"; {label} {_default(value)}" for label, value in others.items())
    text = f"{f.metadata['help']} ({defaults})".replace("%", "%%")
    group.add_argument(
        _option(name), dest=f"param_{name}", type=yes_no if kind is bool else kind, metavar=metavar, help=text
    )


def _default(value: Any) -> str:
    if value is None or isinstance(value, bool):
        return {None: "none", True: "yes", False: "no"}[value]
    return f"{value:g}" if isinstance(value, float) else str(value)


def _table() -> str:
    rows = [*((c.name, c.summary) for c in COMMANDS.values()), (SCRIPT, "lines of the shell from a file")]
    indent = 4 + max(len(name) for name, _ in rows)
    filled = (
        textwrap.fill(f"  {name:{indent - 2}}{text}", width=100, subsequent_indent=" " * indent) for name, text in rows
    )
    return "\n".join(["procedures:", *filled])


def _option(parameter: str) -> str:
    return f"--{parameter.replace('_', '-')}"


def _without_procedure(args: argparse.Namespace) -> int:
    if args.list:
        for c in COMMANDS.values():
            print(f"{c.name}: {c.summary}")
            print(f"  {' '.join([*map(_option, c.parameters.fields), *c.common])}")
        return 0
    known = f"{', '.join(COMMANDS)} or {SCRIPT}"
    if args.procedure is None:
        raise BadInput(expected(f"{known} (psabench run --help explains them)", "none", "run"))
    raise BadInput(expected(known, repr(args.procedure), "run"))


def _params(args: argparse.Namespace) -> dict[str, Any]:
    """The parameters that were given."""
    return {k.removeprefix("param_"): v for k, v in vars(args).items() if k.startswith("param_") and v is not None}


def _calibrate(args: argparse.Namespace) -> int:
    from psabench.procedures import run
    from psabench.procedures.registry import PROCEDURES
    from psabench.report import calibration as report
    from psabench.report import grading
    from psabench.report.nominal import console_nominal

    options = of_fields(
        run.RunOptions,
        args,
        procedures=list(PROCEDURES) if args.procedure == ALL else [args.procedure],
        conditions=list(CONDITIONS) if args.condition == "both" else [args.condition],
        g_mps2=args.gravity,
        params=_params(args),
    )
    with progress_of(args) as told:
        page, sections, nominal = run.run(options, told.progress)
        for s in sections:
            told.result(s.result.procedure, s.label, s.result.estimates, report.within_limits([s]))
    if args.verbose:
        for section in sections:
            print(report.console_table(section))
        print(console_nominal(sections, nominal), end="")
    print(grading.verdict(sections))
    print(f"report: {page}")
    return 0 if report.within_limits(sections) else 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """Who follows a run."""

    progress: Progress
    result: Callable[[str, str, Sequence[Estimate], bool], None]


@contextmanager
def progress_of(args: argparse.Namespace) -> Iterator[Told]:
    """A bar, and LCM where --lcm asks for it."""
    if args.lcm is None:
        yield Told(progress=Bar(), result=lambda *_: None)
        return
    from psabench.lcm.channel import publisher
    from psabench.lcm.progress import LcmProgress, publish_result

    with publisher(args.lcm) as out:
        yield Told(progress=LcmProgress(out, args.procedure, Bar()), result=partial(publish_result, out))


def _compare(args: argparse.Namespace) -> int:
    """Its units stand on one bench, their motion in the scenario: it starts an emulator and takes no addresses."""
    from psabench.logs.call_log import refuse_beside_replay
    from psabench.procedures import compare_converters, comparison
    from psabench.report import comparison_page

    p = compare_converters.CompareParams()
    if args.replay:
        refuse_beside_replay({"--record": args.record, "--scenario": args.scenario, "--seed": args.seed})
        c = comparison.replay_comparison(args.out, p, Bar(), args.replay)
    else:
        c = comparison.compare(args.out, p, Bar(), scenario=args.scenario, seed=args.seed, record=args.record)
    page = comparison_page.write(args.out, c)
    if args.verbose:
        print(comparison.console_table(c))
    print(comparison.verdict(c))
    print(f"report: {page}")
    return 0 if c.within else 1


def _gyro(args: argparse.Namespace) -> int:
    """Its platform is a unit on the bus: no dividing head, no volts to average."""
    from psabench.procedures import gyro_run
    from psabench.report import gyro_grading, gyro_page

    options = of_fields(gyro_run.GyroOptions, args, params=_params(args))
    with progress_of(args) as told:
        sections = gyro_run.run(options, told.progress)
        for s in sections:
            told.result(options.procedure, s.label, s.result.estimates, gyro_grading.within_limits([s]))
    page = gyro_page.write(args.out, sections, gyro_run.facts(options))
    if args.verbose:
        for section in sections:
            print(gyro_grading.console_table(section))
    else:
        for section in sections:
            print("".join(f"DOUBT: {section.label}: {d}\n" for d in gyro_grading.doubts(section)), end="")
    print(gyro_grading.verdict(sections))
    print(f"report: {page}")
    return 0 if gyro_grading.within_limits(sections) else 1


def _run_thermal(args: argparse.Namespace) -> int:
    """Hours in a chamber: what it records is kept as it comes, and it can be resumed."""
    from psabench.report import thermal_grading, thermal_page
    from psabench.thermal import run as thermal_run

    options = of_fields(thermal_run.ThermalOptions, args, params=_params(args))
    with thermal_run.run_thermal(options, Bar()) as done:
        truth = thermal_grading.read_truth(done.folder, done.result.recordings)
        report = thermal_grading.graded_report(done.result, truth, done.facts)
        page = thermal_page.write_page(done.folder.path, report)
    if args.verbose:
        print(thermal_grading.console_lines(report))
    print(thermal_grading.state_verdict(report))
    print(f"report: {page}")
    return 0 if thermal_grading.within_limits(report) else 1


def _calibrate_sins(args: argparse.Namespace) -> int:
    """Minutes on a table through the wire, or a recording of them."""
    from psabench.report.grading import aligned
    from psabench.sins import calibration_page
    from psabench.sins.calibration_params import SinsOptions
    from psabench.sins.calibration_run import run_calibration

    done = run_calibration(of_fields(SinsOptions, args, params=_params(args)), Bar())
    page = calibration_page.write_page(args.out, done)
    if args.verbose:
        print("\n".join(aligned(calibration_page.table_rows(done))))
    print("".join(f"DOUBT: {d}\n" for d in done.result.doubts), end="")
    print(calibration_page.verdict_words(done))
    print(f"report: {page}")
    return 0 if done.within else 1


def _predict_sins(args: argparse.Namespace) -> int:
    """A covariance: no bench, no data."""
    from psabench.procedures.result import made_params
    from psabench.sins import covariance_run

    study = covariance_run.run_study(made_params(covariance_run.CovarianceParams, args.procedure, _params(args)))
    print(covariance_run.console_lines(study))
    print(f"report: {covariance_run.write_page(args.out, study)}")
    return 0


def _snake(args: argparse.Namespace) -> int:
    from psabench.procedures.result import made_params
    from psabench.sins import snake, snake_page

    found = snake.run_snake(made_params(snake.SnakeParams, snake.NAME, _params(args)))
    print("\n".join(snake_page.console_lines(found)))
    print(snake_page.verdict_words(found))
    print(f"report: {snake_page.write_page(args.out, found)}")
    return 1 if found.within is False else 0


def _secondary(args: argparse.Namespace) -> int:
    from psabench.procedures.result import made_params
    from psabench.sins import secondary_page, secondary_run

    params = made_params(secondary_run.SecondaryParams, secondary_run.NAME, _params(args))
    found = secondary_run.run_secondary(params, args.first, args.second)
    print("\n".join(secondary_page.console_lines(found)))
    print(secondary_page.verdict_words(found))
    print(f"report: {secondary_page.write_page(args.out, found)}")
    return 1 if found.within is False else 0


# What each takes of COMMON.
_STARTED = ("--scenario", "--seed", "--record", "--replay", "--out", "--verbose")
_PLATFORM = (
    *("--can", "--control", "--truth", "--scenario", "--seed", "--real-time"),
    *("--record", "--replay", "--out", "--lcm", "--verbose"),
)
_HEAD = tuple(COMMON)
_CHAMBER = (
    *("--schedule", "--resume", "--can", "--head", "--chamber", "--control", "--truth", "--scenario", "--node"),
    *("--gravity", "--seed", "--real-time", "--out", "--verbose"),
)

_EXAMPLES: Mapping[str, str] = {
    "turns": """\
  psabench run turns
  psabench run turns --can slcan:/dev/ttyACM0 --head TCPIP::192.0.2.7::5025::SOCKET   on the bench at these addresses
""",
    "fourier": """\
  psabench run fourier
  psabench run fourier --scenario my.yaml --average 32
""",
    "reversal": """\
  psabench run reversal
  psabench run reversal --condition quiet --realisations 2   a shorter one, without noise
""",
    ALL: """\
  psabench run all             quiet and realistic, on emulators started for it
  psabench run all --condition quiet --realisations 2
""",
    COMPARE[0]: """\
  psabench run compare-converters --out build/run/converters
""",
    "gyrocompass": """\
  psabench run gyrocompass                                   the article's way and a better one
  psabench run gyrocompass --reading article --sequence 0,120,240 --window-s 20
  psabench run gyrocompass --scenario my.yaml --latitude-deg 60   a scenario of yours, at its latitude
  psabench run gyrocompass --can slcan:/dev/ttyACM0 --latitude-deg 50.45   the platform on this bus
""",
    "heading-hold": """\
  psabench run heading-hold
  psabench run heading-hold --reading improved --hours 4 --speed-kmh 500 --track-deg 90   in flight to the east
""",
    THERMAL[0]: """\
  psabench run thermal                       a quick look, on an emulator started for it
  psabench run thermal --schedule full --out build/run/qa-0001
  psabench run thermal --resume build/run/qa-0001
""",
    SINS[0]: """\
  psabench run sins-calibration                     the article's plan on an emulated precise table, 45 minutes
  psabench run sins-calibration --stand no          on a coarse table, which shows no angles
  psabench run sins-calibration --data build/run/increments.bin --layout build/run/increments.yaml --stand no
  psabench nav apply run.csv --calibration build/run/result.json --out corrected.csv
""",
    SECONDARY[0]: """\
  psabench campaign sins-secondary --out build/sins                  two recordings of a drawn unit
  psabench run sins-calibration-secondary --first build/sins/first.csv --second build/sins/second.csv
""",
    SNAKE[0]: """\
  psabench run sins-snake
  psabench run sins-snake --flight my_flight.yaml --plan two_rates
""",
    COVARIANCE[0]: """\
  psabench run sins-covariance                                the article's two tables in every reading of its noise
  psabench run sins-covariance --plan mine.yaml --azimuth-deg 20
  psabench run sins-covariance --plan two_rates --lever 3     lever arms of the accelerometers
""",
}


def _of_the_head(name: str) -> Parameters:
    from psabench.budget.accuracy import EXACT, BenchAccuracy
    from psabench.procedures.registry import PROCEDURES

    fields = {**PROCEDURES[name].params.__dataclass_fields__, **BenchAccuracy.__dataclass_fields__}
    return Parameters(fields=fields, defaults={c.label: EXACT for c in CONDITIONS.values() if c.exact})


def _of_all() -> Parameters:
    from psabench.budget.accuracy import EXACT

    each = {name: _of_the_head(name).fields for name in ON_THE_HEAD}
    return Parameters(
        fields={name: f for fields in each.values() for name, f in fields.items()},
        defaults={label: {name: f.default for name, f in fields.items()} for label, fields in each.items()}
        | {c.label: EXACT for c in CONDITIONS.values() if c.exact},
    )


def _of_the_platform(name: str) -> Parameters:
    from psabench.procedures import gyro_params, gyrocompass_params

    return Parameters(fields=gyro_params.fields_of(name), defaults=gyrocompass_params.READINGS)


def _of_the_chamber() -> Parameters:
    from psabench.budget.accuracy import BenchAccuracy

    # How far the board is from 25 degC is the run's own matter.
    return Parameters(fields={k: f for k, f in BenchAccuracy.__dataclass_fields__.items() if k != "chain_off_k"})


def _of_the_sins() -> Parameters:
    from psabench.sins.calibration_params import CalibrationParams

    return Parameters(fields=CalibrationParams.__dataclass_fields__)


def _of_the_covariance() -> Parameters:
    from psabench.sins.covariance_run import CovarianceParams

    return Parameters(fields=CovarianceParams.__dataclass_fields__)


def _of_outputs(name: str) -> Parameters:
    from psabench.sins import secondary_run, snake

    kind: type[Any] = {snake.NAME: snake.SnakeParams, secondary_run.NAME: secondary_run.SecondaryParams}[name]
    return Parameters(fields=kind.__dataclass_fields__)


def _commands() -> Iterator[Command]:
    every = f"{', '.join(ON_THE_HEAD)}: an accelerometer on the dividing head, each procedure on each bench"
    for name, summary in (*ON_THE_HEAD.items(), (ALL, every)):
        yield Command(
            name=name,
            summary=summary,
            handler=_calibrate,
            common=_HEAD,
            load=_of_all if name == ALL else partial(_of_the_head, name),
            examples=_EXAMPLES[name],
            notes=NOTES_HEAD,
            kept=KEPT,
        )
    name, summary = COMPARE
    yield Command(name=name, summary=summary, handler=_compare, common=_STARTED, examples=_EXAMPLES[name])
    name, summary = SINS
    yield Command(
        name=name,
        summary=summary,
        handler=_calibrate_sins,
        common=("--scenario", "--can", "--control", *ON_THE_TABLE, "--seed", "--real-time", "--out", "--verbose"),
        kept="what was measured is in OUT",
        load=_of_the_sins,
        examples=_EXAMPLES[name],
    )
    name, summary = COVARIANCE
    yield Command(
        name=name,
        summary=summary,
        handler=_predict_sins,
        common=("--out",),
        load=_of_the_covariance,
        examples=_EXAMPLES[name],
    )
    for (name, summary), handler, takes in ((SNAKE, _snake, ()), (SECONDARY, _secondary, tuple(FROM_OUTPUTS))):
        yield Command(
            name=name,
            summary=summary,
            handler=handler,
            common=(*takes, "--out"),
            load=partial(_of_outputs, name),
            examples=_EXAMPLES[name],
            notes=NOTES_OUTPUTS,
        )
    name, summary = THERMAL
    yield Command(
        name=name,
        summary=summary,
        handler=_run_thermal,
        common=_CHAMBER,
        load=_of_the_chamber,
        examples=_EXAMPLES[name],
        notes=NOTES_CHAMBER,
        kept=f"{KEPT}; --resume continues the run",
    )
    for name, summary in ON_THE_PLATFORM.items():
        yield Command(
            name=name,
            summary=summary,
            handler=_gyro,
            common=_PLATFORM,
            load=partial(_of_the_platform, name),
            examples=_EXAMPLES[name],
            notes=NOTES_PLATFORM,
        )


COMMANDS: Mapping[str, Command] = {c.name: c for c in _commands()}

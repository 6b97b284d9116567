"""The procedures of `psabench run`: of each its options, handler, parameters, examples."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

from psabench.options import KEPT
from psabench.procedures.command_line import handlers
from psabench.procedures.command_line.bench_options import (
    COMMON,
    CONVERTERS_ALONE,
    FROM_OUTPUTS,
    IN_A_CLIMATE,
    OF_A_BATCH,
    OF_A_REPORT,
    ON_THE_TABLE,
)
from psabench.procedures.command_line.offered import (
    ALL,
    COMPARE,
    CONDITIONS,
    COVARIANCE,
    KOI_FLIGHT,
    KOI_SEASON,
    MEMS_GYRO,
    ON_THE_HEAD,
    ON_THE_PLATFORM,
    SECONDARY,
    SINS,
    SNAKE,
    THERMAL,
)

INSTRUMENTS = ("head", "table", "chamber", "supply")  # options of this name take the address of one

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

NOTES_GYRO = """
Without --can, --table or --control an emulator is started, with the scenario mems_gyro. Exit status 1: a result is off
by more than 2 U, or is doubtful; the reason is printed.
"""

NOTES_OUTPUTS = """
Exit status 1: a figure is out of its limits. docs/procedures/sins_secondary.md derives the method.
"""


NOTES_FLIGHT = """
Without --can or --control an emulator is started, with the scenario koi_flight. Exit status 1: the flight has no
weight for the unit's passport; the reasons are printed.
"""


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
    common: Sequence[str]  # of EVERY
    own: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # of this one alone, whatever others call so
    load: Callable[[], Parameters] = Parameters  # imports the procedure, and NumPy with it
    examples: str
    notes: str = ""
    kept: str = ""  # when it is interrupted
    board: str = ""  # that a bench must have which is there already; "": it needs none, or starts its own
    on: str = ""  # where the board is mounted, as the emulator calls it; "": wherever it is
    axes: int = 1  # of the rate table, where it takes one

    @property
    def takes_bench(self) -> bool:
        """Whether it runs on an emulator that runs already."""
        return bool(self.board) and "--control" in self.common

    @property
    def instruments(self) -> tuple[str, ...]:
        """That such a bench must have."""
        return tuple(name for name in INSTRUMENTS if f"--{name}" in self.common)

    @cached_property
    def parameters(self) -> Parameters:
        return self.load()


# What each takes of COMMON.
_STARTED = ("--scenario", "--seed", "--record", "--replay", "--out", "--verbose")
_PLATFORM = (
    *("--can", "--control", "--truth", "--scenario", "--seed", "--real-time"),
    *("--record", "--replay", "--out", "--lcm", "--verbose"),
)
_HEAD = tuple(COMMON)
_TABLE = ("--scenario", "--can", "--control", *ON_THE_TABLE, "--seed", "--real-time", "--out", "--verbose")
_CHAMBER = (
    *("--schedule", "--resume", "--fresh", "--can", "--head", "--chamber", "--control", "--truth", "--scenario"),
    *("--node", "--gravity", "--seed", "--real-time", "--out", "--verbose"),
)

_FLIGHT = ("--scenario", "--can", "--control", "--receiver", "--data", "--seed", "--real-time", "--out", "--verbose")

_EXAMPLES: Mapping[str, str] = {
    "turns": """\
  psabench run turns
  psabench run turns --climate      at -40 to 85 degC in a chamber, on an emulator started for it
  psabench run turns --batch        twelve sensors on four units in one pass, a passport for each
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
  psabench run compare-converters --chamber --out build/run/converters   drift of zero and scale, -60 to +85 degC
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
  psabench run sins-calibration-secondary --scenario sins_secondary --latitude-deg 55.7 --longitude-deg 37.5
""",
    MEMS_GYRO[0]: """\
  psabench run mems-gyro                      80 minutes of the bench, half a minute here
  psabench run mems-gyro --series 4 --rest-s 7200 --out build/gyro
  psabench run mems-gyro --can slcan:/dev/ttyACM0 --table TCPIP::192.0.2.8::5025::SOCKET --real-time
""",
    SNAKE[0]: """\
  psabench run sins-snake
  psabench run sins-snake --flight my_flight.yaml --plan two_rates
""",
    KOI_FLIGHT[0]: """\
  psabench run koi-flight --out build/koi                    an hour and 20 minutes, in a minute
  psabench run koi-flight --data build/koi --corrects no     the same flight from its recording, without a correction
  psabench run koi-flight --can slcan:/dev/ttyACM0 --receiver /dev/ttyUSB0   on these ports, in real time
""",
    KOI_SEASON[0]: """\
  psabench run koi-season --out build/season --store build/season/passports.sqlite
  psabench run koi-season --out build/season --store build/season/passports.sqlite --flights 12   four more
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


def _of_the_gyro() -> Parameters:
    from psabench.mems_gyro.params import MemsGyroParams

    return Parameters(fields=MemsGyroParams.__dataclass_fields__)


def _of_a_flight() -> Parameters:
    from psabench.koi.wire.params import KoiParams

    return Parameters(fields=KoiParams.__dataclass_fields__)


def _of_a_season() -> Parameters:
    from psabench.koi.wire.season import SeasonParams

    return Parameters(fields=SeasonParams.__dataclass_fields__)


def _of_the_covariance() -> Parameters:
    from psabench.sins.covariance_run import CovarianceParams

    return Parameters(fields=CovarianceParams.__dataclass_fields__)


def _of_outputs(name: str) -> Parameters:
    from psabench.sins import snake
    from psabench.sins.secondary import run as secondary_run

    kind: type[Any] = {snake.NAME: snake.SnakeParams, secondary_run.NAME: secondary_run.SecondaryParams}[name]
    return Parameters(fields=kind.__dataclass_fields__)


def _command(
    offered: tuple[str, str], handler: Callable[[argparse.Namespace], int], common: Sequence[str], **how: Any
) -> Command:
    name, summary = offered
    taken = (*common, *OF_A_REPORT)
    return Command(name=name, summary=summary, handler=handler, common=taken, examples=_EXAMPLES[name], **how)


def _on_the_head() -> Iterator[Command]:
    every = f"{', '.join(ON_THE_HEAD)}: an accelerometer on the dividing head, each procedure on each bench"
    for name, summary in (*ON_THE_HEAD.items(), (ALL, every)):
        load = _of_all if name == ALL else partial(_of_the_head, name)
        own = {} if name == ALL else {**IN_A_CLIMATE, **(OF_A_BATCH if name == "turns" else {})}
        how: dict[str, Any] = {"own": own, "load": load, "notes": NOTES_HEAD, "kept": KEPT}
        yield _command((name, summary), handlers.run_on_head, _HEAD, board="psa2", on="head", **how)


def _on_the_platform() -> Iterator[Command]:
    for name, summary in ON_THE_PLATFORM.items():
        load = partial(_of_the_platform, name)
        how: dict[str, Any] = {"load": load, "notes": NOTES_PLATFORM, "board": "gyro"}
        yield _command((name, summary), handlers.run_on_platform, _PLATFORM, **how)


_THERMAL = _command(
    THERMAL,
    handlers.run_in_chamber,
    common=_CHAMBER,
    load=_of_the_chamber,
    notes=NOTES_CHAMBER,
    kept=f"{KEPT}; --resume continues the run",
    board="psa2",
    on="head",
)
_SINS = (
    _command(
        SINS,
        handlers.calibrate_sins,
        common=_TABLE,
        load=_of_the_sins,
        kept="what was measured is in OUT",
        board="bins",
        on="table",
        axes=3,
    ),
    _command(
        MEMS_GYRO,
        handlers.calibrate_gyro,
        common=("--scenario", "--can", "--control", "--table", "--seed", "--real-time", "--out", "--verbose"),
        load=_of_the_gyro,
        notes=NOTES_GYRO,
        kept="what was measured is in OUT/dwells.csv",
        board="psa2",
        on="table",
        axes=3,
    ),
    _command(COVARIANCE, handlers.predict_sins, common=("--out",), load=_of_the_covariance),
    _command(
        SNAKE,
        handlers.fly_snake,
        common=("--out",),
        load=partial(_of_outputs, SNAKE[0]),
        notes=NOTES_OUTPUTS,
    ),
    _command(
        SECONDARY,
        handlers.calibrate_secondary,
        common=(*FROM_OUTPUTS, "--scenario", "--can", "--table", "--control", "--seed", "--out"),
        load=partial(_of_outputs, SECONDARY[0]),
        notes=NOTES_OUTPUTS,
    ),
)

_KOI = (
    _command(
        KOI_FLIGHT,
        handlers.fly_koi,
        common=_FLIGHT,
        load=_of_a_flight,
        notes=NOTES_FLIGHT,
        kept="what came is in OUT; --data goes through it",
    ),
    _command(
        KOI_SEASON,
        handlers.fly_season,
        common=("--store", "--seed", "--out"),
        load=_of_a_season,
        kept="the flight is incomplete; the same command goes on with the next one",
    ),
)

COMMANDS: Mapping[str, Command] = {
    c.name: c
    for c in (
        *_on_the_head(),
        _command(COMPARE, handlers.compare_units, common=_STARTED, own=CONVERTERS_ALONE),
        *_SINS,
        *_KOI,
        _THERMAL,
        *_on_the_platform(),
    )
}

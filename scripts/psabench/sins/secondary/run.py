"""`psabench run sins-calibration-secondary`: a unit's outputs in, sensors' errors and a compensated run out.

The outputs are recordings, or come from a unit on a bench that navigates by itself while the table turns it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from psabench.errors import BadInput, expected
from psabench.native.nav import DEGPH
from psabench.procedures.result import option
from psabench.sins.plan import read_plan
from psabench.sins.secondary.estimate import (
    Compensated,
    Secondary,
    SecondaryConfig,
    calibrate_outputs,
    compensate_outputs,
)
from psabench.sins.secondary.outputs import Outputs, Point, read_outputs, write_outputs
from psabench.sins.table_drive import TableOptions, parts_of, table_axes

if TYPE_CHECKING:
    from psabench.procedures.head_bench import Progress

NAME, SCENARIO = "sins-calibration-secondary", "sins_secondary"


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondaryParams:
    """The table's place, the alignment, the unit's noise."""

    latitude_deg: float | None = option(None, "deg", "latitude of the table; none: where the recording starts")
    longitude_deg: float | None = option(None, "deg", "longitude of the table; none: where the recording starts")
    height_m: float = option(0.0, "m", "height of the table over the ellipsoid")
    plan: str = option("secondary", "", "plan of rotations on a bench: a name or a YAML file")
    alignment_s: float = option(600.0, "s", "alignment at rest before the unit navigates")
    gyro_noise_degph_rts: float = option(0.1, "deg/h", "noise of the gyros, mean over 1 s")
    accel_noise_mps2_rts: float = option(1e-3, "m/s2", "noise of the accelerometers, mean over 1 s")
    least_factor: float = option(3.0, "", "times that the errors must become smaller")

    def __post_init__(self) -> None:
        for name, low, high in (
            ("latitude_deg", -80.0, 80.0),
            ("longitude_deg", -180.0, 180.0),
            ("height_m", -500.0, 9000.0),
            ("alignment_s", 1.0, 86400.0),
            ("gyro_noise_degph_rts", 0.0, 100.0),
            ("accel_noise_mps2_rts", 0.0, 1.0),
            ("least_factor", 0.0, 1e6),
        ):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ValueError(expected(f"{low:g} to {high:g}", value, name))

    def point(self, outputs: Outputs) -> Point:
        """Of the table: a unit is started where it is."""
        lat, lon = self.latitude_deg, self.longitude_deg
        return Point(
            lat_rad=float(outputs.lat_rad[0]) if lat is None else math.radians(lat),
            lon_rad=float(outputs.lon_rad[0]) if lon is None else math.radians(lon),
            h_m=self.height_m,
        )

    def config(self) -> SecondaryConfig:
        """Priors as they are, noise as given."""
        return SecondaryConfig(
            alignment_s=self.alignment_s,
            gyro_noise_radps_rts=self.gyro_noise_degph_rts * DEGPH,
            accel_noise_mps2_rts=self.accel_noise_mps2_rts,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondaryResult:
    """Of one run of the procedure."""

    found: Secondary
    compensated: Compensated | None
    first: str  # names of the files
    second: str
    least_factor: float

    @property
    def within(self) -> bool | None:
        """Whether the second run got as much better as it must; None without one."""
        return None if self.compensated is None else self.compensated.factor >= self.least_factor


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondaryOptions(TableOptions):
    """Where the outputs come from."""

    first: Path | None = None
    second: Path | None = None


def run_secondary(params: SecondaryParams, options: SecondaryOptions, progress: Progress) -> SecondaryResult:
    """Raises BadInput with the file and what is wrong with it; BenchError where a run on a bench fails."""
    first, second = options.first, options.second
    if options.given:
        if first is not None:
            raise BadInput(expected("a recording or a bench", "both", "--first"))
        first = record_first(params, options, progress)
    if first is None:
        what = "a recording (psabench campaign sins-secondary draws two), or a bench (--scenario sins_secondary)"
        raise BadInput(expected(what, "none", "--first"))
    outputs = read_outputs(first)
    found = calibrate_outputs(outputs, params.point(outputs), params.config(), where=first)
    return SecondaryResult(
        found=found,
        compensated=None if second is None else compensate_outputs(found, read_outputs(second), where=second),
        first=first.name,
        second="" if second is None else second.name,
        least_factor=params.least_factor,
    )


def record_first(params: SecondaryParams, options: SecondaryOptions, progress: Progress) -> Path:
    """A run on the bench, as OUT/first.csv. Raises BadInput, BenchError."""
    from psabench.sins.secondary.on_bench import record_outputs
    from psabench.sins.table import moves_of

    if params.latitude_deg is None or params.longitude_deg is None:
        raise BadInput(expected("the table's place", "none", "--latitude-deg, --longitude-deg"))
    point = Point(
        lat_rad=math.radians(params.latitude_deg), lon_rad=math.radians(params.longitude_deg), h_m=params.height_m
    )
    plan = read_plan(params.plan)
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "first.csv"
    with options.open_bench(SCENARIO) as bench:
        moves = list(moves_of(plan.turns, table_axes(bench)))
        with progress.step(f"alignment, plan {plan.name}", parts_of(moves)) as advance:
            for outputs in record_outputs(bench, moves, point, round(params.alignment_s), advance):
                write_outputs(path, outputs)
    return path

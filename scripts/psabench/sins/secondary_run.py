"""`psabench run sins-calibration-secondary`: recordings of a unit's outputs in, sensors' errors and a compensated run
out."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from psabench.errors import BadInput, expected
from psabench.native.nav import DEGPH
from psabench.procedures.result import option
from psabench.sins.outputs import Outputs, Point, read_outputs
from psabench.sins.secondary import Compensated, Secondary, SecondaryConfig, calibrate_outputs, compensate_outputs

NAME = "sins-calibration-secondary"


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondaryParams:
    """The table's place, the alignment, the unit's noise."""

    latitude_deg: float | None = option(None, "deg", "latitude of the table; none: where the recording starts")
    longitude_deg: float | None = option(None, "deg", "longitude of the table; none: where the recording starts")
    height_m: float = option(0.0, "m", "height of the table over the ellipsoid")
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


def run_secondary(params: SecondaryParams, first: Path | None, second: Path | None) -> SecondaryResult:
    """Raises BadInput with the file and what is wrong with it."""
    if first is None:
        raise BadInput(expected("a recording (psabench campaign sins-secondary draws two)", "none", "--first"))
    outputs = read_outputs(first)
    found = calibrate_outputs(outputs, params.point(outputs), params.config(), where=first)
    return SecondaryResult(
        found=found,
        compensated=None if second is None else compensate_outputs(found, read_outputs(second), where=second),
        first=first.name,
        second="" if second is None else second.name,
        least_factor=params.least_factor,
    )

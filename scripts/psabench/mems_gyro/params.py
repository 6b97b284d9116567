"""Parameters and options of `psabench run mems-gyro`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from psabench.errors import expected
from psabench.procedures.result import option
from psabench.sins.table_drive import TableOptions

NAME = "mems-gyro"
SCENARIO = "mems_gyro"
BLOCK_S = 1.0  # of a mean of the output: an observation is several of them


@dataclass(frozen=True, slots=True, kw_only=True)
class MemsGyroParams:
    """Of the procedure, and what is known of its bench beside the readings: standard uncertainties (E0)."""

    axis: str = option("x", "", "channel of the board that the gyro is wired to: x, y or z")
    range_dps: float = option(150.0, "deg/s", "range of the gyro, the highest rate of the table")
    series: int = option(2, "", "repetitions of all attitudes and rates")
    dwell_s: int = option(10, "s", "duration of each rate")
    rest_s: int = option(3600, "s", "recording at rest before the series, for the noise")
    latitude_deg: float = option(50.45, "deg", "latitude of the table")
    azimuth_deg: float = option(0.0, "deg", "azimuth of the table's x at angles of zero, from north")
    chain_gain_ppm: float = option(50.0, "ppm", "gain of the measuring chain at 25 °C: divider and reference")
    chain_zero_uv: float = option(100.0, "uV", "zero of the measuring chain at 25 °C, at the load")
    chain_gain_tc_ppm_per_k: float = option(5.0, "ppm/K", "temperature coefficient of that gain")
    chain_zero_tc_uv_per_k: float = option(10.0, "uV/K", "temperature coefficient of that zero")
    chain_off_k: float = option(2.0, "K", "distance of the converter board from 25 °C")
    rate_ppm: float = option(10.0, "ppm", "rate of the table, by its angle and its clock")
    mount_arcsec: float = option(60.0, "arcsec", "turn of the unit on the table, about each axis")

    def __post_init__(self) -> None:
        if self.axis not in ("x", "y", "z"):
            raise ValueError(expected("x, y or z", repr(self.axis), "axis"))
        if self.series < 1:
            raise ValueError(expected("at least 1", self.series, "series"))
        if self.dwell_s < 2:
            raise ValueError(expected("at least 2 s", self.dwell_s, "dwell_s"))
        if self.rest_s < 300:
            raise ValueError(expected("at least 300 s (the noise is fitted to it)", self.rest_s, "rest_s"))
        if not 0.0 < self.range_dps <= 1e4:
            raise ValueError(expected("up to 10000 deg/s", self.range_dps, "range_dps"))
        if not -90.0 <= self.latitude_deg <= 90.0:
            raise ValueError(expected("-90 to 90 deg", self.latitude_deg, "latitude_deg"))
        for name in ACCURACY:
            if not getattr(self, name) >= 0.0:
                raise ValueError(expected("0 or more", getattr(self, name), name))

    @property
    def channel(self) -> int:
        return "xyz".index(self.axis)


ACCURACY = tuple(n for n in MemsGyroParams.__dataclass_fields__ if n.startswith(("chain_", "rate_", "mount_")))


@dataclass(frozen=True, slots=True, kw_only=True)
class MemsGyroOptions(TableOptions):
    """What the command line asked for."""

    real_time: bool = False
    params: Mapping[str, Any] = field(default_factory=dict)

"""Parameters and options of `psabench run sins-calibration`, and which of them go together."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from psabench.errors import BadInput, expected
from psabench.native.nav import Refused
from psabench.native.sins import DEG, SinsConfig, state_layout
from psabench.native.strapdown import gravity_mps2
from psabench.procedures.result import option
from psabench.sins.covariance_run import GAUGES
from psabench.sins.parameters import SCALES
from psabench.sins.plan import RotationPlan
from psabench.sins.table_drive import TableOptions
from psabench.sins.table_run import STAND_S

NAME = "sins-calibration"
STEP_S, MOST_SAMPLES = 0.1, 64  # of the filter; samples that a step may have


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationParams:
    """Parameters of `sins-calibration`; the defaults are the article's."""

    plan: str = option("", "", "plan of rotations: article, two_rates or a YAML file (article)")
    azimuth_deg: float | None = option(None, "deg", "azimuth of the table's first axis from north (the plan's)")
    latitude_deg: float = option(55.7, "deg", "latitude of the table")
    height_m: float = option(150.0, "m", "height of the table above the ellipsoid")
    gravity: float | None = option(None, "m/s2", "local gravity (of the ellipsoid there)")
    stand: bool = option(True, "", "use the table's angles; no: as on a coarse table")
    stand_arcsec: float = option(15.0, "arcsec", "noise of a reading of the table's angle")
    wobble_arcsec: float = option(1.0, "arcsec", "what the table's axes do that its angles do not show")
    heading_sd_deg: float = option(3.0, "deg", "error of the heading at the start")
    gauge: str = option("article", "", f"elements of Γ that are estimated: {', '.join(GAUGES)}")
    lever: int = option(0, "", "lever arms of the accelerometers: 0 none, 3 along the own axis, 9 all")
    quad_sd_ugpg2: float = option(0.0, "ug/g2", "quadratic terms of the accelerometers, prior sd; 0: not estimated")
    delay_sd_ms: float = option(0.0, "ms", "accelerometers later than gyros, prior sd; 0: not estimated")
    gyro_noise_degph: float = option(0.1, "deg/h", "white noise of the gyros, a mean of 1 s")
    accel_noise_mps2: float = option(0.001, "m/s2", "white noise of the accelerometers, a mean of 1 s")

    def __post_init__(self) -> None:
        if self.gauge not in GAUGES:
            raise ValueError(expected(", ".join(GAUGES), self.gauge, "gauge"))
        if not -85.0 <= self.latitude_deg <= 85.0:
            raise ValueError(expected("-85 to 85 deg", self.latitude_deg, "latitude_deg"))
        if not 0.0 <= self.wobble_arcsec <= 3600.0:
            raise ValueError(expected("0 to 3600 arcsec", self.wobble_arcsec, "wobble_arcsec"))
        if self.lever not in (0, 3, 9):
            raise ValueError(expected("0, 3 or 9", self.lever, "lever"))
        if not 0.0 <= self.quad_sd_ugpg2 <= 1e4:
            raise ValueError(expected("0 to 10000 ug/g2", self.quad_sd_ugpg2, "quad_sd_ugpg2"))
        if not 0.0 <= self.delay_sd_ms <= 50.0:
            raise ValueError(expected("0 to 50 ms", self.delay_sd_ms, "delay_sd_ms"))

    @property
    def g_mps2(self) -> float:
        return gravity_mps2(self.latitude_deg * DEG, self.height_m) if self.gravity is None else self.gravity

    def config(self, sample_s: float, stand: bool, cycle_s: float) -> SinsConfig:
        """Of the estimator. cycle_s: the longest time about one axis of the table.

        What its angles do not show is the same in all of it, and counts as white noise with that mean over a cycle.
        """
        per_sample_arcsec = math.hypot(self.stand_arcsec, self.wobble_arcsec * math.sqrt(cycle_s / STAND_S))
        return SinsConfig(
            latitude_rad=self.latitude_deg * DEG,
            gravity_mps2=self.g_mps2,
            sample_s=sample_s,
            step_s=sample_s * min(max(round(STEP_S / sample_s), 1), MOST_SAMPLES),
            gauge=GAUGES[self.gauge],
            lever=self.lever,
            quad_sd_s2pm=self.quad_sd_ugpg2 / SCALES["quad"].per_si,
            delay_sd_s=self.delay_sd_ms / SCALES["delay"].per_si,
            stand=stand,
            clone=True,
            beta_sd_rad=(DEG, DEG, self.heading_sd_deg * DEG),
            gyro_noise_radps_rts=self.gyro_noise_degph * DEG / 3600.0,
            accel_noise_mps2_rts=self.accel_noise_mps2,
            stand_sd_rad=per_sample_arcsec * DEG / 3600.0,
            stand_noise_rate_hz=1.0 / STAND_S,
            stand_interval_s=STAND_S,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SinsOptions(TableOptions):
    """What the command line asked for."""

    real_time: bool = False
    data: Path | None = None  # recorded increments in place of a bench
    layout: Path | None = None
    angles: Path | None = None
    params: Mapping[str, Any] = field(default_factory=dict)


def check_options(options: SinsOptions, p: CalibrationParams) -> None:
    """Before minutes are measured. Raises BadInput."""
    try:
        state_layout(p.config(0.01, p.stand, 1.0))
    except Refused as e:
        raise BadInput(f"{NAME}: {e}") from e
    if options.data and options.given:
        raise BadInput(expected("--data without a bench", f"--{options.given[0]}", NAME))
    if options.data and options.angles and not p.plan:
        raise BadInput(expected("--plan of the recording: its cycles are in the intervals", "none", "--angles"))
    if not options.data and (options.angles or options.layout):
        raise BadInput(expected("--data", "none", "--angles" if options.angles else "--layout"))


def longest_cycle_s(plan: RotationPlan) -> float:
    """Of turns in a row about the same axis."""
    longest = now_s = 0.0
    before: tuple[float, ...] | None = None
    for turn in plan.turns:
        now_s = turn.duration_s + (now_s if turn.axis_b == before else 0.0)
        longest, before = max(longest, now_s), turn.axis_b
    return longest

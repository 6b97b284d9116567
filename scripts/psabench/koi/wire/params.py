"""Parameters and options of `psabench run koi-flight`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from psabench.bench import Bench
from psabench.errors import BadInput, expected
from psabench.koi.autocal import Knowledge
from psabench.koi.flight_data import FlightSetup
from psabench.koi.wire.clock import ClockLimits
from psabench.koi.wire.port import BAUD
from psabench.native.koi import UnitClass, koi_default
from psabench.procedures.result import option

NAME, SCENARIO = "koi-flight", "koi_flight"
CLASSES = {c.name.lower(): c for c in UnitClass}
LONGEST_S = 36_000.0
TRUTH_LOG, TRUTH_S = "truth.jsonl", 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class KoiParams:
    """Parameters of `koi-flight`."""

    unit_class: str = option("bins", "", f"noise and prior of the unit's sensors: {', '.join(CLASSES)}")
    corrects: bool = option(True, "", "correct the alignment at take-off, if the decision passes")
    align_s: float = option(600.0, "s", "alignment, parked")
    latitude_deg: float | None = option(None, "deg", "place where the unit is parked (median of the receiver's)")
    longitude_deg: float | None = option(None, "deg", "the same")
    height_m: float = option(0.0, "m", "its height above the ellipsoid, with latitude and longitude")
    flight_s: float = option(LONGEST_S, "s", "the longest flight; it ends earlier where it has landed")
    baud: int = option(BAUD, "", "bit rate of the receiver's port")
    latency_ms: float = option(30.0, "ms", "from the instant of a solution to its last byte; the filter finds the rest")

    def __post_init__(self) -> None:
        if self.unit_class not in CLASSES:
            raise ValueError(expected(", ".join(CLASSES), self.unit_class, "unit_class"))
        if (self.latitude_deg is None) != (self.longitude_deg is None):
            raise ValueError(expected("latitude_deg and longitude_deg, or neither", "one of them", "place"))
        for name, low, high in (
            ("align_s", 10.0, 7200.0),
            ("flight_s", 10.0, LONGEST_S),
            ("latency_ms", 0.0, 2000.0),
            ("latitude_deg", -85.0, 85.0),
            ("longitude_deg", -360.0, 360.0),
            ("height_m", -1000.0, 20_000.0),
        ):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ValueError(expected(f"{low:g} to {high:g}", value, name))

    @property
    def limits(self) -> ClockLimits:
        return ClockLimits(latency_s=1e-3 * self.latency_ms)

    def setup(self, serial: str = "unit", time_s: float = 0.0, known: Knowledge | None = None) -> FlightSetup:
        """Of the host."""
        place = None
        if self.latitude_deg is not None and self.longitude_deg is not None:
            place = math.radians(self.latitude_deg), math.radians(self.longitude_deg), self.height_m
        return FlightSetup(
            cfg=koi_default(CLASSES[self.unit_class]),
            serial=serial,
            time_s=time_s,
            known=known,
            corrects=self.corrects,
            place_rad_m=place,
            align_s=self.align_s,
            coarse_s=min(120.0, self.align_s / 2.0),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class KoiOptions:
    """What the command line asked for."""

    out: Path = Path("build/run")
    can: str | None = None
    control: Path | None = None
    receiver: str | None = None  # serial port
    scenario: Path | None = None
    seed: int | None = None
    real_time: bool = False
    data: Path | None = None  # folder of a recorded flight in place of a bench
    params: Mapping[str, Any] = field(default_factory=dict)

    def check(self) -> None:
        """Raises BadInput for options that do not go together."""
        given = [n for n in ("can", "control", "receiver", "scenario", "seed") if getattr(self, n) is not None]
        if self.data and given:
            raise BadInput(expected("--data without a bench", f"--{given[0]}", NAME))
        if self.data and self.data.resolve() == self.out.resolve():
            raise BadInput(expected("another folder than that of --data", self.out, "--out"))

    def open_bench(self) -> Bench:
        """At these addresses, or an emulator with the scenario, which logs its truth. Raises BadInput, BenchError."""
        if self.can or self.control:
            return Bench.connect(self.can, control=self.control)
        pace = "wall" if self.real_time else "step"
        log = self.out / TRUTH_LOG
        extra: list[str | Path] = ["--serial", "-", "--truth-log", log, "--truth-every", f"{TRUTH_S:g}s"]
        return Bench.start(self.scenario or SCENARIO, pace=pace, seed=self.seed, extra=extra)

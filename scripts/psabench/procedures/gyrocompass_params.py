"""Parameters of the gyrocompass procedure, its two readings, and what is rejected before anything moves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from psabench.errors import BadInput, expected
from psabench.native import nav
from psabench.native.nav import ARCMIN, DEGPH, EARTH_RADPS, Method
from psabench.procedures.platform_bench import Table
from psabench.procedures.result import fields_of, option

NAME = "gyrocompass"

METHODS: Mapping[str, Method] = {
    "closed3": Method.CLOSED3,
    "lsq": Method.LSQ,
    "constrained": Method.CONSTRAINED,
    "gls": Method.GLS,
    "gls-constrained": Method.GLS_CONSTRAINED,
}
ANGLES = ("set", "encoder")
SIGNALS = ("frames", "readings")
PASSPORT = ("drift2_degph", "unbalance1_degph_per_g", "quadrature2_degph_per_g")
SIGNED = ("latitude_deg", *PASSPORT)
SETTLED = 7.0  # time constants of a loop: e^-7 of what a turn leaves is less than noise and drift make of a heading
WINDOW_LEAST_S = 0.1  # object 2102h
TAU_LEAST_S = 0.01  # 0 is a drift without memory


@dataclass(frozen=True, slots=True, kw_only=True)
class GyrocompassParams:
    """Parameters of `gyrocompass`; the defaults are the article's reading, READINGS has the others."""

    sequence: str = option("0,90,180", "deg", "gimbal angles in the order of measurement, 32 at most")
    repeat: int = option(1, "", "repetitions of the sequence")
    window_s: float = option(10.0, "s", "measuring time in each position")
    settle_s: float = option(10.0, "s", "time from the end of a turn to its window")
    slew_dps: float = option(9.0, "deg/s", "rate of the turns")
    m1_per_s: float = option(1.0, "1/s", "gain of the levelling loop")
    m2_per_s: float = option(2.0, "1/s", "gain of the azimuth loop")
    freeze: bool = option(False, "", "stop the azimuth servo in the windows")
    latitude_deg: float = option(50.0, "deg", "latitude that the operator gives (the scenario's site)")
    latitude_sd_arcmin: float = option(0.1, "arcmin", "error of the latitude")
    method: str = option("closed3", "", f"estimator: {', '.join(METHODS)}")
    angles: str = option("set", "", "angle that the estimate uses: set or encoder")
    cardan: bool = option(True, "", "correct the angles for the tilt of the outer axis")
    simplified: bool = option(True, "", "use eq. (14) instead of (13)")
    slope: bool = option(False, "", "estimate the levelling rate as a slope instead of a mean")
    signals: str = option(
        "frames", "", "level angles from the frames of the level unit, or from the readings of the gyro unit"
    )
    calibrate_s: float = option(60.0, "s", "window of the azimuth axis after the run; 0: none")
    gm_sigma_degph: float = option(0.2, "deg/h", "random drift, from the passport")
    gm_tau_s: float = option(1000.0, "s", "correlation time of the random drift")
    angle_sd_arcmin: float = option(3.0, "arcmin", "error of an angle, new in each position")
    level_sd_arcmin: float = option(1.0, "arcmin", "error of the level angles, new in each position")
    level_zero_arcmin: float = option(10.0, "arcmin", "constant error of the level angles, for the drift's limits")
    angle_zero_arcmin: float = option(6.0, "arcmin", "mounting error of the angle sensor, for the heading's limits")
    torquer_scale: float = option(1e-3, "", "error of the torquers, for the drift's limits and the vehicle's turns")
    drift2_degph: float = option(
        0.0, "deg/h", "drift of the azimuth axis, from the passport; used to check the latitude"
    )
    drift2_limit_degph: float = option(0.0, "deg/h", "limit of the error of drift2_degph; 0: no passport")
    unbalance1_degph_per_g: float = option(
        0.0, "deg/h/g", "drift about x by the specific force along x, from the passport; taken out of S"
    )
    quadrature2_degph_per_g: float = option(
        0.0, "deg/h/g", "drift about z by the specific force along x, from the passport; not in the drift of the hold"
    )

    def __post_init__(self) -> None:
        for name, known in (("method", tuple(METHODS)), ("angles", ANGLES), ("signals", SIGNALS)):
            if getattr(self, name) not in known:
                raise ValueError(expected(", ".join(known), repr(getattr(self, name)), name))
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(value, float) and f.name not in SIGNED and not 0.0 <= value < math.inf:
                raise ValueError(expected("0 or more", value, f.name))
        for name in PASSPORT:
            if not math.isfinite(getattr(self, name)):
                raise ValueError(expected("a finite number", getattr(self, name), name))
        if self.window_s < WINDOW_LEAST_S or self.repeat < 1:
            raise ValueError(
                expected(
                    f"at least {WINDOW_LEAST_S:g} s and 1", f"{self.window_s} s and {self.repeat}", "window_s, repeat"
                )
            )
        rehearse(self)

    @property
    def angles_deg(self) -> tuple[float, ...]:
        """`sequence` as numbers."""
        try:
            found = tuple(float(x) for x in self.sequence.split(","))
        except ValueError:
            raise ValueError(expected("angles in degrees, as 0,90,180", repr(self.sequence), "sequence")) from None
        if not all(abs(a) <= 360.0 for a in found):
            raise ValueError(expected("angles within +-360 deg", repr(self.sequence), "sequence"))
        return found

    @property
    def latitude_rad(self) -> float:
        return math.radians(self.latitude_deg)

    @property
    def we_radps(self) -> float:
        """The Earth's horizontal rate at that latitude."""
        return EARTH_RADPS * math.cos(self.latitude_rad)

    @property
    def wz_radps(self) -> float:
        """Its vertical rate, below zero in the south."""
        return EARTH_RADPS * math.sin(self.latitude_rad)

    @property
    def table(self) -> Table:
        return Table(angles_deg=self.angles_deg, **fields_of(Table, asdict(self)))


# The article's reading: set angles trusted, closed form, (14). Ours: fast reversals, encoder read, (13), weights.
READINGS: Mapping[str, Mapping[str, Any]] = {
    "article": {},
    "improved": {
        "sequence": "0,180,90,270",
        "repeat": 6,
        "window_s": 5.0,
        "settle_s": 5.0,
        "slew_dps": 18.0,
        "slope": True,
        "m1_per_s": 2.0,
        "method": "gls-constrained",
        "angles": "encoder",
        "simplified": False,
        "angle_sd_arcmin": 0.5,
    },
}


def params_of(reading: str, given: Mapping[str, Any] | None = None) -> GyrocompassParams:
    """The parameters of a reading, with those given in their place. Raises BadInput."""
    if reading not in READINGS:
        raise BadInput(expected(", ".join(READINGS), repr(reading), "reading"))
    try:
        return GyrocompassParams(**{**READINGS[reading], **(given or {})})
    except ValueError as e:
        raise BadInput(f"{NAME}: {e}") from e


def rehearse(p: GyrocompassParams) -> None:
    """Whether these positions can tell a heading at all, before anything moves. Raises BadInput with the reason."""
    angles = np.radians(Table(angles_deg=p.angles_deg, repeat=p.repeat).sequence_deg)
    if not abs(p.latitude_deg) <= 90.0:
        raise BadInput(expected("-90 to 90 deg", f"{p.latitude_deg:g}", f"{NAME}: latitude_deg"))
    _patient(p)
    pace_s = p.window_s + p.settle_s
    rows = [
        nav.Position(s_radps=p.we_radps * math.sin(a), delta_rad=a - angles[0], t_mid_s=k * pace_s, window_s=p.window_s)
        for k, a in enumerate(angles)
    ]
    nav.gyrocompass(rows, latitude_rad=p.latitude_rad, method=METHODS[p.method], noise=noise_of(p, 0.0))


def _patient(p: GyrocompassParams) -> None:
    """Whether the loops have the time to settle. Raises BadInput. The slope does not mind what is left of beta."""
    loops = (("m1_per_s", p.m1_per_s, "" if p.slope else ", or --slope yes"), ("m2_per_s", p.m2_per_s, ""))
    for name, m, way_out in loops:
        if (p.slope and name == "m1_per_s") or m * p.settle_s >= SETTLED:
            continue
        need = f"at least {SETTLED / m:.3g}" if m > 0.0 else "a loop"
        raise BadInput(
            expected(f"{need} with {name} {m:g} ({SETTLED:g}/{name}){way_out}", p.settle_s, f"{NAME}: settle_s")
        )


def noise_of(p: GyrocompassParams, window_sd_radps: float) -> nav.Noise:
    return nav.Noise(
        gm_sigma_radps=p.gm_sigma_degph * DEGPH,
        gm_tau_s=max(p.gm_tau_s, TAU_LEAST_S),
        window_sd_radps=window_sd_radps,
        angle_sd_rad=p.angle_sd_arcmin * ARCMIN,
        level_sd_rad=p.level_sd_arcmin * ARCMIN,
        latitude_sd_rad=p.latitude_sd_arcmin * ARCMIN,
    )

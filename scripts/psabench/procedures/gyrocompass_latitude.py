"""What a wrong latitude would do to a heading, and which wrong latitudes a run cannot see.

At another latitude the compensation of gamma and the Earth's horizontal rate are others: S_i would have had
(Wz' - Wz) sin gamma_i cos beta_i more. The horizontal rate shows cos(latitude) alone, which is flat at the equator and
blind to the sign; the drift of the azimuth axis shows sin(latitude), where a passport says what it should be.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psabench.estimate.angles import wrapped
from psabench.native import nav
from psabench.native.nav import DEGPH, EARTH_RADPS, LATITUDE_LIMIT_RAD
from psabench.procedures.gyrocompass_fit import Fit, WindowMean, again, passport_sd_radps
from psabench.procedures.platform_bench import Floats
from psabench.procedures.result import DEG

Bools = npt.NDArray[np.bool_]

GRID_RAD = math.radians(0.01)
STEP_RAD = math.radians(0.01)  # of the derivative
LOOKS = 9  # latitudes that are tried of those that look alike
PASSPORT_SDS = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LatitudeEffect:
    """Of one run."""

    heading_per_latitude: float  # deg of heading per deg of latitude, at the latitude given
    low_deg: float  # latitudes about the one given that the run cannot tell from it
    high_deg: float
    unseen_deg: float  # what they would turn the heading by, at most
    sign_deg: float | None  # what the latitude of the other sign would, where nothing tells it; None: it shows

    @property
    def words(self) -> str:
        """One line of a report."""
        line = (
            f"latitude: 1 deg turns this heading by {abs(self.heading_per_latitude):.3f} deg; "
            f"{self.low_deg:.2f} to {self.high_deg:.2f} deg look alike, up to {self.unseen_deg:.3f} deg of heading"
        )
        if self.sign_deg is None:
            return line
        return (
            f"{line}; the rates do not tell the hemisphere, a latitude of the wrong sign would turn this heading by "
            f"{self.sign_deg:.2f} deg"
        )


def latitude_effect(f: Fit, quality_limit: float, drift2: WindowMean) -> LatitudeEffect:
    """quality_limit: of |hypot(s, c) - 1|, beyond which a run is in doubt."""
    phi = f.params.latitude_rad
    grid = np.linspace(-LATITUDE_LIMIT_RAD, LATITUDE_LIMIT_RAD, round(2.0 * LATITUDE_LIMIT_RAD / GRID_RAD) + 1)
    hidden = _hidden(grid, f, quality_limit) & _passport_allows(grid, f, drift2)
    above, below = hidden[grid > phi], hidden[grid < phi][::-1]
    high = min(phi + GRID_RAD * _run_length(above), LATITUDE_LIMIT_RAD)
    low = max(phi - GRID_RAD * _run_length(below), -LATITUDE_LIMIT_RAD)
    unseen = max(abs(_turn(f, float(x))) for x in np.linspace(low, high, LOOKS))
    opposite = np.array([-phi])
    told = low <= -phi <= high or not _passport_allows(opposite, f, drift2)[0]
    toward = -STEP_RAD if phi > 0.0 else STEP_RAD
    return LatitudeEffect(
        heading_per_latitude=_turn(f, phi + toward) / toward,
        low_deg=low * DEG,
        high_deg=high * DEG,
        unseen_deg=unseen * DEG,
        sign_deg=None if told else abs(_turn(f, -phi)) * DEG,
    )


def _hidden(phi_rad: Floats, f: Fit, quality_limit: float) -> Bools:
    """Where the Earth's horizontal rate is what it is at the latitude given, within the limit."""
    return np.asarray(np.abs(np.cos(phi_rad) / math.cos(f.params.latitude_rad) - 1.0) <= quality_limit)


def _passport_allows(phi_rad: Floats, f: Fit, drift2: WindowMean) -> Bools:
    """Where the drift of the azimuth axis would be what the passport says; everywhere, without one."""
    p = f.params
    if not p.drift2_limit_degph:
        return np.full(phi_rad.shape, True)
    drift_radps = drift2.radps - EARTH_RADPS * np.sin(phi_rad) + p.wz_radps
    return np.asarray(np.abs(drift_radps - p.drift2_degph * DEGPH) <= passport_limit_radps(f, drift2))


def passport_limit_radps(f: Fit, drift2: WindowMean) -> float:
    """How far the drift that was found may be from the passport's."""
    return f.params.drift2_limit_degph * DEGPH + PASSPORT_SDS * passport_sd_radps(drift2, f.noise)


def _run_length(flags: Bools) -> int:
    """How many of the first are true."""
    return int(flags.size if flags.all() else np.argmin(flags))


def _turn(f: Fit, latitude_rad: float) -> float:
    """What the heading would turn by at another latitude, rad."""
    more_wz = EARTH_RADPS * math.sin(latitude_rad) - f.params.wz_radps
    more = [more_wz * math.sin(r.position.gamma_rad) * math.cos(r.position.beta_rad) for r in f.rows]
    try:
        there = again(f, np.array(more), latitude_rad)
    except nav.Refused:  # at the edge of what the library takes
        return math.pi
    return wrapped(f.compass.alpha1_rad - there.alpha1_rad)

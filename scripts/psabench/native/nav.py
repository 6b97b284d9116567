"""Gyrocompassing and heading hold: the estimation library libpsabench-nav (docs/nav.md), from Python.

Angles in rad, rates in rad/s, time in s. Local level is east, north, up; alpha is counter-clockwise seen from above
(azimuth of the platform's y axis: -alpha), headings are clockwise from north. The Monte-Carlo models are in `nav_mc`.
"""

from __future__ import annotations

import ctypes as c
import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected
from psabench.native.navlib import (
    AttitudeStruct,
    CompassStruct,
    FitStruct,
    HoldStruct,
    NoiseStruct,
    PositionStruct,
    RefusalStruct,
    RestStruct,
    filled,
    library,
)

EARTH_RADPS = 7.292115e-5  # WGS 84: sources 5.1
LATITUDE_LIMIT_RAD = math.radians(85.0)  # beyond it the library rejects
EARTH_RADIUS_M = 6371e3  # of the sphere that transport rates are over, as nav_transport_radps() has it
DEGPH = math.radians(1.0) / 3600.0  # 1 deg/h in rad/s
ARCMIN = math.radians(1.0 / 60.0)  # 1' in rad

Floats = npt.NDArray[np.float64]


class Method(enum.IntEnum):
    """How positions become a heading (enum nav_method)."""

    CLOSED3 = 0
    LSQ = 1
    CONSTRAINED = 2
    GLS = 3
    GLS_CONSTRAINED = 4


class Status(enum.IntEnum):
    """Why the library rejects (enum nav_status)."""

    TOO_FEW = -1
    COINCIDENT = -2
    LATITUDE = -3
    NOT_FINITE = -4
    RANGE = -5
    TIMES = -6
    SINGULAR = -7


class Flag(enum.IntFlag):
    """What a result should be looked at for (enum nav_flag)."""

    POOR_GEOMETRY = 1
    POOR_QUALITY = 2
    SIMPLIFIED = 4
    NO_NOISE = 8
    NOT_CONVERGED = 16


class Refused(BadInput):
    """The library rejected: `status` says why, `field` which field of nav.h or nav_mc.h is the cause ("": none alone),
    `position` whose from 0 (None: of the configuration); the message has them in words, with what would be right."""

    def __init__(self, what: str, status: int, why: RefusalStruct | None = None) -> None:
        self.status = Status(status)
        named = why is not None and why.status == status and bool(why.field)
        self.field = why.field.decode() if why is not None and named else ""
        self.position = why.position if why is not None and named and why.position >= 0 else None
        cause = ""
        if why is not None and named:
            whose = "" if self.position is None else f" of position {self.position + 1}"
            cause = f": {self.field}{whose} is {why.value:.6g}; want {why.want.decode()}"
        super().__init__(f"{what}: {library().status_text(status).decode()}{cause}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """One position of the platform and one window in it."""

    s_radps: float  # levelling command: mean of -m1 beta_n, or window_slope()
    delta_rad: float  # turn of alpha since the first position; from an encoder: cardan()
    beta_rad: float = 0.0  # means of the level sensors
    gamma_rad: float = 0.0
    t_mid_s: float = 0.0
    window_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """What covariance and weights rest on; all zero: not known."""

    gm_sigma_radps: float = 0.0
    gm_tau_s: float = 1000.0
    white_radps_rts: float = 0.0  # a window's standard deviation times sqrt(window_s)
    window_sd_radps: float = 0.0  # drawn again for each window
    angle_sd_rad: float = 0.0  # each angle reading, the first included
    level_sd_rad: float = 0.0  # each window's gamma
    latitude_sd_rad: float = 0.0  # of the latitude given: on a tilt it turns the heading by up to the tilt times it


@dataclass(frozen=True, slots=True, kw_only=True)
class Compass:
    """Result of `gyrocompass`; fields as in struct nav_compass."""

    alpha1_rad: float
    alpha1_sd_rad: float
    alpha1_half95_rad: float
    platform_sd_rad: float
    drift1_radps: float
    drift1_sd_radps: float
    ramp_radps2: float
    s: float
    c: float
    quality: float
    geometry: float
    residual_rms_radps: float
    cov: Floats  # 3 x 3: alpha1, drift1, ramp
    flags: Flag
    iterations: int

    @property
    def warnings(self) -> list[str]:
        """One sentence for each flag."""
        return [library().flag_text(int(f)).decode() for f in Flag if f in self.flags]


@dataclass(frozen=True, slots=True, kw_only=True)
class Attitude:
    """Pitch and roll of the vehicle from the level sensors."""

    pitch_rad: float
    roll_rad: float
    gamma_bias_rad: float  # measured less true
    residual_rms_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Rest:
    """A platform at rest with the errors of its device (struct nav_rest)."""

    latitude_rad: float
    alpha_rad: float
    gamma_rad: float = 0.0
    drift1_radps: float = 0.0
    m1_per_s: float = 1.0
    latitude_error_rad: float = 0.0
    torquer_scale1: float = 0.0
    beta_error_rad: float = 0.0
    gamma_error_rad: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Hold:
    """What grows in the hold (struct nav_hold)."""

    heading_sd_rad: float
    drift_sd_radps: float
    gm_sigma_radps: float = 0.0
    gm_tau_s: float = 1000.0
    gm_from_zero: bool = False


_NO_NOISE = Noise()


def gyrocompass(
    positions: Sequence[Position],
    *,
    latitude_rad: float,
    method: Method = Method.GLS,
    simplified: bool = False,
    ramp: bool = False,
    noise: Noise = _NO_NOISE,
) -> Compass:
    """Alpha at position 1 and the drift about the measuring axis, (12)-(19) corrected. Raises Refused."""
    rows = _rows(positions)
    fit = FitStruct(latitude_rad, int(method), int(simplified), int(ramp), filled(NoiseStruct, noise))
    out = CompassStruct()
    status = library().gyrocompass(rows, len(positions), c.byref(fit), c.byref(out))
    if status < 0:
        why = RefusalStruct()
        library().gyrocompass_check(rows, len(positions), c.byref(fit), c.byref(why))
        raise Refused("gyrocompass", status, why)
    values = {name: getattr(out, name) for name, *_ in CompassStruct._fields_ if name not in ("cov", "flags")}
    return Compass(**values, cov=np.array(out.cov).reshape(3, 3), flags=Flag(out.flags))


def gyrocompass_printed(positions: Sequence[Position], latitude_rad: float) -> tuple[float, float]:
    """(alpha, drift) by (18), (19) and S1 + S3 as printed: wrong, for negative tests only. Raises Refused."""
    alpha_rad, drift_radps = c.c_double(), c.c_double()
    if len(positions) != 3:
        raise Refused("gyrocompass_printed", Status.TOO_FEW)
    status = library().gyrocompass_printed(_rows(positions), latitude_rad, c.byref(alpha_rad), c.byref(drift_radps))
    _check("gyrocompass_printed", status)
    return alpha_rad.value, drift_radps.value


def attitude_from_level(
    q_rad: npt.ArrayLike, gamma_rad: npt.ArrayLike, beta_rad: npt.ArrayLike | None = None, *, bias: bool = False
) -> Attitude:
    """Pitch and roll from gamma at several gimbal angles; bias: gamma's constant error as well. Raises Refused."""
    q, gamma = _same_length(q_rad, gamma_rad)
    beta = None if beta_rad is None else _same_length(q_rad, beta_rad)[1]
    out = AttitudeStruct()
    status = library().attitude_from_level(_ptr(q), _ptr(beta), _ptr(gamma), len(q), int(bias), c.byref(out))
    _check("attitude_from_level", status)
    return Attitude(**{name: getattr(out, name) for name, *_ in AttitudeStruct._fields_})


def alpha(
    *, psi_rad: float, q_rad: float, beta_rad: float = 0.0, pitch_rad: float = 0.0, roll_rad: float = 0.0
) -> float:
    """Alpha of a platform at gimbal angle q on a vehicle of heading psi and this attitude, exactly."""
    return float(library().alpha(psi_rad, q_rad, beta_rad, pitch_rad, roll_rad))


def gamma(
    *, alpha_rad: float, beta_rad: float = 0.0, psi_rad: float = 0.0, pitch_rad: float = 0.0, roll_rad: float = 0.0
) -> float:
    """Block 1 of the article: gamma from alpha, beta and the vehicle's attitude."""
    return float(library().gamma(alpha_rad, beta_rad, psi_rad, pitch_rad, roll_rad))


def cardan(q_rad: npt.ArrayLike, *, pitch_rad: float, roll_rad: float, beta_rad: npt.ArrayLike | None = None) -> Floats:
    """Increments of alpha since the first gimbal angle, exactly. Raises Refused."""
    q = _array(q_rad)
    beta = None if beta_rad is None else _same_length(q_rad, beta_rad)[1]
    out = np.empty_like(q)
    _check("cardan", library().cardan(_ptr(q), _ptr(beta), len(q), pitch_rad, roll_rad, _ptr(out)))
    return out


def heading(
    alpha_rad: float, q_rad: float, *, beta_rad: float = 0.0, pitch_rad: float = 0.0, roll_rad: float = 0.0
) -> float:
    """Heading of the vehicle in [0, 2 pi) from alpha and the gimbal angle of one position."""
    return float(library().heading(alpha_rad, q_rad, beta_rad, pitch_rad, roll_rad))


def window_slope(beta_n_rad: npt.ArrayLike, s_radps: npt.ArrayLike, dt_s: float) -> float:
    """S [rad/s] of a window: negative slope of beta_n less the integral of the levelling command. Raises Refused."""
    beta, s = _same_length(beta_n_rad, s_radps)
    out = c.c_double()
    _check("window_slope", library().window_slope(_ptr(beta), _ptr(s), len(beta), dt_s, c.byref(out)))
    return out.value


def rest_s_radps(at: Rest) -> tuple[float, float]:
    """(S [rad/s], true beta [rad]) of a platform at rest, settled."""
    beta = c.c_double()
    return float(library().rest_s_radps(c.byref(filled(RestStruct, at)), c.byref(beta))), beta.value


def azimuth_drift(
    s_az_radps: float, *, latitude_rad: float, alpha_rad: float, beta_rad: float = 0.0, gamma_rad: float = 0.0
) -> float:
    """Drift of the azimuth axis from the mean of its torquer's whole command in an angle-holding window."""
    return float(library().azimuth_drift(s_az_radps, latitude_rad, alpha_rad, beta_rad, gamma_rad))


def azimuth_drift_sd(*, latitude_rad: float, alpha_rad: float, beta_sd_rad: float, gamma_sd_rad: float) -> float:
    """What errors of the level sensors leave in `azimuth_drift`."""
    return float(library().azimuth_drift_sd(latitude_rad, alpha_rad, beta_sd_rad, gamma_sd_rad))


def transport_radps(v_east_mps: float, latitude_rad: float) -> float:
    """V_E tan(lat)/R: what the azimuth of a moving platform needs besides U sin(lat)."""
    return float(library().transport_radps(v_east_mps, latitude_rad))


def gm_integral_sd_rad(gm_sigma_radps: float, gm_tau_s: float, t_s: float, *, from_zero: bool = False) -> float:
    """Standard deviation of the integral of a Gauss-Markov drift over t_s."""
    return float(library().gm_integral_sd_rad(gm_sigma_radps, gm_tau_s, t_s, int(from_zero)))


def gm_window_cov(
    gm_sigma_radps: float, gm_tau_s: float, window_a_s: float, window_b_s: float, between_middles_s: float
) -> float:
    """Covariance of the drift's means over two windows, or over one (between_middles_s 0)."""
    return float(library().gm_window_cov(gm_sigma_radps, gm_tau_s, window_a_s, window_b_s, between_middles_s))


def hold_sd_rad(hold: Hold, t_s: float) -> float:
    """Standard deviation of the heading t_s after the hold began."""
    return float(library().hold_sd_rad(c.byref(filled(HoldStruct, hold)), t_s))


def _check(what: str, status: int) -> None:
    if status < 0:
        raise Refused(what, status)


def _rows(positions: Sequence[Position]) -> c.Array[PositionStruct]:
    return (PositionStruct * max(len(positions), 1))(*(filled(PositionStruct, p) for p in positions))


def _array(values: npt.ArrayLike) -> Floats:
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)


def _same_length(a: npt.ArrayLike, b: npt.ArrayLike) -> tuple[Floats, Floats]:
    first, second = _array(a), _array(b)
    if len(first) != len(second):
        raise ValueError(expected("arrays of the same length", f"{len(first)} and {len(second)} numbers"))
    return first, second


def _ptr(array: Floats | None) -> c._Pointer[c.c_double] | None:
    return None if array is None else array.ctypes.data_as(c.POINTER(c.c_double))

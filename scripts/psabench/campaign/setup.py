"""What a campaign of gyrocompassing varies: errors of the instrument, schedule of positions, estimation, and the hold.

Fields are in people's units; the names say which. Defaults are the article's error set as it is, read literally.
"""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from psabench.errors import BadInput, expected

CHOICES: dict[str, tuple[str, ...]] = {
    "tilt": ("uniform", "corners"),
    "gimbal": ("alpha", "uncorrected", "corrected"),
    "angle_sys": ("none", "common", "increment", "accumulates"),
    "method": ("closed3", "lsq", "constrained", "gls", "gls_constrained"),
    "axis2": ("same", "differs", "measured", "fixed"),
}

ANY = "any"  # on the command line: drawn for each run

# White noise of a level angle through sensor and converter, arcmin sqrt(s), two-sided: a quartz accelerometer's
# 0.31 ug/rtHz (0.4 nA/rtHz of 1.28 mA/g, E0) and 1.9 ug rms of an ADS1282 at 250 words a second in 103 Hz (SNR 130 dB,
# sources 1.9).
LEVEL_NOISE_ARCMIN_RTS = 8.8e-4

BEFORE_S = 20.0  # from power-on to the first window: running up, levelling, settling


def level_white_degph_rts(window_s: float, m1_per_s: float = 1.0) -> float:
    """White noise of S that a level angle's leaves: 60 n sqrt(m1 dt)/T deg/h a window, n arcmin a sample of dt."""
    return 60.0 * LEVEL_NOISE_ARCMIN_RTS * math.sqrt(m1_per_s / window_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """A virtual instrument, where it is, and what is done with it."""

    latitude_deg: float = 50.0  # the article names none; E0
    latitude_error_arcmin: float = 0.1
    tilt_deg: float = 5.0  # pitch and roll of the parked vehicle
    tilt: str = "uniform"  # within, or at the corners of, +-tilt_deg
    alpha1_deg: float | None = None  # of the platform in position 1; none: anywhere
    gimbal: str = "alpha"  # turns are about the vertical, as the article reads; or of the gimbal, corrected or not
    drift_degph: float = 25.0
    gm_sigma_degph: float = 0.2
    gm_tau_s: float = 1000.0
    gm_from_zero: bool = False
    gm_before_s: float = 0.0  # with it: zero so long before the first window, at power-on
    torquer_scale: float = 0.0  # relative error
    beta_sys_arcmin: float = 10.0  # of the level sensors, all positions alike
    gamma_sys_arcmin: float = 10.0
    beta_random_arcmin: float = 1.0
    gamma_random_arcmin: float = 1.0
    angle_sys_arcmin: float = 6.0  # of the set angle
    angle_sys: str = "common"  # how those 6' are read
    angle_random_arcmin: float = 3.0  # of the set angle, or of the encoder's reading
    # Through the wire: the encoder is read instead of the set angle trusted; the algebra is the same.
    encoder: bool = False
    random_sign: bool = False  # of systematic errors
    per_sample: bool = False  # random errors are drawn a sample and average, instead of once a position
    white_degph_rts: float = 0.0  # white noise of S besides, deg/h sqrt(s)
    angles_deg: tuple[float, ...] = (0.0, 90.0, 180.0)
    window_s: float = 10.0
    gap_s: float = 10.0  # between windows, with slew_dps 0
    slew_dps: float = 0.0
    slew_dps2: float = 0.0  # acceleration of a turn that reaches its rate; 0: at once
    settle_s: float = 0.0
    m1_per_s: float = 1.0  # levelling loop
    m2_per_s: float = 0.0  # azimuth loop, proportional: it is off by drift/m2; 0: an ideal one (algebra only)
    method: str = "closed3"
    simplified: bool = True  # (14) for (13)
    scenario: str = ""  # of an emulator's bench, resolved, as JSON; "": the shipped one

    def __post_init__(self) -> None:
        _check_choices(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hold:
    """The hold of heading that follows, with compensation of the drift that was found."""

    hours: float = 4.0
    step_s: float = 60.0  # extremes are looked for at steps
    # The azimuth axis' drift: the measured axis', another, measured itself; fixed: no gyrocompassing.
    axis2: str = "same"
    axis2_sd_degph: float = 0.0
    heading_deg: float = 0.1  # errors with which a fixed one starts
    drift_error_degph: float = 0.05
    level_arcmin: float = 0.0
    latitude_error_arcmin: float = 0.0
    wait_s: float = 10.0  # between the last window and the hold
    v_east_kmph: float = 0.0
    speed_error: float = 0.0  # relative

    def __post_init__(self) -> None:
        _check_choices(self)


def _check_choices(value: Setup | Hold) -> None:
    for name, allowed in CHOICES.items():
        given = getattr(value, name, allowed[0])
        if given not in allowed:
            raise ValueError(expected(", ".join(allowed), repr(given), name))


def as_input(setup: Setup, hold: Hold | None) -> dict[str, Any]:
    """For the key of a series: JSON's types only."""
    found = {"setup": dataclasses.asdict(setup)} | ({} if hold is None else {"hold": dataclasses.asdict(hold)})
    found["setup"]["angles_deg"] = list(setup.angles_deg)
    return found


def changed(setup: Setup, words: Sequence[str]) -> Setup:
    """With NAME=VALUE of the command line. Raises BadInput for a name or a value that does not fit."""
    kinds = typing.get_type_hints(Setup)
    for word in words:
        name, equals, text = word.partition("=")
        if not equals or name not in kinds or name == "scenario":
            names = ", ".join(k for k in kinds if k != "scenario")
            raise BadInput(expected(f"NAME=VALUE with a name of {names}", repr(word), "--set"))
        try:
            setup = dataclasses.replace(setup, **{name: _value(text, kinds[name])})
        except ValueError as e:
            raise BadInput(f"--set {word}: {e}") from e
    return setup


def _value(text: str, kind: Any) -> Any:
    if kind is bool:
        if text not in ("yes", "no"):
            raise ValueError(expected("yes or no", repr(text)))
        return text == "yes"
    if isinstance(kind, types.GenericAlias):  # tuple of numbers
        return tuple(_number(x) for x in text.split(","))
    if text == ANY and kind == float | None:
        return None
    return text if kind is str else _number(text)


def _number(text: str) -> float:
    value = float(text)
    if not -1e12 < value < 1e12:
        raise ValueError(expected("a number within +-1e12", repr(text)))
    return value

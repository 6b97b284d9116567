"""What a campaign of gyrocompassing varies: errors of the instrument, schedule of positions, estimation, and the hold.

Fields are in people's units; the names say which. Defaults are the article's error set as it is, read literally.
"""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Sequence
from dataclasses import dataclass, field
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


@dataclass(frozen=True, slots=True)
class Setting:
    """What `--set` takes for a field: a number, or a list of numbers, from low to high."""

    about: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf


def _setting(default: Any, about: str, *number: Any) -> Any:
    """A field that `--set` takes; number: its unit and range."""
    return field(default=default, metadata={"setting": Setting(about, *number)})


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """A virtual instrument, where it is, and what is done with it."""

    latitude_deg: float = _setting(50.0, "latitude of the instrument", "deg", -90, 90)  # the article names none; E0
    latitude_error_arcmin: float = _setting(0.1, "error of the latitude that the host gets", "arcmin", -599, 599)
    tilt_deg: float = _setting(5.0, "pitch and roll of the parked vehicle", "deg", 0, 30)
    tilt: str = _setting("uniform", "tilt drawn within +-tilt_deg, or at the corners")
    alpha1_deg: float | None = _setting(None, "platform azimuth in position 1", "deg", -360, 360)  # None: anywhere
    # alpha: as the article reads.
    gimbal: str = _setting("alpha", "steps about the vertical (alpha) or of the gimbal angle (uncorrected, corrected)")
    drift_degph: float = _setting(25.0, "mean drift about the measuring axis", "deg/h", -1e4, 1e4)
    gm_sigma_degph: float = _setting(0.2, "random drift, standard deviation of a Gauss-Markov process", "deg/h", 0, 1e4)
    gm_tau_s: float = _setting(1000.0, "correlation time of the random drift", "s", 0.1, 1e9)
    gm_from_zero: bool = _setting(False, "random drift begins at zero")
    gm_before_s: float = _setting(0.0, "time from power-on to the first window, for gm_from_zero", "s", 0, 1e6)
    torquer_scale: float = _setting(0.0, "relative error of the torquer", "", -0.2, 0.2)
    beta_sys_arcmin: float = _setting(10.0, "constant error of the level sensor of beta", "arcmin", -299, 299)
    gamma_sys_arcmin: float = _setting(10.0, "constant error of the level sensor of gamma", "arcmin", -299, 299)
    beta_random_arcmin: float = _setting(
        1.0, "random error of the level sensor of beta, new in each position", "arcmin", 0, 600
    )
    gamma_random_arcmin: float = _setting(
        1.0, "random error of the level sensor of gamma, new in each position", "arcmin", 0, 600
    )
    angle_sys_arcmin: float = _setting(6.0, "constant error of the set angle", "arcmin", -600, 600)
    angle_sys: str = _setting("common", "how the constant angle error acts")  # how the article's 6' are read
    # Of the set angle, or of the encoder's reading.
    angle_random_arcmin: float = _setting(3.0, "random error of an angle, new in each position", "arcmin", 0, 600)
    encoder: bool = _setting(False, "read the encoder (on an emulated board; the algebra is the same)")
    random_sign: bool = _setting(False, "draw the sign of constant errors for each run")
    per_sample: bool = _setting(False, "draw random errors every 10 ms, so that they average")
    white_degph_rts: float = _setting(0.0, "white noise of the levelling rate", "deg/h sqrt(s)", 0, 1e4)
    angles_deg: tuple[float, ...] = _setting((0.0, 90.0, 180.0), "positions in order, 3 to 64", "deg", -36000, 36000)
    window_s: float = _setting(10.0, "measuring time in a position", "s", 0.01, 86400)
    gap_s: float = _setting(10.0, "time between windows if slew_dps is 0", "s", 0, 86400)
    slew_dps: float = _setting(0.0, "rate of the turns; 0: use gap_s", "deg/s", 0, 1000)
    slew_dps2: float = _setting(0.0, "acceleration of the turns; 0: infinite", "deg/s2", 0, 1000)
    settle_s: float = _setting(0.0, "time from a turn to its window, with slew_dps", "s", 0, 86400)
    m1_per_s: float = _setting(1.0, "gain of the levelling loop", "1/s", 0.01, 20)
    m2_per_s: float = _setting(0.0, "gain of the azimuth loop (error drift/m2); 0: ideal (algebra only)", "1/s", 0, 20)
    method: str = _setting("closed3", "estimator")
    simplified: bool = _setting(True, "eq. (14) instead of (13)")
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

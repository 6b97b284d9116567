"""What `--set` takes: a line a field of `Setup`, its range, and what it means to a person who has not read the code.

A value out of its range is rejected by name before anything is computed; what only the algebra sees (positions that
coincide, a latitude that leaves no horizontal rate) it rejects itself, told with the case.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from psabench.campaign import chains
from psabench.campaign.cases import Case
from psabench.campaign.chains import Wanted
from psabench.campaign.setup import ANY, CHOICES, Setup, changed
from psabench.errors import BadInput, expected
from psabench.native.navlib import library


@dataclass(frozen=True, slots=True)
class Setting:
    """A field; `low` and `high` where it is a number, or a list of numbers."""

    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    about: str = ""


SETTINGS: Mapping[str, Setting] = {
    "latitude_deg": Setting("deg", -90, 90, "latitude of the instrument"),
    "latitude_error_arcmin": Setting("arcmin", -599, 599, "error of the latitude that the host gets"),
    "tilt_deg": Setting("deg", 0, 30, "pitch and roll of the parked vehicle"),
    "tilt": Setting(about="tilt drawn within +-tilt_deg, or at the corners"),
    "alpha1_deg": Setting("deg", -360, 360, "platform azimuth in position 1"),
    "gimbal": Setting(about="steps about the vertical (alpha) or of the gimbal angle (uncorrected, corrected)"),
    "drift_degph": Setting("deg/h", -1e4, 1e4, "mean drift about the measuring axis"),
    "gm_sigma_degph": Setting("deg/h", 0, 1e4, "random drift, standard deviation of a Gauss-Markov process"),
    "gm_tau_s": Setting("s", 0.1, 1e9, "correlation time of the random drift"),
    "gm_from_zero": Setting(about="random drift begins at zero"),
    "torquer_scale": Setting("", -0.2, 0.2, "relative error of the torquer"),
    "beta_sys_arcmin": Setting("arcmin", -299, 299, "constant error of the level sensor of beta"),
    "gamma_sys_arcmin": Setting("arcmin", -299, 299, "constant error of the level sensor of gamma"),
    "beta_random_arcmin": Setting("arcmin", 0, 600, "random error of the level sensor of beta, new in each position"),
    "gamma_random_arcmin": Setting("arcmin", 0, 600, "random error of the level sensor of gamma, new in each position"),
    "angle_sys_arcmin": Setting("arcmin", -600, 600, "constant error of the set angle"),
    "angle_sys": Setting(about="how the constant angle error acts"),
    "angle_random_arcmin": Setting("arcmin", 0, 600, "random error of an angle, new in each position"),
    "encoder": Setting(about="read the encoder (on an emulated board; the algebra is the same)"),
    "random_sign": Setting(about="draw the sign of constant errors for each run"),
    "per_sample": Setting(about="draw random errors every 10 ms, so that they average"),
    "white_degph_rts": Setting("deg/h sqrt(s)", 0, 1e4, "white noise of the levelling rate"),
    "angles_deg": Setting("deg", -36000, 36000, "positions in order, 3 to 64"),
    "window_s": Setting("s", 0.01, 86400, "measuring time in a position"),
    "gap_s": Setting("s", 0, 86400, "time between windows if slew_dps is 0"),
    "slew_dps": Setting("deg/s", 0, 1000, "rate of the turns; 0: use gap_s"),
    "slew_dps2": Setting("deg/s2", 0, 1000, "acceleration of the turns; 0: infinite"),
    "m1_per_s": Setting("1/s", 0.01, 20, "gain of the levelling loop"),
    "m2_per_s": Setting("1/s", 0, 20, "gain of the azimuth loop (error drift/m2); 0: ideal (algebra only)"),
    "gm_before_s": Setting("s", 0, 1e6, "time from power-on to the first window, for gm_from_zero"),
    "settle_s": Setting("s", 0, 86400, "time from a turn to its window, with slew_dps"),
    "method": Setting(about="estimator"),
    "simplified": Setting(about="eq. (14) instead of (13)"),
}


def base(words: Sequence[str], start: Setup | None = None) -> Setup:
    """`start`, else the article's errors, with NAME=VALUE of the command line. Raises BadInput that names the field."""
    setup = start or Setup()
    for word in words:
        name = word.partition("=")[0]
        if near := difflib.get_close_matches(name, SETTINGS, 3) if name not in SETTINGS else []:
            raise BadInput(expected(f"a setting that --list names ({', '.join(near)}?)", name, f"--set {word}"))
        setup = changed(setup, [word])
        if reason := out_of_range(setup, name):
            raise BadInput(f"--set {word}: {reason}")
    return setup


def out_of_range(setup: Setup, name: str) -> str:
    """Why the field's value is rejected, "": it is not."""
    s, value = SETTINGS.get(name, Setting()), getattr(setup, name)
    if value is None or isinstance(value, str | bool):
        return ""
    if name == "angles_deg" and not 3 <= len(value) <= 64:
        return expected("3 to 64 positions", len(value), name)
    for x in value if isinstance(value, tuple) else (value,):
        if not s.low <= x <= s.high:
            return expected(f"{s.low:g} to {s.high:g}{s.unit and ' '}{s.unit}", f"{x:g}", name)
    return ""


def rehearse(cases: Sequence[Case], words: Sequence[str]) -> None:
    """One run of each case: what the algebra rejects is reported before any worker starts. Raises BadInput."""
    library()  # where there is none, that is no case's fault
    for case in cases:
        try:
            chains.compute([Wanted(chain="closed", setup=case.setup, hold=case.hold, seed=0, first_run=0, runs=1)])
        except BadInput as e:
            told = "".join(f"--set {w}: " for w in words)
            raise BadInput(f"{told}case {case.name}: {e}") from e


def lines() -> Iterator[str]:
    """Of --list: name, the article's value, unit or choices, meaning."""
    plain = Setup()
    shown = {name: f"{name}={_shown(getattr(plain, name))}" for name in SETTINGS}
    width = max(map(len, shown.values()))
    for name, s in SETTINGS.items():
        choices = f" ({', '.join(CHOICES[name])})" if name in CHOICES else ""
        unit = f"{s.unit}; " if s.unit else ""
        yield f"  {shown[name]:{width}}  {unit}{s.about}{choices}"


def _shown(value: object) -> str:
    if value is None or isinstance(value, bool):
        return {None: ANY, True: "yes", False: "no"}[value]
    return ",".join(f"{x:g}" for x in value) if isinstance(value, tuple) else f"{value}"

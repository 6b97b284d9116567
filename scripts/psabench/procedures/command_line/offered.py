"""What `psabench run` offers: procedures with their summaries, benches of the calibrations. Loads no library."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

ON_THE_HEAD: Mapping[str, str] = {
    "turns": "test turns, eqs (1)-(11): u0, kx, ky, kz from six positions",
    "fourier": "Fourier series over a turn, eqs (12)-(18): u0, alpha0, kx, ky, kxy",
    "reversal": "two Fourier series with the sensor reversed about Ox: the reliable procedure",
}
ON_THE_PLATFORM: Mapping[str, str] = {
    "gyrocompass": "north and the drifts of a gyro platform from several positions: the article's method and an "
    "improved one",
    "heading-hold": "gyrocompassing, then heading kept for hours with the drifts compensated",
}
ALL = "all"  # those of the head, each on each bench
COMPARE = (
    "compare-converters",
    "one motion to every generation of converters: resolution, noise, drift, velocity error",
)
THERMAL = (
    "thermal",
    "accelerometers in a chamber, at points of temperature and during a sweep: scale, zero and base, compensated",
)
SINS = (
    "sins-calibration",
    "a strapdown inertial unit on a rate table, with or without the table's angles: all errors of both triads at once",
)
MEMS_GYRO = (
    "mems-gyro",
    "a micromechanical gyro on a rate table of three axes: zero, scale, cross-axis, g-sensitivity, nonlinearity, noise",
)
COVARIANCE = (
    "sins-covariance",
    "accuracy of a strapdown unit's calibration on a rate table, predicted from the plan of rotations; no bench",
)
SNAKE = (
    "sins-snake",
    "covariance of an hour's flight after a calibration on the table: the article's 1900 and 1100 m; no bench",
)
SECONDARY = (
    "sins-calibration-secondary",
    "a strapdown unit on a rate table from its own navigation: one experiment calibrates, the next one is compensated",
)

KOI_FLIGHT = (
    "koi-flight",
    "a flight of an inertial unit with a satellite receiver: alignment, correction at take-off, both solutions",
)
KOI_SEASON = (
    "koi-season",
    "flights of one unit, each with what its passport has learned of its sensors by then; stopped, it goes on",
)

G_MPS2 = 9.80665  # standard gravity (CGPM 1901); the site's own value is the user's to give
SITE_G_MPS2 = 9.8094  # of the scenarios that the conditions use: an operator knows the gravity of the laboratory


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """One way to run a procedure on our own emulator."""

    label: str
    scenario: str
    average: int  # samples in a reading, 0: whole conversion words (WireBench)
    g_mps2: float = SITE_G_MPS2
    exact: bool = False  # the chain and the head have no tolerances: their uncertainties are 0


# quiet: no noise, no tolerances, whole 32-bit words: the printed figures. realistic: another unit for each seed, with
# 1 mV of sensor noise, quadratic terms, drift, the chain's tolerances, and a head that errs: what a bench would find.
CONDITIONS: Mapping[str, Condition] = {
    "quiet": Condition(label="quiet", scenario="quiet", average=0, exact=True),
    "realistic": Condition(label="realistic", scenario="realistic", average=16),
}

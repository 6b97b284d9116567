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
COMPARE = (
    "compare-converters",
    "one motion to every generation of converters: resolution, noise, drift, velocity error",
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


# quiet: no noise, no tolerances, whole 32-bit words: the printed figures. realistic: 1 mV sensor noise, tolerances,
# converter noise of 4.5 uV a sample at the load, far below the sensor's: what a bench would find.
CONDITIONS: Mapping[str, Condition] = {
    "quiet": Condition(label="quiet", scenario="quiet", average=0),
    "realistic": Condition(label="realistic", scenario="calibrate", average=16),
}

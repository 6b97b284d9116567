"""What is known of a bench beside its readings: standard uncertainties that no reading shows."""

from __future__ import annotations

from dataclasses import dataclass

from psabench.errors import expected
from psabench.procedures.result import option


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchAccuracy:
    """Of one unit on one dividing head; the figures of PSA-2 are E0 (docs/procedures/uncertainty.md)."""

    chain_gain_ppm: float = option(50.0, "ppm", "gain of the measuring chain at 25 °C: divider and reference")
    chain_zero_uv: float = option(100.0, "uV", "zero of the measuring chain at 25 °C, at the load")
    chain_gain_tc_ppm_per_k: float = option(5.0, "ppm/K", "temperature coefficient of that gain")
    chain_zero_tc_uv_per_k: float = option(10.0, "uV/K", "temperature coefficient of that zero")
    chain_off_k: float = option(2.0, "K", "distance of the converter board from 25 °C")
    circle_arcsec: float = option(3.0, "arcsec", "error of the head's divided circle, amplitude, one period a turn")
    mount_arcsec: float = option(3.0, "arcsec", "tilt about the head's axis, at each mounting")

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            if not getattr(self, name) >= 0.0:
                raise ValueError(expected("0 or more", getattr(self, name), name))


# Of a bench in which nothing is hidden: the emulator with all tolerances and errors at zero.
EXACT = dict.fromkeys(BenchAccuracy.__dataclass_fields__, 0.0)

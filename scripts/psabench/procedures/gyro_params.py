"""All parameters of `psabench run gyrocompass` and `heading-hold`: which reading, and those of the procedures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from psabench.errors import expected
from psabench.procedures import gyrocompass_params, heading_hold
from psabench.procedures.gyrocompass_params import READINGS, GyrocompassParams
from psabench.procedures.heading_hold import HoldParams
from psabench.procedures.result import option

BOTH = "both"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingParams:
    """Which reading of the article."""

    reading: str = option(BOTH, "", f"{', '.join(READINGS)} or {BOTH}; gives the other parameters their values")

    def __post_init__(self) -> None:
        if self.reading not in (*READINGS, BOTH):
            raise ValueError(expected(f"{', '.join(READINGS)} or {BOTH}", repr(self.reading), "reading"))

    @property
    def readings(self) -> tuple[str, ...]:
        return tuple(READINGS) if self.reading == BOTH else (self.reading,)


# Parameters of each procedure, by their dataclasses.
PARAMS: Mapping[str, tuple[type[Any], ...]] = {
    gyrocompass_params.NAME: (ReadingParams, GyrocompassParams),
    heading_hold.NAME: (ReadingParams, HoldParams, GyrocompassParams),
}


def fields_of(procedure: str) -> dict[str, Any]:
    """All parameters of a procedure, dataclass fields by name."""
    return {name: f for kind in PARAMS[procedure] for name, f in kind.__dataclass_fields__.items()}

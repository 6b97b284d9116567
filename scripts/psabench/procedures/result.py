"""What every procedure returns, so that one report serves them all."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected
from psabench.estimate.face import Face
from psabench.estimate.uncertainty import Correlation, Estimate
from psabench.procedures.head_bench import Reading

Params = TypeVar("Params")
Array = npt.NDArray[np.float64]

DEG = 180.0 / math.pi
Z95 = 1.96  # standard deviations: half width of a 95 % interval
LIMIT_CI = 2.0  # an estimate is out of limits beyond this many half widths of its own 95 % interval


def option(default: Any, unit: str, text: str) -> Any:
    """A field of a parameter dataclass, with what `--help` says of it."""
    return field(default=default, metadata={"unit": unit, "help": text})


def fields_of(kind: type[Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Those of `given` that a dataclass has."""
    return {name: value for name, value in given.items() if name in kind.__dataclass_fields__}


def made_params(kind: type[Params], procedure: str, given: Mapping[str, Any]) -> Params:
    """A dataclass of parameters with those of `given` that it has. Raises BadInput for a value out of range."""
    try:
        return kind(**fields_of(kind, given))
    except ValueError as e:
        raise BadInput(f"{procedure}: {e}") from e


@dataclass(frozen=True, slots=True, kw_only=True)
class FaceSeries:
    """What was fitted on one face beside its fit, for plots: positions (series) or single readings (turns)."""

    face: Face
    alpha_deg: Array  # (m,)
    u_v: Array  # (m,)
    residual_v: Array  # (m,)
    realisation: npt.NDArray[np.int64]  # (m,)
    c_v: Array | None  # (5,), None when the procedure fits no series


def estimate_named(estimates: Sequence[Estimate], name: str, where: str) -> Estimate:
    """The estimate of that name. Raises KeyError with the names there are."""
    for e in estimates:
        if e.name == name:
            return e
    raise KeyError(expected(", ".join(e.name for e in estimates), name, where))


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcedureResult:
    """Estimates with their confidence, and everything a report shows."""

    procedure: str
    axis: str
    g_mps2: float
    readings: tuple[Reading, ...]
    series: tuple[FaceSeries, ...]
    estimates: tuple[Estimate, ...]
    correlation: Correlation
    residual_rms_v: float
    drift: Estimate | None  # V/s; None when no drift column was fitted
    notes: tuple[str, ...]  # warnings a reader needs to judge the numbers
    doubts: tuple[str, ...] = ()  # reasons not to trust the intervals

    def get(self, name: str) -> Estimate:
        """The estimate of that name; raises KeyError with the names there are."""
        return estimate_named(self.estimates, name, f"estimate of {self.procedure}")

    @property
    def duration_s(self) -> float:
        """Bench time from the first reading to the last."""
        return self.readings[-1].t_s - self.readings[0].t_s if self.readings else 0.0

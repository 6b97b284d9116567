"""The procedures by name: `psabench.procedures.command_line.offered` says what each is for.

A procedure is one function, `run(bench, params, watch)`, that measures and then calls `estimate(readings,
params)`, which is pure: an interrupted run is estimated from the readings that were recorded
(`recording.load_csv`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from psabench.estimate.model import Sensor
from psabench.estimate.uncertainty import Estimate
from psabench.procedures.fourier import (
    FourierParams,
    estimate_fourier,
    expected_fourier,
    fit_fourier,
    flag_fourier,
    fourier,
)
from psabench.procedures.result import ProcedureResult
from psabench.procedures.reversal import ReversalParams, estimate_reversal, expected_reversal, fit_reversal, reversal
from psabench.procedures.turns import TurnsParams, estimate_turns, expected_turns, fit_turns, turns


@dataclass(frozen=True, slots=True)
class Procedure:
    """One row of the registry; `params` is the dataclass that `run` and `estimate` take."""

    name: str
    params: type[Any]
    run: Callable[..., ProcedureResult]  # (bench, params, watch) -> result
    estimate: Callable[..., ProcedureResult]  # (readings, params, g_mps2) -> result
    fit: Callable[..., ProcedureResult]  # the same without its doubts: for the budget, which fits again and again
    # truth, and at the side faces -> what each estimate should have been
    expected: Callable[[Sensor, Sensor], Mapping[str, float]]
    flag: Callable[[Sequence[Estimate], Any], list[Estimate]]  # which estimates the data do not determine


def _keep_flags(estimates: Sequence[Estimate], _: Any) -> list[Estimate]:
    """Its flags do not hang on the intervals."""
    return list(estimates)


PROCEDURES: Mapping[str, Procedure] = {
    p.name: p
    for p in (
        Procedure("turns", TurnsParams, turns, estimate_turns, fit_turns, expected_turns, _keep_flags),
        Procedure("fourier", FourierParams, fourier, estimate_fourier, fit_fourier, expected_fourier, flag_fourier),
        Procedure(
            "reversal", ReversalParams, reversal, estimate_reversal, fit_reversal, expected_reversal, _keep_flags
        ),
    )
}

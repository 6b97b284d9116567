"""PREFLIGHT_CALIBRATION: an existing procedure on the dividing head, followed and ended from outside.

The procedure is one of `psabench.procedures.registry`; it measures over CAN and SCPI as `psabench run` does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from psabench.bench import Bench
from psabench.procedures.head_bench import Reading, Watch
from psabench.procedures.registry import PROCEDURES
from psabench.procedures.result import ProcedureResult, made_params
from psabench.procedures.wire_bench import WireBench
from psabench.progress import Advance

# Of an estimate's name, so that "CAL_" and the rest are a parameter's 16 characters.
_ENDINGS = (("_v_per_g2", ""), ("_v_per_g", ""), ("_deg", "_DEG"), ("_v", "_V"))


class Cancelled(Exception):
    """A ground station asked to end the calibration."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationPlan:
    """What a calibration does."""

    procedure: str = "turns"
    params: Mapping[str, Any]
    average: int
    g_mps2: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationResult:
    """One number of it."""

    name: str
    value: float
    sd: float
    unit: str

    @property
    def parameter(self) -> str:
        """Its name as a parameter: "kx_v_per_g" is CAL_KX."""
        name = self.name
        for ending, short in _ENDINGS:
            if name.endswith(ending):
                name = name.removesuffix(ending) + short
                break
        return f"CAL_{name.upper()}"[:16]


class _Progress:
    """Steps of a procedure as percent of the whole; a look at the wish to end it with each part."""

    def __init__(self, steps: int, percent: Callable[[int], None], cancelled: Callable[[], bool]) -> None:
        self._steps, self._begun = steps, 0
        self._percent, self._cancelled = percent, cancelled

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Advance]:
        done = 0

        def advance(note: str = "") -> None:
            del note
            nonlocal done
            done += 1
            share = (self._begun + done / total) / max(self._steps, self._begun + 1)
            self._percent(min(99, math.floor(100 * share)))
            self.look()

        self.look()
        yield advance
        self._begun += 1

    def look(self) -> None:
        if self._cancelled():
            raise Cancelled


def calibrate(
    bench: Bench,
    plan: CalibrationPlan,
    *,
    percent: Callable[[int], None],
    cancelled: Callable[[], bool],
    reading: Callable[[Reading], None],
) -> ProcedureResult:
    """Run the procedure. Raises Cancelled between two readings, BenchError where the bench fails, ValueError."""
    procedure = PROCEDURES[plan.procedure]
    params = made_params(procedure.params, plan.procedure, plan.params)
    progress = _Progress(2 if plan.procedure != "fourier" else 1, percent, cancelled)

    def record(r: Reading) -> None:
        reading(r)
        progress.look()

    on_head = WireBench(bench.unit, bench.head, average=plan.average, g_mps2=plan.g_mps2)
    return procedure.run(on_head, params, Watch(progress=progress, record=record))


def results_of(result: ProcedureResult) -> list[CalibrationResult]:
    """All estimates of a procedure."""
    return [CalibrationResult(name=e.name, value=e.value, sd=e.sd, unit=e.unit) for e in result.estimates]

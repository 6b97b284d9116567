"""`psabench run mems-gyro`: measure on a bench, estimate, and beside an emulator's truth the errors."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from psabench.bench import Bench
from psabench.boards.psa2.device import Psa2
from psabench.budget.gum import COVERAGE
from psabench.errors import BadInput, expected
from psabench.estimate.uncertainty import Estimate
from psabench.mems_gyro.fit import MemsGyroResult, estimate_gyro, expected_values
from psabench.mems_gyro.params import NAME, SCENARIO, MemsGyroOptions, MemsGyroParams
from psabench.mems_gyro.plan import Dwell
from psabench.mems_gyro.wire import WireTable, measure_gyro
from psabench.procedures.head_bench import Progress
from psabench.procedures.result import made_params

LIMIT_U = 2.0  # an estimate is out of limits beyond this many U


@dataclass(frozen=True, slots=True, kw_only=True)
class MemsGyroRun:
    """A run that is over."""

    params: MemsGyroParams
    result: MemsGyroResult
    facts: Mapping[str, str]
    truth: Mapping[str, float] | None  # of each estimate, where an emulator's truth port says it

    def en(self, e: Estimate) -> float | None:
        """Error in U; None: not compared."""
        return None if self.truth is None or not e.identifiable else (e.value - self.truth[e.name]) / e.ci_half

    @property
    def compared(self) -> list[float]:
        found = (self.en(e) for e in (*self.result.estimates, *self.result.noise))
        return [x for x in found if x is not None]

    @property
    def within(self) -> bool:
        return not self.result.doubts and all(abs(x) <= LIMIT_U for x in self.compared)


class TruthWatch:
    """How the zero of the gyro moves in the rests of the series: for the grade alone, no estimate sees it."""

    def __init__(self, bench: Bench, channel: int) -> None:
        self._bench, self._channel = bench, channel
        self._seen: list[float] = []
        self._rests: list[float] = []

    def __call__(self, d: Dwell | None) -> None:
        if self._bench.truth_path is None:
            return
        if d is None:
            self._seen.append(float(self._bench.truth_state()["unit"]["zero_moved_v"][self._channel]))
            return
        if d.at_rest and not d.recording:
            self._rests.append(float(np.mean(self._seen)))
        self._seen.clear()

    @property
    def mean_v(self) -> float:
        return float(np.mean(self._rests))


def run_gyro(options: MemsGyroOptions, progress: Progress) -> MemsGyroRun:
    """Measure, estimate, grade; the readings are in OUT/dwells.csv as they come. Raises BadInput, BenchError."""
    p = made_params(MemsGyroParams, NAME, options.params)
    options.out.mkdir(parents=True, exist_ok=True)
    dwells: list[Dwell] = []
    with options.open_bench(SCENARIO, "wall" if options.real_time else "step") as bench:
        if not any(isinstance(u, Psa2) for u in bench.units.values()):
            raise BadInput(expected(f"a scenario with a PSA-2 on a table, as {SCENARIO}", "none", "--scenario"))
        right = _truth_of(bench, p) if bench.truth_path else None
        watch = TruthWatch(bench, p.channel)
        table = WireTable(bench, p, watch)
        try:
            measure_gyro(table, p, progress, dwells.append)
        finally:  # Ctrl-C, too: what was measured is kept
            write_dwells(options, dwells)
    result = estimate_gyro(dwells, p)
    truth = right and right | {"zero_v": right["zero_v"] + watch.mean_v}
    where = str(options.can or options.control or options.scenario or SCENARIO)
    recorded = f"{sum(d.duration_s for d in dwells):.0f} s"
    return MemsGyroRun(params=p, result=result, facts={"bench": where, "recorded": recorded}, truth=truth)


def _truth_of(bench: Bench, p: MemsGyroParams) -> dict[str, float]:
    """Before an hour is measured: of a channel that has a gyro."""
    unit = next(iter(bench.truth()["units"].values()))
    gyro = unit["axes"][p.axis].get("gyro")
    if gyro is None:
        raise BadInput(expected(f"a mems_gyro on channel {p.axis}", unit["axes"][p.axis]["sensor"], NAME))
    return expected_values(gyro)


def write_dwells(options: MemsGyroOptions, dwells: Sequence[Dwell]) -> None:
    """A row for each mean of a second."""
    with (options.out / "dwells.csv").open("w", newline="", encoding="utf-8") as f:
        out = csv.writer(f)
        out.writerow(["recording", "t_s", "middle_deg", "inner_deg", "heading_deg", "rate_dps", "u_v"])
        for d in dwells:
            block_s = d.duration_s / len(d.blocks_v)
            for k, u_v in enumerate(d.blocks_v):
                at = (d.middle_deg, d.inner_deg, d.heading_deg, f"{d.rate_dps:.9g}", f"{u_v:.10g}")
                out.writerow([int(d.recording), f"{d.t_s + k * block_s:.6f}", *at])


def verdict_words(run: MemsGyroRun) -> str:
    """One line: what was compared with what."""
    flagged = sum(not e.identifiable for e in (*run.result.estimates, *run.result.noise))
    if run.result.doubts:
        text = "The intervals are not to be trusted: see the doubts."
    elif run.truth is None:
        text = "No truth given: the numbers stand alone."
    else:
        each = run.compared
        out, beyond = (sum(abs(x) > limit for x in each) for limit in (LIMIT_U, 1.0))
        head, within = ("All", "within") if out == 0 else (f"{out} of", "not within")
        text = (
            f"{head} {len(each)} numbers are {within} {LIMIT_U:g} U of the gyro's true parameters, "
            f"{beyond} are beyond U (expected: {(1.0 - COVERAGE) * len(each):.1f})."
        )
    return text + (f" {flagged} flagged numbers are not compared." if flagged else "")

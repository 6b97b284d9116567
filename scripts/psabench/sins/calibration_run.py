"""`psabench run sins-calibration`: a plan of rotations on a bench, or a recording; estimates, truth beside them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from psabench.boards.bins.device import Bins
from psabench.errors import BadInput, BenchError, expected
from psabench.native.nav import Refused
from psabench.native.sins import DEG, Params
from psabench.procedures.head_bench import Progress
from psabench.procedures.result import made_params
from psabench.sins.calibration import SinsResult, estimate_unit
from psabench.sins.calibration_grade import P_LIMIT, Graded, grade_result, truth_of
from psabench.sins.calibration_params import NAME, CalibrationParams, SinsOptions, check_options, longest_cycle_s
from psabench.sins.covariance import QUANTITIES, SAMPLE_S, predict_accuracy, warnings_of
from psabench.sins.layout import read_layout
from psabench.sins.live import LivePass
from psabench.sins.plan import RotationPlan, read_plan
from psabench.sins.readers import read_increments
from psabench.sins.table import AXES, attitudes, moves_of
from psabench.sins.table_drive import parts_of, table_axes
from psabench.sins.table_run import TableData, TableRun
from psabench.sins.table_store import read_angles, write_data

SCENARIO, COARSE = "sins_table", "sins_coarse"


@dataclass(frozen=True, slots=True, kw_only=True)
class SinsRun:
    """A run that is over."""

    params: CalibrationParams
    result: SinsResult
    plan: str
    facts: Mapping[str, str]
    graded: Graded | None
    advice: tuple[str, ...] = ()  # given before the run; none for a recording

    @property
    def within(self) -> bool:
        return not self.result.doubts and (self.graded is None or self.graded.p >= P_LIMIT)


def run_calibration(
    options: SinsOptions, progress: Progress, advise: Callable[[Sequence[str]], None] = lambda _: None
) -> SinsRun:
    """Advise and measure, or read; estimate; grade. What was measured is in OUT. Raises BadInput, BenchError."""
    p = made_params(CalibrationParams, NAME, options.params)
    check_options(options, p)
    plan = read_plan(p.plan or "article")
    azimuth_rad = (plan.axis_azimuth_deg if p.azimuth_deg is None else p.azimuth_deg) * DEG
    options.out.mkdir(parents=True, exist_ok=True)
    advice = () if options.data else tuple(advice_lines(p, plan.with_azimuth(azimuth_rad / DEG)))
    advise(advice)
    if options.data:
        data, truth, facts = _recorded(options), None, {"data": str(options.data)}
    else:
        live = LivePass(lambda dt_s: p.config(dt_s, p.stand, longest_cycle_s(plan)), azimuth_rad)
        data, truth = _measured(options, p, plan, progress, live)
        write_data(options.out, data)
        facts = {"bench": str(options.can or options.control or options.scenario or _scenario(p)), "plan": plan.name}
    start = attitudes(azimuth_rad, np.zeros((1, AXES)))[0]
    stand = data.stand(azimuth_rad) if p.stand else None
    cfg = p.config(data.increments.dt_s, stand is not None, longest_cycle_s(plan))
    with progress.step("estimate, two passes", 1) as advance:
        result = estimate_unit(cfg, start, data.increments, stand)
        advance()
    duration = f"{len(data.increments) * data.increments.dt_s:.0f} s"
    facts |= {"recorded": duration, "table's angles": str(len(data.stand_s)) if stand else "not used"}
    graded = None if truth is None else grade_result(result, truth)
    return SinsRun(params=p, result=result, plan=plan.name, facts=facts, graded=graded, advice=advice)


def advice_lines(p: CalibrationParams, plan: RotationPlan) -> list[str]:
    """What the covariance says of the plan before it is made, and what an operator should know. Raises BadInput."""
    cfg = p.config(SAMPLE_S, p.stand, longest_cycle_s(plan))
    try:
        found = predict_accuracy(plan, cfg)
    except Refused as e:
        raise BadInput(f"{NAME}: {e}") from e
    sigmas = (f"{q.label} {found.columns[q.key].rms:.2g} {q.unit}".rstrip() for q in QUANTITIES)
    return [f"predicted sd: {', '.join(sigmas)}", *(f"WARNING: {w}" for w in warnings_of(plan, cfg, found))]


def _scenario(p: CalibrationParams) -> str:
    return SCENARIO if p.stand else COARSE


def _recorded(options: SinsOptions) -> TableData:
    assert options.data
    increments = read_increments(options.data, read_layout(options.layout) if options.layout else None)
    return read_angles(options.angles, increments)


def _measured(
    options: SinsOptions, p: CalibrationParams, plan: RotationPlan, progress: Progress, live: LivePass
) -> tuple[TableData, Params | None]:
    """On a bench that is there, or on an emulator started for it; then with the truth."""
    with options.open_bench(_scenario(p), "wall" if options.real_time else "step") as bench:
        units = [u for u in bench.units.values() if isinstance(u, Bins)]
        if not units:
            raise BadInput(expected(f"a scenario with an inertial unit, as {SCENARIO}", "none", "--scenario"))
        moves = list(moves_of(plan.turns, table_axes(bench)))
        with progress.step(f"plan {plan.name}", parts_of(moves)) as advance:
            run = TableRun(bench, moves, advance, live)
            try:
                data = run.measure(p.stand)
            except BaseException:  # Ctrl-C, too: what was measured is kept
                with suppress(BenchError):
                    write_data(options.out, run.data())
                raise
        return data, truth_of(bench) if bench.emulator else None

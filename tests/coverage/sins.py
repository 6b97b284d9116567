"""Coverage of the intervals of `psabench run sins-calibration`: units through the wire, with and without angles."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from psabench.bench import Bench
from psabench.estimate.uncertainty import t_quantile
from psabench.procedures.head_bench import Silent
from psabench.sins import calibration_run as sins_run
from psabench.sins.calibration import estimate_unit
from psabench.sins.calibration_grade import Graded, grade_result, truth_of
from psabench.sins.calibration_params import CalibrationParams, longest_cycle_s
from psabench.sins.plan import read_plan
from psabench.sins.table import attitudes, moves_of
from psabench.sins.table_run import TableRun
from scipy import stats

EPILOG = """\
examples (in the root of a checkout, with PYTHONPATH=.):
  python -m tests.coverage.sins                   20 units, the article's plan: five minutes of two cores
  python -m tests.coverage.sins --units 4 --plan two_rates

The table is the one of docs/procedures/sins_calibration.md.
"""


def one_unit(seed: int, plan_name: str) -> tuple[dict[str, tuple[Graded, np.ndarray]], float]:
    """Graded with and without the table's angles, from the same data; seconds of the measurement."""
    p, plan = CalibrationParams(plan=plan_name), read_plan(plan_name)
    began_s = time.monotonic()
    with Bench.start(sins_run.SCENARIO, seed=seed) as bench:
        with Silent().step("", 1) as advance:
            data = TableRun(bench, list(moves_of(plan.turns, 3)), advance).measure(True)
        truth = truth_of(bench)
    took_s = time.monotonic() - began_s
    start, found = attitudes(0.0, np.zeros((1, 3)))[0], {}
    for name, angles in (("with angles", data.stand(0.0)), ("without", None)):
        cfg = p.config(data.increments.dt_s, angles is not None, longest_cycle_s(plan))
        result = estimate_unit(cfg, start, data.increments, angles)
        graded = grade_result(result, truth)
        sd = {p.name: p.sd for p in result.parameters}
        found[name] = graded, graded.error / np.array([sd[n] for n in graded.names])
    return found, took_s


def main(argv: Sequence[str] | None = None) -> int:
    """Prints a row for each way to calibrate."""
    raw = argparse.RawTextHelpFormatter
    p = argparse.ArgumentParser(description=__doc__, epilog=EPILOG, formatter_class=raw)
    p.add_argument("--units", type=int, default=20, help="units (%(default)s)")
    p.add_argument("--first", type=int, default=1, help="seed of the first (%(default)s)")
    p.add_argument("--plan", default="article", help="plan of rotations (%(default)s)")
    p.add_argument("--workers", type=int, default=1, help="processes (%(default)s)")
    args = p.parse_args(argv)
    seeds = range(args.first, args.first + args.units)
    with ProcessPoolExecutor(args.workers) as pool:
        done = []
        for unit in pool.map(one_unit, seeds, [args.plan] * args.units):
            done.append(unit)
            print(f"{len(done)} of {args.units}, {unit[1]:.1f} s", file=sys.stderr, flush=True)
    print(f"| {args.units} units | within ± 95 % | rms of error/sd | mean of chi-square/21 | p of their sum |")
    print("|---|---|---|---|---|")
    for name in ("with angles", "without"):
        sizes = np.array([unit[0][name][1] for unit in done])
        squares = np.array([unit[0][name][0].chi_square for unit in done])
        total = stats.chi2.sf(squares.sum(), sizes.size)
        inside = np.mean(np.abs(sizes) <= t_quantile(math.inf))
        rms = np.sqrt(np.mean(sizes**2))
        print(f"| {name} | {100 * inside:.1f} % | {rms:.2f} | {squares.mean() / sizes.shape[1]:.2f} | {total:.2f} |")
    print(f"largest error/sd {max(np.abs(u[0][n][1]).max() for u in done for n in u[0]):.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

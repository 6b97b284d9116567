"""Coverage of the uncertainties of `psabench run thermal`: fresh units, their tolerances and the bench's drawn."""

from __future__ import annotations

import argparse
import copy
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from psabench.budget.accuracy import EXACT
from psabench.procedures.head_bench import Silent
from psabench.report import thermal_grading
from psabench.thermal.budget import PLAY_K, TEMP_U_K
from psabench.thermal.run import ThermalOptions, run_thermal

ROOT = Path(__file__).resolve().parents[2]
UNIT = ROOT / "examples/thermal/small_unit.yaml"
SCHEDULE = ROOT / "examples/thermal/small_schedule.yaml"
REALISTIC = ROOT / "proto/scenarios/realistic.yaml"
BENCHES = ("tolerances", "exact")
POSITIONS = ["z_down", "z_up", "x_down", "x_up", "y_down", "y_up"]  # the first face is mounted, too, and so drawn
SENSOR_A_PER_K, AT_K = 1e-6, 308.0  # of a temperature sensor; the middle of the schedule
RESAMPLED = 2000  # by unit: values of one unit share its errors

EPILOG = """\
examples (in the root of a checkout, with PYTHONPATH=.):
  python -m tests.coverage.thermal                    60 units on a bench with tolerances: two minutes of two cores
  python -m tests.coverage.thermal --bench exact      chain and mounting without error, and U that knows it

The table is the one of docs/procedures/thermal.md.
"""

Values = Mapping[str, Sequence[float]]  # En of one unit, by method and kind of quantity


def scenario_of(seed: int, bench: str) -> dict[str, Any]:
    """The small unit; of the seed: three sensors of the batch, play and sensor of the case within what U says of them.

    The circle of the emulated head has one phase, so no seed would draw it: it has no error, and U knows that.
    """
    rng = np.random.default_rng([20151110, seed])
    made: dict[str, Any] = yaml.safe_load(UNIT.read_text(encoding="utf-8"))
    unit = made["units"][0]
    for axis in "xyz":
        unit["axes"][axis] = copy.deepcopy(unit["axes"][axis])
        unit["axes"][axis]["quartz"]["play_k"] = float(rng.uniform(0.0, PLAY_K))
    off_k = float(rng.normal(0.0, TEMP_U_K))
    unit["profile_set"] = {"temp_sensor_a_per_k": SENSOR_A_PER_K * (1.0 + off_k / AT_K)}
    if bench == "tolerances":
        realistic = yaml.safe_load(REALISTIC.read_text(encoding="utf-8"))
        made["spread"]["afe"] = realistic["spread"]["afe"]
        made["head"]["mount_error_arcsec_rms"] = realistic["head"]["mount_error_arcsec_rms"]
    return made


def values_of(bench: str, seed: int) -> Values:
    """A run through the wire, and the truth beside it."""
    params = {"circle_arcsec": 0.0} if bench == "tolerances" else dict(EXACT)
    with tempfile.TemporaryDirectory(prefix="psabench-") as work:
        scenario = Path(work) / "scenario.yaml"
        scenario.write_text(yaml.safe_dump(scenario_of(seed, bench)), encoding="utf-8")
        schedule = Path(work) / "schedule.yaml"
        plan = yaml.safe_load(SCHEDULE.read_text(encoding="utf-8")) | {"positions": POSITIONS}
        schedule.write_text(yaml.safe_dump(plan), encoding="utf-8")
        options = ThermalOptions(
            out=Path(work) / "run", scenario=scenario, schedule=str(schedule), seed=seed, params=params
        )
        with run_thermal(options, Silent()) as done:
            truth = thermal_grading.read_truth(done.folder, done.result.recordings)
            graded = thermal_grading.graded_report(done.result, truth, done.facts).graded
    found: dict[str, list[float]] = {}
    for g in graded:
        kind = g.estimate.name.partition("_")[0]
        found.setdefault(f"{g.method} {kind}", []).append(float(g.en or 0.0))
    return found


def runs_of(bench: str, seeds: Sequence[int], jobs: int) -> list[Values]:
    """One for each seed."""
    with ProcessPoolExecutor(jobs) as pool:
        return list(pool.map(partial(values_of, bench), seeds))


def share_of(runs: Sequence[Values], key: str = "") -> tuple[int, float, tuple[float, float]]:
    """Values, share within U, and its 95 % interval by drawing units again. key: "" for all of them."""
    each = [[abs(en) <= 1.0 for name, ens in run.items() if key in ("", name) for en in ens] for run in runs]
    counts = np.array([(sum(hits), len(hits)) for hits in each], dtype=np.float64)
    drawn = counts[np.random.default_rng(0).integers(0, len(runs), (RESAMPLED, len(runs)))].sum(axis=1)
    low, high = np.quantile(drawn[:, 0] / drawn[:, 1], (0.025, 0.975))
    return int(counts[:, 1].sum()), float(counts[:, 0].sum() / counts[:, 1].sum()), (float(low), float(high))


def markdown_table(runs: Sequence[Values]) -> str:
    """A row a method and kind."""
    lines = [
        f"| {name or '**all**'} | {n} | {100 * share:.1f} % | {100 * low:.1f} to {100 * high:.1f} % |"
        for name in [*runs[0], ""]
        for n, share, (low, high) in [share_of(runs, name)]
    ]
    return "\n".join(["| of | values | within U | 95 % interval, by unit |", "|---|---|---|---|", *lines])


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    p = argparse.ArgumentParser(
        prog="thermal", description=__doc__, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    p.add_argument("--bench", choices=BENCHES, default=BENCHES[0], help="(%(default)s)")
    p.add_argument("--units", type=int, default=60, metavar="N", help="so many seeds (%(default)s)")
    p.add_argument("--first", type=int, default=1001, metavar="N", help="of the seeds (%(default)s)")
    p.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (%(default)s)")
    args = p.parse_args(argv)
    print(markdown_table(runs_of(args.bench, range(args.first, args.first + args.units), args.jobs)))
    return 0


if __name__ == "__main__":
    sys.exit(main())

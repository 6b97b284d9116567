"""Coverage of the intervals of `psabench run mems-gyro`: drawn gyros on a table, through the model or the wire."""

from __future__ import annotations

import argparse
import ctypes
import math
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
from psabench.estimate.uncertainty import Estimate
from psabench.mems_gyro.fit import MemsGyroResult, estimate_gyro, expected_values
from psabench.mems_gyro.params import BLOCK_S, MemsGyroOptions, MemsGyroParams
from psabench.mems_gyro.plan import Dwell
from psabench.mems_gyro.run import run_gyro
from psabench.mems_gyro.wire import measure_gyro
from psabench.procedures.head_bench import Silent

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "py/support"))
import physics

EPILOG = """\
examples (in the root of a checkout, with PYTHONPATH=.):
  python -m tests.coverage.mems_gyro                   200 gyros through the model of the sensor: minutes of one core
  python -m tests.coverage.mems_gyro --wire --runs 4   four of them through the wire

The table is the one of docs/procedures/mems_gyro.md.
"""
# Of struct cvg_dps in order: the scenario's values, and standard deviations of its spread.
GYRO: Mapping[str, tuple[float, float]] = {
    "u0_v": (2.5, 0.05),
    "scale_v_per_dps": (0.0125, 3e-4),
    "cross_y": (0.0, 0.01),
    "cross_z": (0.0, 0.01),
    "gx_dps_per_g": (0.0, 0.1),
    "gy_dps_per_g": (0.0, 0.1),
    "gz_dps_per_g": (0.0, 0.1),
    "square_per_dps": (0.0, 2e-6),
    "cube_per_dps2": (0.0, 5e-8),
    "quadrature_dps": (0.0, 30.0),
    "phase_deg": (0.0, 0.5),
    "u0_tc_v_per_k": (0.0, 0.0),
    "scale_tc_ppm_per_k": (0.0, 0.0),
    "phase_tc_deg_per_k": (0.0, 0.0),
    "noise_dps_rthz": (0.05, 0.0),
    "bias_instability_dps": (0.004, 0.0),
    "walk_dps_rts": (5e-5, 0.0),
    "ramp_dps_per_s": (0.0, 0.0),
    "quantum_v": (0.0, 0.0),
    "low_v": (0.25, 0.0),
    "high_v": (4.75, 0.0),
}
LOOKS = 20  # in a block
MOVE_S, RAMP_S = 6.0, 1.5  # of the inner axes to an attitude, of the outer one to a rate


class ModelBench:
    """A `TableBench` without a board: the sensor's and the table's model, and a chain with a drawn gain and zero."""

    def __init__(self, lib: ctypes.CDLL, p: MemsGyroParams, seed: int, changed: Mapping[str, float] = {}) -> None:
        """changed: fields of the gyro that are not drawn."""
        rng = np.random.default_rng(seed)
        self.truth = {name: mean + sd * rng.standard_normal() for name, (mean, sd) in GYRO.items()}
        self.truth.update(changed)
        tc_k = p.chain_off_k * rng.standard_normal(2)
        self._gain = 1.0 + 1e-6 * (p.chain_gain_ppm * rng.standard_normal() + p.chain_gain_tc_ppm_per_k * tc_k[0])
        self._zero_v = 1e-6 * (p.chain_zero_uv * rng.standard_normal() + p.chain_zero_tc_uv_per_k * tc_k[1])
        self._told = 1.0 + p.rate_ppm * 1e-6 * rng.standard_normal()
        askew_rad = np.radians(p.mount_arcsec / 3600.0) * rng.standard_normal(3)
        axes = [[2.0, 0.0, 1.0, 1.0], [1.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 1.0]]
        self._lab = physics.Lab(lib, latitude_rad=math.radians(p.latitude_deg), height_m=180.0, axes=axes, seed=seed)
        of = physics.doubles(list(self.truth.values()))
        self._lib, self._gyro = lib, lib.bridge_gyro(of, self._lab.g_mps2, seed)
        self._seat = physics.doubles([physics.TABLE, 0, 0, 0, *askew_rad])
        self._t_s, self._inner, self._rate_dps = 0.0, (0.0, 0.0), 0.0
        self.moved_v: list[float] = []  # of the rests of the series

    def __del__(self) -> None:
        self._lib.bridge_gyro_free(self._gyro)

    def orient(self, middle_deg: float, inner_deg: float) -> None:
        self._inner = (middle_deg, inner_deg)
        for axis, angle_deg in enumerate(self._inner, start=1):
            assert self._lib.bridge_position(self._lab.lab, axis, angle_deg, 60.0, physics.ns(self._t_s)) == 0
        self._t_s += MOVE_S

    def spin(self, rate_dps: float) -> None:
        assert self._lib.bridge_rate(self._lab.lab, 0, rate_dps, physics.ns(self._t_s)) == 0
        self._rate_dps = rate_dps
        self._t_s += RAMP_S

    def dwell(self, blocks: int, *, recording: bool = False) -> Dwell:
        heading_deg = math.degrees(self._lab.axis(0, self._t_s)[0])
        t0_s, means, moved = self._t_s, [], []
        out = (ctypes.c_double * 2)()
        every_s = BLOCK_S / LOOKS
        for _ in range(blocks):
            first_ns = physics.ns(self._t_s + every_s / 2)
            args = (self._seat, first_ns, physics.ns(every_s), LOOKS, out)
            self._lib.bridge_gyro_block(self._gyro, self._lab.lab, *args)
            means.append(out[0] * self._gain + self._zero_v)
            moved.append(out[1])
            self._t_s += BLOCK_S
        if self._rate_dps == 0.0 and not recording:
            self.moved_v.append(float(np.mean(moved)))
        return Dwell(
            middle_deg=self._inner[0],
            inner_deg=self._inner[1],
            heading_deg=heading_deg,
            rate_dps=self._rate_dps * self._told,
            t_s=t0_s,
            duration_s=BLOCK_S * blocks,
            blocks_v=np.array(means),
            recording=recording,
        )


Run = dict[str, tuple[float, float]]  # by estimate: error in U, error in standard uncertainties


def through_the_model(seed: int, p: MemsGyroParams, folder: str) -> Run:
    """One drawn gyro; the library is in the folder."""
    bench = ModelBench(library(folder), p, seed)
    dwells: list[Dwell] = []
    measure_gyro(bench, p, Silent(), dwells.append)
    right = expected_values(bench.truth)
    right["zero_v"] += float(np.mean(bench.moved_v))
    return errors_of(estimate_gyro(dwells, p), right)


libraries: dict[str, ctypes.CDLL] = {}


def library(folder: str) -> ctypes.CDLL:
    """Compiled once in a process, into a folder of its own: a process does not see another's half-written file."""
    if folder not in libraries:
        libraries[folder] = physics.build(Path(tempfile.mkdtemp(dir=folder)))
    return libraries[folder]


def through_the_wire(seed: int, p: MemsGyroParams, folder: str) -> Run:
    """The scenario mems_gyro with another seed: another specimen."""
    given = {"series": p.series, "dwell_s": p.dwell_s, "rest_s": p.rest_s}
    done = run_gyro(MemsGyroOptions(out=Path(folder) / f"run{seed}", seed=seed, params=given), Silent())
    assert done.truth is not None
    return errors_of(done.result, done.truth)


def errors_of(r: MemsGyroResult, right: Mapping[str, float]) -> Run:
    """Of what the readings determine."""
    return {e.name: _error(e, right[e.name]) for e in (*r.estimates, *r.noise) if e.identifiable}


def _error(e: Estimate, right: float) -> tuple[float, float]:
    return (e.value - right) / e.ci_half, (e.value - right) / e.sd


def table_rows(runs: Sequence[Run]) -> list[str]:
    """A Markdown row for each estimate, the last for all; the noise's terms apart."""
    names = list(dict.fromkeys(name for run in runs for name in run))
    rows, all_en = [], []
    for name in names:
        each = np.array([run[name] for run in runs if name in run])
        if not name.endswith(("_rth", "degph")):
            all_en.append(each[:, 0])
        inside = np.mean(np.abs(each[:, 0]) <= 1.0)
        rows.append(f"| {name} | {len(each)} | {100 * inside:.1f} % | {np.sqrt(np.mean(each[:, 1] ** 2)):.2f} |")
    en = np.concatenate(all_en)
    rows.append(f"| all of the model | {len(en)} | {100 * np.mean(np.abs(en) <= 1.0):.1f} % | |")
    return rows


def main(argv: Sequence[str] | None = None) -> int:
    """Prints the table."""
    p = argparse.ArgumentParser(description=__doc__, epilog=EPILOG, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("--runs", type=int, default=200, help="gyros (%(default)s)")
    p.add_argument("--first", type=int, default=1, help="seed of the first (%(default)s)")
    p.add_argument("--workers", type=int, default=1, help="processes (%(default)s)")
    p.add_argument("--wire", action="store_true", help="through table, board and CAN instead of the model alone")
    args = p.parse_args(argv)
    one = through_the_wire if args.wire else through_the_model
    seeds, params = range(args.first, args.first + args.runs), replace(MemsGyroParams())
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(args.workers) as pool:
        runs = []
        for run in pool.map(one, seeds, [params] * args.runs, [folder] * args.runs):
            runs.append(run)
            print(f"{len(runs)} of {args.runs}", file=sys.stderr, flush=True)
    print("| estimate | runs | within U | rms of error/u |\n|---|---|---|---|")
    print("\n".join(table_rows(runs)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
